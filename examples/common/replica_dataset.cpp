// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <map>

#include "common/image_dataset.hpp"
#include "langgs/core/error.hpp"
#include "langgs/io/atomic_file.hpp"
#include "langgs/io/text.hpp"

namespace langgs::examples {

namespace fs = std::filesystem;

namespace {

constexpr double kFramesPerSecond = 30;  // the layout has no times

/// The files `prefix<number>.png|jpg|jpeg` of a folder by their numbers; with an empty prefix any name may come first.
std::map<int, fs::path> numbered_images(const fs::path& folder, std::string_view prefix) {
  std::map<int, fs::path> found;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
    std::string extension = entry.path().extension().string();
    for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    if (extension != ".png" && extension != ".jpg" && extension != ".jpeg") continue;
    const std::string stem = entry.path().stem().string();
    std::size_t digits = stem.size();
    while (digits > 0 && std::isdigit(static_cast<unsigned char>(stem[digits - 1]))) --digits;
    int number = 0;
    if (std::from_chars(stem.data() + digits, stem.data() + stem.size(), number).ec != std::errc{}) continue;
    if (!prefix.empty() && stem.substr(0, digits) != prefix) continue;
    if (!found.emplace(number, entry.path()).second)
      detail::raise<IoError>(folder.string(), " has two images with number ", number, ", ",
                             found[number].filename().string(), " and ", entry.path().filename().string(),
                             "; remove one");
  }
  if (error) detail::raise<IoError>("cannot list ", folder.string(), ": ", error.message(), "; check the folder");
  return found;
}

/// Lines of 16 numbers: camera-to-world, row by row.
std::vector<Pose> read_matrices(const fs::path& path) {
  constexpr std::uint64_t kMaxBytes = std::uint64_t{1} << 30;
  const std::string content = read_file(path, kMaxBytes);
  std::vector<Pose> poses;
  std::string_view rest = content, line;
  for (int number = 1; detail::next_line(rest, line); ++number) {
    std::string_view words = detail::meaningful(line);
    if (words.empty()) continue;
    Eigen::Matrix4d m;
    bool valid = true;
    for (int i = 0; i < 16; ++i) {
      const auto value = detail::parse_number(detail::next_word(words));
      m(i / 4, i % 4) = value.value_or(0);
      valid = valid && value && std::abs(*value) < 1e9;
    }
    const Eigen::Matrix3d r = m.topLeftCorner<3, 3>();
    constexpr double kTolerance = 1e-3;
    if (!valid || !detail::trimmed(words).empty() || (m.row(3) - Eigen::RowVector4d(0, 0, 0, 1)).norm() > kTolerance ||
        (r * r.transpose() - Eigen::Matrix3d::Identity()).norm() > kTolerance || r.determinant() < 0)
      detail::raise<IoError>(path.string(), ":", number,
                             ": expected the 16 numbers of a rigid 4x4 matrix, row by row, ", "found '",
                             detail::excerpt(line), "'");
    Pose pose = Pose::Identity();
    pose.matrix() = m;
    pose.matrix().row(3) << 0, 0, 0, 1;
    poses.push_back(renormalized(pose));
  }
  if (poses.empty()) detail::raise<IoError>(path.string(), " has no poses; it needs lines of 16 numbers");
  return poses;
}

Calibration replica_calibration(const fs::path& folder) {
  // NICE-SLAM keeps one file for all rooms, beside their folders.
  for (const fs::path& file : {folder / "cam_params.json", folder / ".." / "cam_params.json"})
    if (fs::exists(file)) return read_cam_params(file);
  if (fs::exists(folder / "calibration.txt")) return read_calibration(folder / "calibration.txt");
  Calibration calibration;
  calibration.camera = {600, 600, 599.5f, 339.5f, 1200, 680};
  calibration.depth_scale = 6553.5;
  calibration.distortion = Distortion{};
  calibration.source = "NICE-SLAM's values for Replica";
  return calibration;
}

}  // namespace

std::unique_ptr<Dataset> make_replica_dataset(const DatasetOptions& options) {
  const fs::path& folder = options.input;
  const bool results = fs::is_directory(folder / "results");
  if (!results && !(fs::is_directory(folder / "images") && fs::is_directory(folder / "depth_images")))
    detail::raise<IoError>(folder.string(), " has neither results/ nor images/ with depth_images/ nor rgb.txt; give ",
                           "the folder of one sequence");
  const auto colour = results ? numbered_images(folder / "results", "frame") : numbered_images(folder / "images", "");
  const auto depth =
      results ? numbered_images(folder / "results", "depth") : numbered_images(folder / "depth_images", "");
  std::vector<Pose> poses;
  if (fs::exists(folder / "traj.txt")) poses = read_matrices(folder / "traj.txt");

  std::vector<FrameFiles> files;
  std::vector<StampedPose> reference;
  for (const auto& [number, path] : colour) {
    const auto partner = depth.find(number);
    if (partner == depth.end())
      detail::raise<IoError>(path.string(), " has no depth image with number ", number, "; complete the folder");
    const double timestamp = number / kFramesPerSecond;
    files.push_back({timestamp, path, partner->second});
    if (poses.empty()) continue;
    if (static_cast<std::size_t>(number) >= poses.size())
      detail::raise<IoError>((folder / "traj.txt").string(), " has ", poses.size(),
                             " poses but there is a frame number ", number, "; complete or remove traj.txt");
    reference.push_back({timestamp, poses[number]});
  }
  return std::make_unique<ImageDataset>(options, replica_calibration(folder), std::move(files), std::move(reference));
}

}  // namespace langgs::examples
