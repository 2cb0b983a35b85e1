// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <concepts>
#include <numbers>

#include "langgs/core/error.hpp"
#include "langgs/core/pose.hpp"

/// @file Rendering-loss refinement of keyframe poses (paper section 4.1, after MonoGS; A.16).

namespace langgs {

/// Optimiser state of one keyframe's pose.
struct PoseRefinementState {
  explicit PoseRefinementState(const Pose& tracked = Pose::Identity(), bool is_fixed = false)
      : T_camera_world(tracked), T_camera_world_tracked(tracked), fixed(is_fixed) {}

  Pose T_camera_world;          ///< the refined pose
  Pose T_camera_world_tracked;  ///< the tracker's; the refined one stays near it
  bool fixed;                   ///< true for the first keyframe: it anchors the world
  Twist first_moment = Twist::Zero();
  Twist second_moment = Twist::Zero();
  int visits = 0;    ///< gradients offered
  int steps = 0;     ///< gradients used
  int rejected = 0;  ///< gradients that were not finite
};

/// Adam on the left perturbation T_camera_world <- Exp([rho; theta]) T_camera_world.
/// Adam's steps are about as long as the learning rate; G-ICP is right to millimetres, hence the small ones.
struct PoseRefinement {
  double lr_translation = 5e-5;  ///< [m]
  double lr_rotation = 1.5e-4;   ///< [rad]
  double beta1 = 0.9, beta2 = 0.999, epsilon = 1e-8;
  int start_after_visits = 5;     ///< the map of a new keyframe must settle before its pose may follow it
  double max_translation = 0.02;  ///< total drift from the tracked pose [m]
  double max_rotation = std::numbers::pi / 180;  ///< total drift from the tracked pose [rad]

  /// One step along `gradient` = dL/d[rho; theta]; returns the pose to use from now on, T_camera_world. A gradient that
  /// is not finite is counted and ignored.
  Pose step(PoseRefinementState& state, const Twist& gradient) const {
    check();
    if (state.fixed || ++state.visits <= start_after_visits) return state.T_camera_world;
    if (!gradient.allFinite()) {
      ++state.rejected;
      return state.T_camera_world;
    }
    ++state.steps;
    state.first_moment = beta1 * state.first_moment + (1 - beta1) * gradient;
    state.second_moment = beta2 * state.second_moment + (1 - beta2) * gradient.cwiseProduct(gradient);
    const Twist mean = state.first_moment / (1 - std::pow(beta1, state.steps));
    const Twist variance = state.second_moment / (1 - std::pow(beta2, state.steps));
    Twist rate;
    rate << Eigen::Vector3d::Constant(lr_translation), Eigen::Vector3d::Constant(lr_rotation);
    const Twist tau = -rate.cwiseProduct(mean.cwiseQuotient((variance.cwiseSqrt().array() + epsilon).matrix()));
    if (tau.allFinite())  // squares of huge gradients overflow
      state.T_camera_world = clamped(renormalized(se3_exp(tau) * state.T_camera_world), state.T_camera_world_tracked);
    return state.T_camera_world;
  }

  void check() const {
    LANGGS_EXPECTS(lr_translation >= 0 && lr_rotation >= 0, "pose learning rates are ", lr_translation, " and ",
                   lr_rotation, "; they must not be negative");
    LANGGS_EXPECTS(beta1 >= 0 && beta1 < 1 && beta2 >= 0 && beta2 < 1 && epsilon > 0, "Adam settings are ", beta1, ", ",
                   beta2, ", ", epsilon, "; betas must be in [0, 1), epsilon positive");
    LANGGS_EXPECTS(max_translation >= 0 && max_rotation >= 0, "drift limits are ", max_translation, " m and ",
                   max_rotation, " rad; they must not be negative");
  }

 private:
  [[nodiscard]] Pose clamped(const Pose& refined, const Pose& tracked) const {
    Pose drift = refined * tracked.inverse();  // moves the camera's centre by |translation|
    const double distance = drift.translation().norm();
    const Eigen::Vector3d turn = so3_log(drift.linear());
    const double angle = turn.norm();
    if (distance <= max_translation && angle <= max_rotation) return refined;
    if (distance > max_translation) drift.translation() *= max_translation / distance;
    if (angle > max_rotation) drift.linear() = so3_exp(turn * (max_rotation / angle));
    return renormalized(drift * tracked);
  }
};

/// Leaves every pose as it was tracked.
struct NoPoseRefinement {
  Pose step(PoseRefinementState& state, const Twist&) const { return state.T_camera_world; }
};

template <class P>
concept PoseRefiner = requires(const P refiner, PoseRefinementState& state, const Twist& gradient) {
  { refiner.step(state, gradient) } -> std::same_as<Pose>;
};

/// Instantiate where a refiner enters, for an error that says the remedy.
template <class P>
constexpr bool require_pose_refiner() {
  static_assert(PoseRefiner<P>,
                "a pose refiner needs `Pose step(PoseRefinementState&, const Twist&) const`; see PoseRefinement");
  return true;
}

}  // namespace langgs
