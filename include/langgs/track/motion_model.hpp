// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>

#include "langgs/core/pose.hpp"

namespace langgs {

/// Where the registration of a new frame starts.
enum class InitialGuess {
  last_pose,          ///< the previous frame's pose (A.6.6)
  constant_velocity,  ///< the previous motion goes on
};

/// Predicts poses from the last two. Begins at rest at identity. Times are in seconds.
class MotionModel {
 public:
  explicit MotionModel(InitialGuess guess = InitialGuess::constant_velocity) : guess_(guess) {}

  /// T_world_camera expected at `time`. Motion is not trusted to go on for long: over a gap in the frames it ends.
  [[nodiscard]] Pose predict(double time) const {
    if (guess_ == InitialGuess::last_pose) return T_world_last_;
    return renormalized(T_world_last_ * motion(std::clamp(time - time_, 0.0, kLongestInIntervals * interval_)));
  }

  /// Motion of the camera within `seconds`, which may be negative: the pose of the camera then, seen from now.
  [[nodiscard]] Pose motion(double seconds) const { return se3_exp(seconds * velocity_); }

  /// The pose was found at `time`.
  void observe(const Pose& T_world_camera, double time) {
    interval_ = std::max(0.0, time - time_);
    velocity_ = interval_ > 0 ? Twist(se3_log(T_world_last_.inverse() * T_world_camera) / interval_) : Twist::Zero();
    T_world_last_ = T_world_camera;
    time_ = time;
  }

  /// The pose is known but no motion led to it: the first frame, or one that was found again.
  void restart(const Pose& T_world_camera, double time) {
    T_world_last_ = T_world_camera;
    time_ = time;
    velocity_.setZero();
  }

  [[nodiscard]] const Pose& last() const { return T_world_last_; }
  [[nodiscard]] double time() const { return time_; }  ///< of the last pose [s]

 private:
  static constexpr double kLongestInIntervals = 3;

  InitialGuess guess_;
  Pose T_world_last_ = Pose::Identity();
  double time_ = 0, interval_ = 0;
  Twist velocity_ = Twist::Zero();  // in the camera frame, per second
};

}  // namespace langgs
