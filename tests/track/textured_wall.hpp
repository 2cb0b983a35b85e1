// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "langgs/track/measured_surface.hpp"
#include "track/box_room.hpp"

/// @file Scenes with colour: grey values that are a smooth function of the place in the world.

namespace langgs::test {

/// A grey value in [26, 194] with waves of 20 to 30 cm. Weaker ones leave a wall open: along it the curvature of the
/// cost is the squared gradient, 10 / m^2 here, against 500 / m^2 of the precision across.
inline double texture(const Eigen::Vector3d& p) {
  const double waves =
      std::sin(22 * p.x() + 7 * p.y() + 11 * p.z()) + std::sin(9 * p.x() - 24 * p.y() + 5 * p.z() + 1) +
      std::sin(-15 * p.x() + 13 * p.y() + 19 * p.z() + 2) + std::sin(27 * p.x() + 14 * p.y() - 6 * p.z());
  return 110 + 21 * waves;
}

/// Colours a frame by what its depth shows: texture(p) plus `brightening`.
inline void paint(RgbdFrame& frame, const Camera& camera, const Pose& T_world_camera, double brightening = 0) {
  frame.colour = Image<std::uint8_t>(camera.width, camera.height, 3);
  for (int v = 0; v < camera.height; ++v)
    for (int u = 0; u < camera.width; ++u) {
      const Eigen::Vector3d p = T_world_camera * camera.back_project(u, v, frame.depth(u, v));
      const double grey = std::clamp(texture(p) + brightening, 0.0, 255.0);
      for (int c = 0; c < 3; ++c) frame.colour(u, v, c) = static_cast<std::uint8_t>(std::lround(grey));
    }
}

inline SourceCloud textured_room_cloud(const Pose& T_world_camera, WorkerPool& pool) {
  RgbdFrame frame = render_box_room(small_camera(), T_world_camera);
  paint(frame, small_camera(), T_world_camera);
  return make_source_cloud(frame, small_camera(), {.stride = 3}, pool);
}

/// A wall at z = 2 m, infinite, as seen from a pose.
inline RgbdFrame render_wall(const Camera& camera, const Pose& T_world_camera) {
  RgbdFrame frame;
  frame.depth = Image<float>(camera.width, camera.height);
  for (int v = 0; v < camera.height; ++v)
    for (int u = 0; u < camera.width; ++u) {
      const Eigen::Vector3d direction = T_world_camera.linear() * camera.back_project(u, v, 1);
      frame.depth(u, v) = static_cast<float>((2 - T_world_camera.translation().z()) / direction.z());
    }
  return frame;
}

/// All points of a cloud as a keyframe at `T_world_camera` adds them to an empty map.
inline GridTarget target_of(const SourceCloud& cloud, const Camera& camera, const Pose& T_world_camera) {
  std::vector<std::int32_t> all;
  for (int i = 0; i < cloud.size(); ++i) all.push_back(i);
  return GridTarget(measured(cloud, all, camera, T_world_camera, TargetShape::anisotropic));
}

}  // namespace langgs::test
