// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "common/calibration.hpp"
#include "common/dataset.hpp"

namespace langgs::examples {

/// The files of one frame.
struct FrameFiles {
  double timestamp = 0;  ///< of colour [s]
  std::filesystem::path colour, depth;
  double depth_time_offset = 0;  ///< when depth was taken, relative to colour [s]
};

/// A sequence of image files, whatever the layout of its folder.
class ImageDataset : public Dataset {
 public:
  /// Throws IoError if a file is missing.
  ImageDataset(const DatasetOptions& options, const Calibration& calibration, std::vector<FrameFiles> files,
               std::vector<StampedPose> reference);

  [[nodiscard]] Camera camera() const override { return calibration_.camera; }
  [[nodiscard]] int size() const override { return static_cast<int>(files_.size()); }
  [[nodiscard]] double timestamp(int i) const override { return files_.at(i).timestamp; }
  [[nodiscard]] RgbdFrame frame(int i) const override;
  [[nodiscard]] std::string name(int i) const override { return files_.at(i).colour.stem().string(); }
  [[nodiscard]] std::vector<StampedPose> reference() const override { return reference_; }
  [[nodiscard]] bool has_labels() const override { return has_labels_; }
  [[nodiscard]] Image<std::uint16_t> labels(int i) const override;
  [[nodiscard]] std::vector<std::string> class_names() const override { return class_names_; }
  [[nodiscard]] std::string description() const override;

 private:
  std::filesystem::path folder_;
  Calibration calibration_;
  Distortion distortion_;
  std::unique_ptr<UndistortMap> undistort_;  ///< null without distortion
  std::vector<FrameFiles> files_;
  std::vector<StampedPose> reference_;
  bool has_labels_ = false;
  std::vector<std::string> class_names_;
};

/// Lines `id name`, ids in any order; # starts a comment line. Throws IoError.
[[nodiscard]] std::vector<std::string> read_class_names(const std::filesystem::path& path);

}  // namespace langgs::examples
