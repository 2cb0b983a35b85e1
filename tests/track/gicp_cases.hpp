// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "langgs/track/gicp_tracker.hpp"
#include "track/box_room.hpp"

/// @file Sources and targets of the G-ICP tests, and what holds for every result.

namespace langgs::test {

inline GridTarget room_target() { return isotropic_target(sample_box_room(40000, 9)); }

inline SourceCloud room_source(const Pose& T_world_camera, WorkerPool& pool, double noise_z2 = 0) {
  SourceCloudSettings settings;
  settings.stride = 3;
  return make_source_cloud(render_box_room(small_camera(), T_world_camera, noise_z2), small_camera(), settings, pool);
}

/// A cloud of hand-made points whose shape is a plane facing the camera.
inline SourceCloud cloud_of(const std::vector<Eigen::Vector3f>& points) {
  SourceCloud cloud;
  cloud.resize(static_cast<int>(points.size()));
  cloud.points = points;
  for (int i = 0; i < cloud.size(); ++i) {
    cloud.covariances[i] = Eigen::Vector3f(1, 1, 1e-3f).asDiagonal();
    cloud.weights[i] = 1;
    cloud.trackable[i] = 1;
  }
  return cloud;
}

inline void check_sane(const GicpResult& result, const SourceCloud& source, const Pose& initial,
                       const GicpSettings& settings) {
  CHECK(is_finite(result.T_world_camera));
  CHECK(std::abs(result.T_world_camera.linear().determinant() - 1) < 1e-6);
  CHECK(result.iterations <= settings.max_iterations);
  CHECK(result.overlap >= 0);
  CHECK(result.overlap <= 1);
  CHECK(std::isfinite(result.inlier_rms));
  CHECK(std::isfinite(result.conditioning));
  CHECK(result.information.allFinite());
  CHECK(result.squared_distance.size() == source.points.size());
  CHECK(std::none_of(result.squared_distance.begin(), result.squared_distance.end(),
                     [](float d) { return std::isnan(d); }));
  if (!has_pose(result.status)) CHECK(result.T_world_camera.matrix() == initial.matrix());
}

}  // namespace langgs::test
