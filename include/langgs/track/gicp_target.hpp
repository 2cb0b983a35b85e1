// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include "langgs/core/error.hpp"
#include "langgs/track/neighbours.hpp"

namespace langgs {

/// How the shape of a map Gaussian enters the registration (A.6.8).
enum class TargetShape {
  isotropic,    ///< kIsotropicTarget I: the source's surface shape decides alone, as in the paper's backbone
  anisotropic,  ///< variances sorted and divided by the middle one, clamped to [kThinnestTarget, 1]
};

/// Variance of an isotropic target relative to a source's variance along its surface.
inline constexpr float kIsotropicTarget = 1e-3f;
/// Smallest relative variance of an anisotropic target: an exactly flat Gaussian must not fix a point infinitely well.
inline constexpr float kThinnestTarget = 1e-3f;

/// What a frame is registered to: means and covariances in the world frame, with their k-d tree.
///
/// Immutable after construction and move-only: share it between threads as std::shared_ptr<const GicpTarget>.
/// Elements with non-finite values, or with a mean farther than kMaxTargetCoordinate from the origin, are left out.
class GicpTarget {
 public:
  static constexpr float kMaxTargetCoordinate = 1e5f;  ///< metres; beyond, float cannot hold centimetres

  /// An empty target; aligning to it reports too few correspondences.
  GicpTarget() : GicpTarget(std::vector<Eigen::Vector3f>{}, std::vector<Eigen::Matrix3f>{}) {}

  /// means [N, 3] in metres; covariances [N, 3, 3] symmetric positive semi-definite and of the sources' scale (variance
  /// along a surface is 1). Throws InvalidArgument if the lengths differ.
  GicpTarget(std::vector<Eigen::Vector3f> means, std::vector<Eigen::Matrix3f> covariances) {
    LANGGS_EXPECTS(means.size() == covariances.size(), "target has ", means.size(), " means and ", covariances.size(),
                   " covariances; pass one covariance per mean");
    std::size_t kept = 0;
    for (std::size_t i = 0; i < means.size(); ++i) {
      // Written so that NaN fails the comparison.
      const bool usable =
          means[i].allFinite() && means[i].cwiseAbs().maxCoeff() <= kMaxTargetCoordinate && covariances[i].allFinite();
      if (!usable) continue;
      means[kept] = means[i];
      covariances[kept] = covariances[i];
      ++kept;
    }
    means.resize(kept);
    covariances.resize(kept);
    covariances_ = std::move(covariances);
    tree_ = std::make_unique<const NeighbourTree>(std::move(means));
  }

  /// From map Gaussians: means [N, 3], quaternions [N, 4] as w, x, y, z (any length), scales [N, 3] standard
  /// deviations in metres (after exp). Throws InvalidArgument if the lengths differ.
  static GicpTarget from_gaussians(std::vector<Eigen::Vector3f> means, const std::vector<Eigen::Vector4f>& quaternions,
                                   const std::vector<Eigen::Vector3f>& scales, TargetShape shape) {
    LANGGS_EXPECTS(means.size() == quaternions.size() && means.size() == scales.size(), "target has ", means.size(),
                   " means, ", quaternions.size(), " quaternions and ", scales.size(), " scales; pass equal numbers");
    std::vector<Eigen::Matrix3f> covariances(means.size());
    for (std::size_t i = 0; i < means.size(); ++i) covariances[i] = target_covariance(quaternions[i], scales[i], shape);
    return GicpTarget(std::move(means), std::move(covariances));
  }

  /// World covariance of one Gaussian as the registration sees it: relative to its own middle axis, no unit. Isotropic
  /// too where the Gaussian has no surface: fewer than two positive scales, or values that are not finite.
  [[nodiscard]] static Eigen::Matrix3f target_covariance(const Eigen::Vector4f& quaternion,
                                                         const Eigen::Vector3f& scales, TargetShape shape) {
    const Eigen::Matrix3f isotropic = kIsotropicTarget * Eigen::Matrix3f::Identity();
    if (shape == TargetShape::isotropic || !scales.allFinite() || !quaternion.allFinite()) return isotropic;
    Eigen::Vector3f sorted = scales;
    std::sort(sorted.data(), sorted.data() + 3);
    if (!(sorted[1] > 0)) return isotropic;  // a needle or a point has no surface
    const Eigen::Vector3f ratio = scales / sorted[1];
    const Eigen::Vector3f variances = ratio.cwiseAbs2().cwiseMax(kThinnestTarget).cwiseMin(1.0f);
    const Eigen::Matrix3f axes =
        Eigen::Quaternionf(quaternion[0], quaternion[1], quaternion[2], quaternion[3]).normalized().toRotationMatrix();
    return axes * variances.asDiagonal() * axes.transpose();
  }

  [[nodiscard]] int size() const { return tree_->size(); }
  [[nodiscard]] const Eigen::Vector3f& mean(int i) const { return (*tree_)[i]; }
  [[nodiscard]] const Eigen::Matrix3f& covariance(int i) const { return covariances_[i]; }
  /// The mean nearest to `query` if closer than `bound`, else `bound` (see NeighbourTree).
  [[nodiscard]] Neighbour nearest(const Eigen::Vector3f& query, Neighbour bound) const {
    return tree_->nearest(query, bound);
  }

 private:
  std::vector<Eigen::Matrix3f> covariances_;
  std::unique_ptr<const NeighbourTree> tree_;
};

}  // namespace langgs
