// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <utility>
#include <vector>

#include "langgs/core/pose.hpp"
#include "langgs/device/copy.hpp"
#include "langgs/optimize/pose_refinement.hpp"

namespace langgs {

/// The refinement of the keyframes' poses. What a visit says about a pose is only looked at when that pose is needed
/// again: by then a device has long computed it, and nobody has waited.
template <class Backend>
class KeyframePoses {
 public:
  /// The first keyframe's pose stays as it is.
  void add(const Pose& T_world_camera) {
    keyframes_.push_back({PoseRefinementState(T_world_camera.inverse(), /*is_fixed=*/keyframes_.empty()), {}, false});
  }
  /// Takes the gradient [6] of a visit of keyframe i, in the backend's memory, after `executor`'s work so far.
  void observe(const Executor<Backend>& executor, int i, const double* gradient) {
    keyframes_[i].gradient.start(executor, gradient, 6);
    keyframes_[i].is_observed = true;
  }
  /// Steps the pose of keyframe i along what was observed since the last call, if anything; waits for it.
  void refine(const PoseRefinement& refinement, int i, Pose& T_world_camera) {
    RefinedKeyframe& k = keyframes_[i];
    if (!std::exchange(k.is_observed, false)) return;
    T_world_camera = refinement.step(k.state, Eigen::Map<const Twist>(k.gradient.values())).inverse();
  }

 private:
  struct RefinedKeyframe {
    PoseRefinementState state;
    Readback<double, Backend> gradient;
    bool is_observed;
  };
  std::vector<RefinedKeyframe> keyframes_;
};

}  // namespace langgs
