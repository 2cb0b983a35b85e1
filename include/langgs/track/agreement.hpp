// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "langgs/core/camera.hpp"
#include "langgs/core/image.hpp"
#include "langgs/core/pose.hpp"
#include "langgs/track/grid_target.hpp"

namespace langgs {

/// What a depth image says about a target seen from a pose: a registration that ended somewhere wrong still has small
/// residuals, but surfaces of the map then stand where the camera looks through.
struct DepthAgreement {
  int confirmed = 0;     ///< target Gaussians at the measured depth
  int contradicted = 0;  ///< target Gaussians in front of everything measured there

  /// Share of the confirmed ones; 1 where nothing can be said.
  [[nodiscard]] double share() const {
    const int n = confirmed + contradicted;
    return n < kFewest ? 1 : static_cast<double>(confirmed) / n;
  }
  static constexpr int kFewest = 30;
};

/// Looks at about `kSamples` Gaussians of the target that lie in the camera's view. depth: [H, W] metres, 0 unknown.
[[nodiscard]] inline DepthAgreement depth_agreement(const GridTarget& target, const Image<float>& depth,
                                                    const Camera& camera, const Pose& T_world_camera) {
  constexpr int kSamples = 8192, kAround = 3;                     // pixels to the sides: edges are not to be missed
  constexpr float kTolerance = 0.03f, kToleranceByDepth = 0.02f;  // [m], [1]
  const Eigen::Matrix3f R = T_world_camera.linear().transpose().cast<float>();
  const Eigen::Vector3f origin = T_world_camera.translation().cast<float>();
  DepthAgreement result;
  target.for_each(std::max(1, target.size() / kSamples), [&](const TargetGaussian& g) {
    const Eigen::Vector3f p = R * (g.mean - origin);
    if (!(p.z() > 0.1f)) return;
    const float u = camera.fx * p.x() / p.z() + camera.cx, v = camera.fy * p.y() / p.z() + camera.cy;
    if (!(u >= kAround && v >= kAround && u < static_cast<float>(camera.width - kAround - 1) &&
          v < static_cast<float>(camera.height - kAround - 1)))
      return;
    const int x = static_cast<int>(u + 0.5f), y = static_cast<int>(v + 0.5f);
    const float around[5] = {depth(x, y), depth(x - kAround, y), depth(x + kAround, y), depth(x, y - kAround),
                             depth(x, y + kAround)};
    const float tolerance = kTolerance + kToleranceByDepth * p.z();
    bool confirmed = false, in_front = true;
    for (const float z : around) {
      confirmed |= std::abs(z - p.z()) <= tolerance;
      in_front &= z > p.z() + tolerance;  // false for what was not measured
    }
    result.confirmed += confirmed;
    result.contradicted += in_front;
  });
  return result;
}

}  // namespace langgs
