// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>

#include "langgs/core/pose.hpp"
#include "langgs/core/rng.hpp"

/// @file How the camera is carried through the synthetic room.

namespace langgs::detail {

/// A closed walk in figures of eight while looking to and fro. Its length grows with the number of frames, so that the
/// speed does not depend on it (about 2 cm and 1 degree per frame at motion 1): a long walk sees
/// most of the room, a short one a part of it. The hand's low-frequency sway makes each visit a little different.
class HandheldPath {
 public:
  HandheldPath(int num_frames, double motion, std::uint64_t seed) : num_frames_(num_frames), seed_(seed) {
    const double span = num_frames * motion;
    turns_ = std::max(1, static_cast<int>(std::lround(span / kFramesPerTurn)));
    loops_ = std::max(1, static_cast<int>(std::lround(span / kFramesPerLoop)));
    yaw_amplitude_ = kLargestYaw * std::min(1.0, span / (turns_ * kFramesPerTurn));
    loop_size_ = std::min(1.25, span / (loops_ * kFramesPerLoop));
    sway_rate_ = motion;
  }

  /// Camera pose of a frame in room coordinates (z up, origin in a corner of the floor).
  [[nodiscard]] Pose T_room_camera(double frame) const {
    const double phase = 2 * std::numbers::pi * frame / num_frames_;
    const double walk = loops_ * phase;
    const double t = frame * sway_rate_;
    const Eigen::Vector3d position{1.45 + loop_size_ * 0.5 * std::sin(walk) + sway(t, 0, 0.008),
                                   1.35 + loop_size_ * 0.3 * std::sin(2 * walk) + sway(t, 1, 0.008),
                                   1.45 + loop_size_ * 0.1 * std::sin(walk) + sway(t, 2, 0.008)};
    const double yaw = kFirstYaw + yaw_amplitude_ * std::sin(turns_ * phase) + sway(t, 3, 0.006);
    const double pitch = -0.27 - loop_size_ * 0.1 * std::sin(2 * walk + 0.6) + sway(t, 4, 0.006);
    const double roll = sway(t, 5, 0.012);
    // Columns: the camera's right, down and forward in the room.
    const Eigen::Vector3d forward{std::cos(yaw) * std::cos(pitch), std::sin(yaw) * std::cos(pitch), std::sin(pitch)};
    const Eigen::Vector3d right{std::sin(yaw), -std::cos(yaw), 0};
    Pose pose = Pose::Identity();
    pose.linear().col(0) = right;
    pose.linear().col(1) = forward.cross(right);
    pose.linear().col(2) = forward;
    pose.linear() *= so3_exp({0, 0, roll});
    pose.translation() = position;
    return pose;
  }

 private:
  static constexpr double kFramesPerLoop = 180;  // a figure of eight of 2.8 m
  static constexpr double kFramesPerTurn = 490;  // all the way to the left, to the right, and back
  static constexpr double kLargestYaw = 1.92;    // 110 degrees: never only the bare wall behind the start
  static constexpr double kFirstYaw = 0.72;      // towards the furnished corner

  /// Sum of two slow sines whose periods fit no other period of the path.
  [[nodiscard]] double sway(double t, int channel, double amplitude) const {
    const CounterRng rng{seed_, 100 + static_cast<std::uint64_t>(channel)};
    const auto wave = [&](int i, double period) {
      return std::sin(2 * std::numbers::pi *
                      (t / (period * (0.8 + 0.4 * rng.uniform(2 * i))) + rng.uniform(2 * i + 1)));
    };
    return amplitude * (0.7 * wave(0, 61) + 0.3 * wave(1, 29));
  }

  int num_frames_;
  std::uint64_t seed_;
  int turns_ = 1, loops_ = 1;
  double yaw_amplitude_ = 0, loop_size_ = 0, sway_rate_ = 1;
};

}  // namespace langgs::detail
