// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <utility>
#include <vector>

#include "langgs/core/pose.hpp"
#include "langgs/track/intensity_image.hpp"
#include "langgs/track/rotation_alignment.hpp"

namespace langgs {

/// Where a lost camera may be: keyframes that look like the frame, and the surroundings of the last good pose.
class Relocalizer {
 public:
  /// A keyframe, T_world_camera of its colour image. Without colour nothing is kept.
  void remember(const Pose& T_world_camera, const IntensityImage& image) {
    if (image.empty()) return;
    if (static_cast<int>(keyframes_.size()) == kMostKeyframes) {  // every second one still covers the way
      for (std::size_t i = 0; 2 * i < keyframes_.size(); ++i) keyframes_[i] = std::move(keyframes_[2 * i]);
      keyframes_.resize(kMostKeyframes / 2);
    }
    keyframes_.push_back({T_world_camera, thumbnail(image)});
  }

  /// Poses to try, the more promising ones first.
  [[nodiscard]] std::vector<Pose> candidates(const Pose& last_good, const IntensityImage& image) const {
    std::vector<Pose> result{last_good};
    if (!image.empty() && !keyframes_.empty()) {
      const IntensityImage small = thumbnail(image);
      std::vector<std::pair<double, std::size_t>> order;
      for (std::size_t i = 0; i < keyframes_.size(); ++i)
        order.emplace_back(difference(keyframes_[i].second, small), i);
      const auto end = order.begin() + std::min<std::ptrdiff_t>(kAlike, static_cast<std::ptrdiff_t>(order.size()));
      std::partial_sort(order.begin(), end, order.end());
      for (auto it = order.begin(); it != end; ++it) {
        const auto& [pose, alike] = keyframes_[it->second];
        Pose turned = pose;
        turned.linear() = pose.linear() * align_rotation(alike, small, Eigen::Matrix3d::Identity()).R_last_now;
        result.push_back(turned);
      }
    }
    for (const double degrees : {15.0, 35.0})
      for (int axis = 0; axis < 2; ++axis)
        for (const int sign : {-1, 1}) {
          Pose turned = last_good;
          turned.linear() *= so3_exp(sign * degrees * std::numbers::pi / 180 * Eigen::Vector3d::Unit(axis));
          result.push_back(turned);
        }
    return result;
  }

 private:
  static constexpr int kMostKeyframes = 512, kAlike = 4, kColumns = 40;

  static IntensityImage thumbnail(const IntensityImage& image) {
    return detail::reduced(image, std::max(1, image.camera.width / kColumns));
  }
  /// Mean squared difference, the mean grey values removed.
  static double difference(const IntensityImage& a, const IntensityImage& b) {
    if (a.values.size() != b.values.size()) return 1;
    double sum = 0, squares = 0;
    for (std::size_t i = 0; i < a.values.size(); ++i) {
      const double d = a.values[i] - b.values[i];
      sum += d;
      squares += d * d;
    }
    const auto n = static_cast<double>(a.values.size());
    return squares / n - (sum / n) * (sum / n);
  }

  std::vector<std::pair<Pose, IntensityImage>> keyframes_;
};

}  // namespace langgs
