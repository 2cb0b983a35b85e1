// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "langgs/core/camera.hpp"
#include "langgs/core/error.hpp"
#include "langgs/core/pose.hpp"

namespace langgs {

/// A camera at a pose, in the form in which kernels take it. Trivially copyable.
struct View {
  Camera camera;
  float rotation[3][3];  ///< of T_camera_world
  float translation[3];  ///< of T_camera_world [m]

  View(const Camera& camera_, const Pose& T_world_camera) : camera(camera_) {
    validate(camera);
    LANGGS_EXPECTS(is_finite(T_world_camera), "the pose of a view has values that are not finite; check the tracker");
    const Pose T_camera_world = T_world_camera.inverse();
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) rotation[r][c] = static_cast<float>(T_camera_world.linear()(r, c));
      translation[r] = static_cast<float>(T_camera_world.translation()(r));
    }
  }
};

}  // namespace langgs
