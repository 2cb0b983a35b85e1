// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "langgs/core/image.hpp"

/// @file How numbers become colours. All pictures are 8-bit BGR, as OpenCV writes them.

namespace langgs::examples {

[[nodiscard]] cv::Mat picture_of(const Image<std::uint8_t>& rgb);
[[nodiscard]] cv::Mat picture_of(const Image<float>& rgb);  ///< in [0, 1]

/// Depth from `near` (warm) to `far` (cool) [m]; grey where nothing was measured or seen.
[[nodiscard]] cv::Mat depth_picture(const Image<float>& depth, float near, float far);

/// A colour for each label, unlike those of its neighbours; label 0 is dark grey.
[[nodiscard]] cv::Vec3b label_colour(int label);
[[nodiscard]] cv::Mat label_picture(const Image<std::uint16_t>& labels);

/// The three main directions of a set of feature vectors as red, green and blue.
class FeatureColours {
 public:
  /// Learns the directions from `samples` [n, dim], which may hold zero vectors. Power iteration from a fixed start:
  /// the same samples give the same colours.
  FeatureColours(const std::vector<float>& samples, int dim);

  /// Picture of features [height, width, dim]; black where there is none.
  [[nodiscard]] cv::Mat picture(const std::vector<float>& features, int width, int height) const;

 private:
  static constexpr int kAxes = 3;
  [[nodiscard]] bool project(const float* feature, float* out) const;

  int dim_;
  std::vector<double> mean_;
  std::vector<double> axes_;                  // [kAxes, dim]
  float low_[kAxes] = {}, high_[kAxes] = {};  // the range of each axis that becomes 0..255
};

}  // namespace langgs::examples
