// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "langgs/core/pose.hpp"

namespace langgs {

/// Where the registration of a new frame starts.
enum class InitialGuess {
  last_pose,          ///< the previous frame's pose (A.6.6)
  constant_velocity,  ///< the previous motion once more
};

/// Predicts the next pose from the last two. Begins at identity.
struct MotionModel {
  InitialGuess guess = InitialGuess::constant_velocity;
  Pose T_world_last = Pose::Identity();
  Pose T_last_next = Pose::Identity();  ///< the motion expected next

  [[nodiscard]] Pose predict() const {
    return guess == InitialGuess::last_pose ? T_world_last : renormalized(T_world_last * T_last_next);
  }

  /// A frame was tracked.
  void observe(const Pose& T_world_camera) {
    T_last_next = T_world_last.inverse() * T_world_camera;
    T_world_last = T_world_camera;
  }

  /// The pose is known but no motion led to it: the first frame, or one that could not be tracked.
  void restart(const Pose& T_world_camera) {
    T_world_last = T_world_camera;
    T_last_next = Pose::Identity();
  }
};

}  // namespace langgs
