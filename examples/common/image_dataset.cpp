// SPDX-License-Identifier: Apache-2.0
#include "common/image_dataset.hpp"

#include <algorithm>
#include <cmath>
#include <set>

#include "common/image_files.hpp"
#include "langgs/core/error.hpp"
#include "langgs/io/atomic_file.hpp"
#include "langgs/io/text.hpp"

namespace langgs::examples {

namespace fs = std::filesystem;

ImageDataset::ImageDataset(const DatasetOptions& options, const Calibration& calibration, std::vector<FrameFiles> files,
                           std::vector<StampedPose> reference)
    : folder_(options.input),
      calibration_(calibration),
      distortion_(choose_distortion(options.distortion, calibration, options.input)),
      files_(std::move(files)),
      reference_(std::move(reference)) {
  if (files_.empty())
    detail::raise<IoError>(folder_.string(),
                           " has no frame with both colour and depth; check its lists and time stamps");
  for (const FrameFiles& f : files_)
    for (const fs::path& path : {f.colour, f.depth})
      if (!fs::is_regular_file(path))
        detail::raise<IoError>(path.string(), " is missing; complete the folder or remove its line from the list");
  std::stable_sort(reference_.begin(), reference_.end(),
                   [](const StampedPose& a, const StampedPose& b) { return a.timestamp < b.timestamp; });
  if (!distortion_.is_zero()) undistort_ = std::make_unique<UndistortMap>(calibration_.camera, distortion_);
  has_labels_ = fs::is_directory(folder_ / "class");
  if (has_labels_ && fs::exists(folder_ / "classes.txt")) class_names_ = read_class_names(folder_ / "classes.txt");
}

RgbdFrame ImageDataset::frame(int i) const {
  const FrameFiles& files = files_.at(i);
  RgbdFrame frame;
  frame.timestamp = files.timestamp;
  frame.depth_time_offset = files.depth_time_offset;
  frame.colour = read_colour(files.colour, camera());
  frame.depth = read_depth(files.depth, camera(), calibration_.depth_scale);
  if (undistort_) {
    frame.colour = undistort_->smooth(frame.colour);
    frame.depth = undistort_->nearest(frame.depth);
  }
  return frame;
}

Image<std::uint16_t> ImageDataset::labels(int i) const {
  if (!has_labels_) return {};
  Image<std::uint16_t> labels = read_labels(folder_ / "class" / (name(i) + ".png"), camera());
  return undistort_ ? undistort_->nearest(labels) : labels;
}

std::string ImageDataset::description() const {
  const Camera& c = calibration_.camera;
  std::string text = detail::concat(size(), " frames of ", c.width, "x", c.height,
                                    ", calibration: ", calibration_.source, ", distortion: ");
  if (distortion_.is_zero()) return text + "none";
  return text + detail::concat(distortion_.k1, " ", distortion_.k2, " ", distortion_.p1, " ", distortion_.p2, " ",
                               distortion_.k3, " (removed)");
}

std::vector<std::string> read_class_names(const fs::path& path) {
  constexpr std::uint64_t kMaxBytes = 1 << 22;
  constexpr double kMaxLabel = 65535;
  const std::string content = read_file(path, kMaxBytes);
  std::vector<std::string> names;
  std::string_view rest = content, line;
  for (int number = 1; detail::next_line(rest, line); ++number) {
    std::string_view words = detail::meaningful(line);
    if (words.empty()) continue;
    const auto id = detail::parse_number(detail::next_word(words));
    const std::string_view name = detail::trimmed(words);
    if (!id || *id != std::floor(*id) || *id < 0 || *id > kMaxLabel || name.empty())
      detail::raise<IoError>(path.string(), ":", number, ": expected 'id name' with an id in [0, 65535], found '",
                             detail::excerpt(line), "'");
    const auto index = static_cast<std::size_t>(*id);
    if (index >= names.size()) names.resize(index + 1);
    names[index] = name;
  }
  if (names.empty()) detail::raise<IoError>(path.string(), " names no class; it needs lines 'id name'");
  return names;
}

}  // namespace langgs::examples
