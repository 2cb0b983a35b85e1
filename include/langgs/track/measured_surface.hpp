// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "langgs/core/error.hpp"
#include "langgs/core/pose.hpp"
#include "langgs/track/grid_target.hpp"
#include "langgs/track/source_cloud.hpp"

namespace langgs {

/// The chosen points of a cloud as Gaussians of a target, with the covariances that they had as sources.
[[nodiscard]] inline std::vector<TargetGaussian> measured(const SourceCloud& cloud,
                                                          const std::vector<std::int32_t>& chosen, const Camera& camera,
                                                          const Pose& T_world_camera, TargetShape shape) {
  const Eigen::Matrix3f rotation = T_world_camera.linear().cast<float>();
  const Eigen::Matrix3f isotropic = kIsotropicTarget * Eigen::Matrix3f::Identity();
  std::vector<TargetGaussian> result;
  result.reserve(chosen.size());
  for (const std::int32_t i : chosen) {
    const bool surface = shape == TargetShape::anisotropic && cloud.trackable[i];
    const Eigen::Matrix3f covariance =
        surface ? Eigen::Matrix3f(rotation * cloud.covariances[i] * rotation.transpose()) : isotropic;
    const Eigen::Vector2f pixel = cloud.pixels[i].cast<float>();
    result.push_back({(T_world_camera * cloud.points[i].cast<double>()).cast<float>(),
                      cloud.intensity.sample(camera, pixel.x(), pixel.y()), symmetric3(covariance)});
  }
  return result;
}

/// The map's Gaussians as they were measured when they were inserted: what frames are registered to.
///
/// Optimisation moves Gaussians to where images render best. That is not where the surface is: a target that follows
/// costs three times the trajectory error on the built-in room (docs/benchmarks.md). A Gaussian counts as long as the
/// map has it, opaque, and not farther than kStrayed from where it was measured.
class MeasuredSurface {
 public:
  static constexpr float kStrayed = 0.05f;  ///< [m]

  /// Gaussians that the map has appended, in its order.
  void append(const std::vector<TargetGaussian>& gaussians) {
    gaussians_.insert(gaussians_.end(), gaussians.begin(), gaussians.end());
  }

  /// The map keeps the Gaussians whose flag is not 0.
  void prune(const std::vector<std::int32_t>& keep) {
    LANGGS_EXPECTS(keep.size() == gaussians_.size(), "pruning got ", keep.size(), " flags for ", gaussians_.size(),
                   " measured Gaussians; give one flag for each");
    std::size_t kept = 0;
    for (std::size_t i = 0; i < gaussians_.size(); ++i)
      if (keep[i] != 0) gaussians_[kept++] = gaussians_[i];
    gaussians_.resize(kept);
  }

  [[nodiscard]] int size() const { return static_cast<int>(gaussians_.size()); }
  /// Where Gaussian i was measured [m], world frame.
  [[nodiscard]] const Eigen::Vector3f& mean(int i) const { return gaussians_[i].mean; }

  /// The target for a map whose Gaussian i is now at `mean(i)` and counts if `is_opaque(i)`. Shares with the target
  /// made before the blocks in which nothing came or went.
  template <class Mean, class IsOpaque>
  [[nodiscard]] std::shared_ptr<const GridTarget> target(Mean&& mean, IsOpaque&& is_opaque) {
    std::vector<TargetGaussian> present;
    present.reserve(gaussians_.size());
    for (int i = 0; i < size(); ++i) {
      const Eigen::Vector3f way = mean(i) - gaussians_[i].mean;
      if (is_opaque(i) && way.squaredNorm() <= kStrayed * kStrayed) present.push_back(gaussians_[i]);
    }
    target_ = std::make_shared<const GridTarget>(target_->renewed(present));
    return target_;
  }

 private:
  std::vector<TargetGaussian> gaussians_;
  std::shared_ptr<const GridTarget> target_ = std::make_shared<const GridTarget>();
};

}  // namespace langgs
