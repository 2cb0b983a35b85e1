// SPDX-License-Identifier: Apache-2.0
#include "common/calibration.hpp"

#include <array>
#include <cctype>
#include <cmath>
#include <nlohmann/json.hpp>
#include <string_view>
#include <vector>

#include "langgs/core/error.hpp"
#include "langgs/io/atomic_file.hpp"
#include "langgs/io/text.hpp"

namespace langgs::examples {

namespace fs = std::filesystem;

namespace {

constexpr const char* kLine = "'fx fy cx cy width height depth_scale [k1 k2 p1 p2 k3]'";
constexpr std::uint64_t kMaxSettingsBytes = 1 << 20;

/// All numbers of a line, or nothing if a word is none.
std::optional<std::vector<double>> numbers_of(std::string_view line) {
  std::vector<double> numbers;
  for (;;) {
    const std::string_view word = detail::next_word(line);
    if (word.empty()) return numbers;
    const auto number = detail::parse_number(word);
    if (!number) return std::nullopt;
    numbers.push_back(*number);
  }
}

/// Checks by the camera's own contract, but says which file is wrong.
void expect_usable(const Calibration& c, double width, double height, const std::string& file) {
  if (width != std::floor(width) || height != std::floor(height) || std::abs(width) > 1e6 || std::abs(height) > 1e6)
    detail::raise<IoError>(file, ": image size ", width, "x", height, "; width and height must be whole numbers");
  if (!(c.depth_scale > 0 && c.depth_scale < 1e9))
    detail::raise<IoError>(file, ": depth_scale is ", c.depth_scale,
                           "; it must be positive: the stored value that means one metre, such as 1000 or 5000");
  try {
    validate(c.camera);
  } catch (const InvalidArgument& error) {
    detail::raise<IoError>(file, ": ", error.what());
  }
}

/// Whether `name` holds `word` and no further letter or digit after it: "fr1" in "tum_fr1_xyz", not in "fr12".
bool holds_word(const std::string& name, std::string_view word) {
  for (std::size_t at = name.find(word); at != std::string::npos; at = name.find(word, at + 1)) {
    const bool begins = at == 0 || !std::isalnum(static_cast<unsigned char>(name[at - 1]));
    const std::size_t end = at + word.size();
    if (begins && (end == name.size() || !std::isalnum(static_cast<unsigned char>(name[end])))) return true;
  }
  return false;
}

}  // namespace

Calibration read_calibration(const fs::path& path) {
  const std::string file = path.string(), content = read_file(path, kMaxSettingsBytes);
  std::string_view rest = content, line;
  std::optional<Calibration> result;
  for (int number = 1; detail::next_line(rest, line); ++number) {
    const std::string_view words = detail::meaningful(line);
    if (words.empty()) continue;
    const auto v = numbers_of(words);
    if (!v || (v->size() != 7 && v->size() != 12))
      detail::raise<IoError>(file, ":", number, ": expected ", kLine, ", found '", detail::excerpt(line), "'");
    if (result) detail::raise<IoError>(file, ":", number, ": a second line of numbers; keep one line ", kLine);
    const auto at = [&](int i) { return static_cast<float>((*v)[i]); };
    result.emplace();
    result->camera = {at(0), at(1), at(2), at(3), 0, 0};
    if (std::abs((*v)[4]) < 1e6 && std::abs((*v)[5]) < 1e6) {
      result->camera.width = static_cast<int>((*v)[4]);
      result->camera.height = static_cast<int>((*v)[5]);
    }
    result->depth_scale = (*v)[6];
    if (v->size() == 12) result->distortion = Distortion{(*v)[7], (*v)[8], (*v)[9], (*v)[10], (*v)[11]};
    result->source = "calibration.txt";
    expect_usable(*result, (*v)[4], (*v)[5], file);
  }
  if (!result) detail::raise<IoError>(file, " has no calibration; write one line ", kLine);
  return *result;
}

std::optional<Calibration> known_calibration(const fs::path& folder) {
  std::error_code ignored;
  fs::path whole = fs::weakly_canonical(folder, ignored);
  if (ignored) whole = folder;
  if (whole.filename().empty()) whole = whole.parent_path();  // "name/"
  std::string name = whole.filename().string();
  for (char& c : name) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  struct Known {
    int number;
    Camera camera;
    Distortion distortion;
    double depth_delay;
  };
  // The delay of the Kinect of fr1 and fr2 is where frames of fr1_xyz, turned into each other by poses found from depth
  // alone, look most alike (docs/benchmarks.md).
  // https://cvg.cit.tum.de/data/datasets/rgbd-dataset/file_formats: the depth images carry their scale correction.
  const std::array<Known, 3> cameras = {
      Known{1, {517.3f, 516.5f, 318.6f, 255.3f, 640, 480}, {0.2624, -0.9531, -0.0054, 0.0026, 1.1633}, 0.02},
      Known{2, {520.9f, 521.0f, 325.1f, 249.7f, 640, 480}, {0.2312, -0.7849, -0.0033, -0.0001, 0.9172}, 0.02},
      Known{3, {535.4f, 539.2f, 320.1f, 247.6f, 640, 480}, {}, 0}};
  for (const Known& known : cameras) {
    const std::string digit = std::to_string(known.number);
    if (holds_word(name, "fr" + digit) || holds_word(name, "freiburg" + digit))
      return Calibration{known.camera, 5000, known.distortion, known.depth_delay, "known values of fr" + digit};
  }
  return std::nullopt;
}

Calibration tum_calibration(const fs::path& folder) {
  const fs::path file = folder / "calibration.txt";
  if (fs::exists(file)) return read_calibration(file);
  if (auto known = known_calibration(folder)) return *known;
  detail::raise<IoError>(file.string(), " is missing and the folder's name names no known camera (fr1, fr2, fr3); ",
                         "write one line ", kLine, " into it, such as '525 525 319.5 239.5 640 480 5000'");
}

Calibration read_cam_params(const fs::path& path) {
  const nlohmann::json json =
      nlohmann::json::parse(read_file(path, kMaxSettingsBytes), nullptr, /*allow_exceptions=*/false);
  const auto fail = [&](const std::string& what) {
    detail::raise<IoError>(path.string(), ": ", what,
                           R"(; it needs {"camera": {"w":, "h":, "fx":, "fy":, "cx":, "cy":, "scale":}})");
  };
  if (json.is_discarded() || !json.is_object()) fail("not a JSON object");
  if (!json.contains("camera") || !json["camera"].is_object()) fail("'camera' is missing");
  const auto number = [&](const char* key) {
    const auto value = json["camera"].find(key);
    if (value == json["camera"].end() || !value->is_number()) fail(std::string("'") + key + "' is not a number");
    return value->get<double>();
  };
  const double width = number("w"), height = number("h");
  const auto side = [](double value) { return std::abs(value) < 1e6 ? static_cast<int>(value) : 0; };
  Calibration result;
  result.camera = {static_cast<float>(number("fx")),
                   static_cast<float>(number("fy")),
                   static_cast<float>(number("cx")),
                   static_cast<float>(number("cy")),
                   side(width),
                   side(height)};
  result.depth_scale = number("scale");
  result.distortion = Distortion{};
  result.source = "cam_params.json";
  expect_usable(result, width, height, path.string());
  return result;
}

Distortion choose_distortion(const std::string& option, const Calibration& calibration, const fs::path& folder) {
  if (option == "none") return {};
  if (option == "auto") {
    if (calibration.distortion) return *calibration.distortion;
    const auto known = known_calibration(folder);
    // The same sequence may have been rectified, cropped or resized; then its intrinsics differ.
    const auto near = [](float a, float b) { return std::abs(a - b) < 0.5f; };
    const Camera& c = calibration.camera;
    if (known && c.width == known->camera.width && c.height == known->camera.height && near(c.fx, known->camera.fx) &&
        near(c.fy, known->camera.fy) && near(c.cx, known->camera.cx) && near(c.cy, known->camera.cy))
      return *known->distortion;
    return {};
  }
  const auto v = numbers_of(option);
  LANGGS_EXPECTS(v && v->size() == 5, "--distortion '", detail::excerpt(option),
                 "'; give auto, none or five numbers \"k1 k2 p1 p2 k3\"");
  return {(*v)[0], (*v)[1], (*v)[2], (*v)[3], (*v)[4]};
}

double choose_depth_delay(const std::string& option, const fs::path& folder) {
  if (option == "auto") {
    const auto known = known_calibration(folder);
    return known ? known->depth_delay : 0;
  }
  const auto v = numbers_of(option);
  LANGGS_EXPECTS(v && v->size() == 1 && std::abs(v->front()) <= 1, "--depth-delay '", detail::excerpt(option),
                 "'; give auto, or seconds in [-1, 1]");
  return v->front();
}

}  // namespace langgs::examples
