// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>

/// @file Rigid transforms. Names say their frames: `T_world_camera` maps camera coordinates to world coordinates.

namespace langgs {

/// A rigid transform in double precision; metres. Not over-aligned: its layout must not depend on the instruction set
/// that a translation unit is compiled for.
using Pose = Eigen::Transform<double, 3, Eigen::Isometry, Eigen::DontAlign>;

/// Tangent vector of SE(3), translation first: [rho; theta] (metres, radians).
using Twist = Eigen::Matrix<double, 6, 1>;

/// The cross-product matrix [v]x.
[[nodiscard]] inline Eigen::Matrix3d skew(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

/// Exp: so(3) -> SO(3) (Rodrigues), exact to rounding at any angle.
[[nodiscard]] inline Eigen::Matrix3d so3_exp(const Eigen::Vector3d& theta) {
  const double angle = theta.norm();
  if (angle < 1e-12) return Eigen::Matrix3d::Identity() + skew(theta);
  return Eigen::AngleAxisd(angle, theta / angle).toRotationMatrix();
}

/// Log: SO(3) -> so(3), angle in [0, pi].
[[nodiscard]] inline Eigen::Vector3d so3_log(const Eigen::Matrix3d& rotation) {
  const Eigen::AngleAxisd angle_axis{Eigen::Quaterniond{rotation}.normalized()};
  return angle_axis.angle() * angle_axis.axis();
}

/// Exp: se(3) -> SE(3) with the full left Jacobian V(theta) on the translation.
[[nodiscard]] inline Pose se3_exp(const Twist& xi) {
  const Eigen::Vector3d rho = xi.head<3>();
  const Eigen::Vector3d theta = xi.tail<3>();
  const double angle = theta.norm();
  // Series below the angle where (1 - cos) / angle^2 loses half of its digits.
  const bool small = angle < 1e-4;
  const double a2 = angle * angle;
  const double b = small ? 0.5 - a2 / 24 : (1 - std::cos(angle)) / a2;
  const double c = small ? 1.0 / 6 - a2 / 120 : (angle - std::sin(angle)) / (a2 * angle);
  const Eigen::Matrix3d hat = skew(theta);
  Pose pose = Pose::Identity();
  pose.linear() = so3_exp(theta);
  pose.translation() = rho + b * (hat * rho) + c * (hat * (hat * rho));
  return pose;
}

/// Log: SE(3) -> se(3), the inverse of se3_exp for rotations below pi.
[[nodiscard]] inline Twist se3_log(const Pose& pose) {
  const Eigen::Vector3d theta = so3_log(pose.linear());
  const double angle = theta.norm();
  const Eigen::Matrix3d hat = skew(theta);
  const double a2 = angle * angle;
  // cot(angle / 2) written as a tangent: sin / (1 - cos) loses digits at small angles.
  const double c = angle < 1e-4 ? 1.0 / 12 + a2 / 720 : (1 - 0.5 * angle / std::tan(0.5 * angle)) / a2;
  Twist xi;
  xi.head<3>() = (Eigen::Matrix3d::Identity() - 0.5 * hat + c * hat * hat) * pose.translation();
  xi.tail<3>() = theta;
  return xi;
}

/// The same transform with its rotation projected back onto SO(3); use after many compositions.
[[nodiscard]] inline Pose renormalized(const Pose& pose) {
  Pose result = pose;
  result.linear() = Eigen::Quaterniond{pose.linear()}.normalized().toRotationMatrix();
  return result;
}

[[nodiscard]] inline bool is_finite(const Pose& pose) { return pose.matrix().allFinite(); }

}  // namespace langgs
