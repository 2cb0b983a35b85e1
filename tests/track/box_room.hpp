// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <vector>

#include "langgs/core/rng.hpp"
#include "langgs/frame/rgbd_frame.hpp"
#include "langgs/track/grid_target.hpp"

/// @file An analytic scene for the tracking tests: the inside of a 1.8 x 1.4 x 4.4 m box, with a smaller box standing
/// in it.

namespace langgs::test {

inline Camera small_camera() { return {130, 130, 79.25f, 60.5f, 160, 120}; }

/// Distance along the ray origin + t direction to the surface of a box centred at `centre`; from inside the far wall,
/// from outside the near face, infinity if missed.
inline double box_hit(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, const Eigen::Vector3d& centre,
                      const Eigen::Vector3d& half) {
  double enter = -std::numeric_limits<double>::infinity(), leave = std::numeric_limits<double>::infinity();
  for (int axis = 0; axis < 3; ++axis) {
    const double o = origin[axis] - centre[axis];
    const double a = (-half[axis] - o) / direction[axis], b = (half[axis] - o) / direction[axis];
    enter = std::fmax(enter, std::fmin(a, b));
    leave = std::fmin(leave, std::fmax(a, b));
  }
  if (enter > leave || leave <= 0) return std::numeric_limits<double>::infinity();
  return enter > 0 ? enter : leave;
}

/// What the camera sees at a pose. Axial noise has standard deviation noise_z2 z^2 [m].
inline RgbdFrame render_box_room(const Camera& camera, const Pose& T_world_camera, double noise_z2 = 0,
                                 std::uint64_t seed = 1) {
  RgbdFrame frame;
  frame.depth = Image<float>(camera.width, camera.height);
  const CounterRng rng{seed};
  for (int v = 0; v < camera.height; ++v)
    for (int u = 0; u < camera.width; ++u) {
      const Eigen::Vector3d direction = T_world_camera.linear() * camera.back_project(u, v, 1);
      const Eigen::Vector3d origin = T_world_camera.translation();
      const double wall = box_hit(origin, direction, {0, 0, 0}, {0.9, 0.7, 2.2});
      const double box = box_hit(origin, direction, {0.3, 0.4, 1.5}, {0.25, 0.3, 0.25});
      const double z = std::fmin(wall, box);  // the direction has unit depth
      const double noise = noise_z2 > 0 ? noise_z2 * z * z * rng.normal(v * camera.width + u) : 0;
      frame.depth(u, v) = static_cast<float>(z + noise);
    }
  return frame;
}

/// Points sampled uniformly on the six walls and, every fourth, on the inner box.
inline std::vector<Eigen::Vector3f> sample_box_room(int n, std::uint64_t seed) {
  const CounterRng rng{seed};
  std::vector<Eigen::Vector3f> points;
  for (int i = 0; i < n; ++i) {
    const bool inner = i % 4 == 0;
    const Eigen::Vector3d centre = inner ? Eigen::Vector3d(0.3, 0.4, 1.5) : Eigen::Vector3d(0, 0, 0);
    const Eigen::Vector3d half = inner ? Eigen::Vector3d(0.25, 0.3, 0.25) : Eigen::Vector3d(0.9, 0.7, 2.2);
    Eigen::Vector3d p;
    for (int axis = 0; axis < 3; ++axis) p[axis] = half[axis] * (2 * rng.uniform(4 * i + axis) - 1);
    const int face = static_cast<int>(rng.below(4 * i + 3, 6));
    p[face / 2] = face % 2 ? half[face / 2] : -half[face / 2];
    points.emplace_back((p + centre).cast<float>());
  }
  return points;
}

/// Points as a target without shapes.
inline std::vector<TargetGaussian> isotropic_gaussians(const std::vector<Eigen::Vector3f>& means) {
  std::vector<TargetGaussian> gaussians;
  gaussians.reserve(means.size());
  for (const Eigen::Vector3f& mean : means)
    gaussians.push_back({mean, -1, {kIsotropicTarget, 0, 0, kIsotropicTarget, 0, kIsotropicTarget}});
  return gaussians;
}
inline GridTarget isotropic_target(const std::vector<Eigen::Vector3f>& means) {
  return GridTarget(isotropic_gaussians(means));
}

/// A random rigid motion: uniform direction and axis, magnitudes uniform up to the given ones.
inline Pose random_motion(std::uint64_t seed, double max_metres, double max_radians) {
  const CounterRng rng{seed, 77};
  const auto direction = [&](int k) {
    return Eigen::Vector3d(rng.normal(k), rng.normal(k + 1), rng.normal(k + 2)).normalized();
  };
  Pose pose = Pose::Identity();
  pose.linear() = so3_exp(direction(10) * max_radians * rng.uniform(1));
  pose.translation() = direction(20) * max_metres * rng.uniform(2);
  return pose;
}

inline double rotation_angle(const Pose& pose) { return so3_log(pose.linear()).norm(); }

}  // namespace langgs::test
