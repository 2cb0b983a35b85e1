// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <concepts>
#include <cstdint>
#include <vector>

#include "langgs/core/error.hpp"

/// @file What a frame is registered to: map Gaussians, and how one asks for the nearest of them.

namespace langgs {

/// How the shape of a map Gaussian enters the registration (A.6.8).
enum class TargetShape {
  isotropic,    ///< kIsotropicTarget I: the source's surface shape decides alone, as in the paper's backbone
  anisotropic,  ///< planes: as measured with the frame (MeasuredSurface), or from scales (target_covariance)
};

/// Variance of an isotropic target relative to a source's variance along its surface.
inline constexpr float kIsotropicTarget = 1e-3f;
/// Smallest relative variance of an anisotropic target: an exactly flat Gaussian must not fix a point infinitely well.
inline constexpr float kThinnestTarget = 1e-3f;
/// Means farther from the origin are left out of targets [m]: beyond, float cannot hold centimetres.
inline constexpr float kMaxTargetCoordinate = 1e5f;

/// Upper triangle of a symmetric matrix: xx, xy, xz, yy, yz, zz.
using Symmetric3 = std::array<float, 6>;

[[nodiscard]] inline Symmetric3 symmetric3(const Eigen::Matrix3f& m) {
  return {m(0, 0), m(0, 1), m(0, 2), m(1, 1), m(1, 2), m(2, 2)};
}

/// One Gaussian of a target.
struct TargetGaussian {
  Eigen::Vector3f mean;   ///< [m], world frame
  float intensity = -1;   ///< grey value in [0, 1]; negative: not known
  Symmetric3 covariance;  ///< of the sources' scale: variance along a surface is 1
};

/// World covariance of one Gaussian as the registration sees it, for a target from a map without its frames, such as a
/// loaded one: variances sorted, relative to the middle one, clamped to [kThinnestTarget, 1]; no unit.
/// quaternion: w, x, y, z, of any length; scales: standard deviations [m]. Isotropic too where the Gaussian has no
/// surface: fewer than two positive scales, or values that are not finite.
[[nodiscard]] inline Eigen::Matrix3f target_covariance(const Eigen::Vector4f& quaternion, const Eigen::Vector3f& scales,
                                                       TargetShape shape) {
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

/// Answer to the question for the nearest Gaussian, with what may become the nearest when the query moves.
struct TargetMatch {
  static constexpr int kRunnersUp = 3;
  const TargetGaussian* gaussian = nullptr;  ///< null: none is closer than asked; lives as long as the target
  float squared_distance = 0;                ///< [m^2]
  /// Others that are near, ascending; null beyond as many as there are. None without a nearest one.
  std::array<const TargetGaussian*, kRunnersUp> runners_up{};
  /// Every Gaussian that is not named here is at least this far away [m]: a query nearby has its nearest among these.
  float rest_beyond = 0;
};

/// What GicpTracker can register to.
template <class T>
concept RegistrationTarget = requires(const T& target, const Eigen::Vector3f& query, float radius) {
  { target.size() } -> std::same_as<int>;
  { target.nearest(query, radius) } -> std::same_as<TargetMatch>;
};

namespace detail {

[[nodiscard]] inline bool is_usable(const TargetGaussian& g) {
  const Eigen::Map<const Eigen::Matrix<float, 6, 1>> covariance(g.covariance.data());
  // Written so that NaN fails the comparison.
  return g.mean.cwiseAbs().maxCoeff() <= kMaxTargetCoordinate && g.mean.allFinite() && covariance.allFinite();
}

}  // namespace detail
}  // namespace langgs
