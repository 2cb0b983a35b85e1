// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

#include "langgs/core/error.hpp"
#include "langgs/core/pose.hpp"
#include "langgs/eval/association.hpp"

/// @file Absolute trajectory error.

namespace langgs {

/// Result of the protocol `ate_umeyama_se3`. RMSE is never below the mean; papers report either, so both are here.
struct AteResult {
  double rmse_m = 0, mean_m = 0, median_m = 0, max_m = 0;  ///< of the camera positions' distances [m]
  std::size_t matched = 0;                                 ///< pairs compared
  Pose T_reference_estimate = Pose::Identity();            ///< the alignment that was applied to the estimate
};

/// The rigid transform (no scale) that brings `from` [N, 3] onto `onto` [N, 3] in the least squares sense
/// (Umeyama 1991, eq. 40-42). Where the points leave a rotation free (one point, a line) it is one of the best.
[[nodiscard]] inline Pose umeyama_se3(std::span<const Eigen::Vector3d> from, std::span<const Eigen::Vector3d> onto) {
  LANGGS_EXPECTS(!from.empty() && from.size() == onto.size(), "cannot align ", from.size(), " points onto ",
                 onto.size(), "; give pairs");
  const double weight = 1.0 / static_cast<double>(from.size());
  Eigen::Vector3d mean_from = Eigen::Vector3d::Zero(), mean_onto = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < from.size(); ++i) {
    mean_from += weight * from[i];
    mean_onto += weight * onto[i];
  }
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < from.size(); ++i)
    covariance += weight * (onto[i] - mean_onto) * (from[i] - mean_from).transpose();
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(covariance, Eigen::ComputeFullU | Eigen::ComputeFullV);
  // Without the sign the best orthogonal matrix of noisy or flat trajectories may be a mirror.
  const double sign = svd.matrixU().determinant() * svd.matrixV().determinant() < 0 ? -1 : 1;
  Pose transform = Pose::Identity();
  transform.linear() = svd.matrixU() * Eigen::Vector3d(1, 1, sign).asDiagonal() * svd.matrixV().transpose();
  transform.translation() = mean_onto - transform.linear() * mean_from;
  return transform;
}

/// Protocol `ate_umeyama_se3`: pairs each estimated pose with the reference nearest in time (at most `max_gap` [s]
/// apart), aligns estimate onto reference without scale and measures the distances of the camera positions.
/// Throws InvalidArgument for fewer than three pairs (three points are the least that fix a rotation; with fewer the
/// error would be 0 whatever the estimate) and for poses that are not finite.
[[nodiscard]] inline AteResult ate_umeyama_se3(std::span<const StampedPose> estimate,
                                               std::span<const StampedPose> reference, double max_gap = 0.01) {
  const auto stamps = [](std::span<const StampedPose> poses) {
    std::vector<double> result;
    for (const StampedPose& pose : poses) result.push_back(pose.timestamp);
    return result;
  };
  const std::vector<StampPair> pairs = associate(stamps(estimate), stamps(reference), max_gap);
  LANGGS_EXPECTS(pairs.size() >= 3, "only ", pairs.size(), " of ", estimate.size(), " estimated poses have one of ",
                 reference.size(), " reference poses within ", max_gap,
                 " s; three are needed: check the time stamps or allow a larger gap");
  std::vector<Eigen::Vector3d> from, onto;
  for (const StampPair& pair : pairs) {
    from.push_back(estimate[pair.first].T_world_camera.translation());
    onto.push_back(reference[pair.second].T_world_camera.translation());
    // The bound keeps squares and their sums finite.
    LANGGS_EXPECTS(from.back().norm() < 1e100 && onto.back().norm() < 1e100, "pose at time ",
                   estimate[pair.first].timestamp, " is not finite; remove it from the trajectory");
  }
  AteResult result;
  result.matched = pairs.size();
  result.T_reference_estimate = umeyama_se3(from, onto);
  std::vector<double> errors;
  for (std::size_t i = 0; i < from.size(); ++i)
    errors.push_back((result.T_reference_estimate * from[i] - onto[i]).norm());
  for (const double error : errors) {
    result.mean_m += error;
    result.rmse_m += error * error;
  }
  const double count = static_cast<double>(errors.size());
  result.mean_m /= count;
  result.rmse_m = std::sqrt(result.rmse_m / count);
  std::sort(errors.begin(), errors.end());
  result.max_m = errors.back();
  result.median_m = 0.5 * (errors[(errors.size() - 1) / 2] + errors[errors.size() / 2]);
  return result;
}

}  // namespace langgs
