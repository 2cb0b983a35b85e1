// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

#include "langgs/core/error.hpp"
#include "langgs/manage/insertion.hpp"
#include "langgs/optimize/geometric_loss.hpp"
#include "langgs/optimize/learning_rates.hpp"
#include "langgs/optimize/pose_refinement.hpp"
#include "langgs/slam/initialization.hpp"
#include "langgs/track/gicp_tracker.hpp"
#include "langgs/track/keyframe_policy.hpp"
#include "langgs/track/motion_model.hpp"
#include "langgs/track/source_cloud.hpp"
#include "langgs/track/target.hpp"

/// @file Every knob of the system in one aggregate, grouped by stage. Defaults are those of docs/design.md.

namespace langgs {

/// Where camera poses come from.
enum class PoseSource {
  gicp,   ///< tracked; the run begins at identity and reads no given pose
  given,  ///< the frame's own T_world_camera; mapping only
};

/// Which Gaussians of a ray make up its feature (paper section 3.2 and its ablation).
enum class FeatureRendering {
  topk,   ///< the K with the largest weights, renormalised
  blend,  ///< all of them, by alpha blending: the baseline
};

/// Tracking (paper section 3).
struct TrackingSettings {
  PoseSource poses = PoseSource::gicp;
  SourceCloudSettings source;
  GicpSettings gicp;
  InitialGuess initial_guess = InitialGuess::constant_velocity;
  TargetShape target_shape = TargetShape::anisotropic;
  float min_target_opacity = 0.05f;  ///< map Gaussians fainter than this are not tracked against
  /// A frame is lost whose depth confirms less than this share of the map's surfaces in view (see DepthAgreement)...
  double min_agreement = 0.85;
  double min_overlap = 0.1;  ///< ... or of which the map covers less than this share.
};

/// Mapping (paper sections 3.2 to 3.4).
struct MappingSettings {
  InitializationSettings initialization;
  RedundancyFilter::Settings redundancy;
  GeometricLossWeights loss;
  LearningRates learning_rates;
  PoseRefinement pose_refinement;
  bool refine_poses = true;
  FeatureRendering feature_rendering = FeatureRendering::topk;
  /// Most bytes that keyframes may hold, their images and feature maps together; see KeyframeStore for what goes first.
  std::size_t keyframe_bytes = std::size_t{4} << 30;
  /// The most bytes of them that a device keeps copies of, those used last; the others are uploaded again when visited.
  std::size_t device_keyframe_bytes = std::size_t{1} << 30;
};

struct SlamSettings {
  TrackingSettings tracking;
  MappingSettings mapping;
  int iterations_per_frame = 10;  ///< lockstep: mapping iterations after each frame
  int final_iterations = 0;       ///< lockstep: mapping iterations after the last frame; the paper has none
  int num_threads = 1;            ///< worker threads; results do not depend on it
  std::uint64_t seed = 0;         ///< of keyframe choice and pruning
};

inline void validate(const SlamSettings& s) {
  LANGGS_EXPECTS(s.iterations_per_frame >= 0 && s.iterations_per_frame <= 100000, "iterations_per_frame is ",
                 s.iterations_per_frame, "; it must be in [0, 100000]");
  LANGGS_EXPECTS(s.final_iterations >= 0, "final_iterations is ", s.final_iterations, "; it must not be negative");
  LANGGS_EXPECTS(s.num_threads >= 1 && s.num_threads <= 1024, "num_threads is ", s.num_threads,
                 "; it must be in [1, 1024]");
  LANGGS_EXPECTS(s.tracking.min_target_opacity >= 0 && s.tracking.min_target_opacity < 1, "min_target_opacity is ",
                 s.tracking.min_target_opacity, "; it must be in [0, 1)");
  LANGGS_EXPECTS(s.tracking.min_agreement >= 0 && s.tracking.min_agreement <= 1 && s.tracking.min_overlap >= 0 &&
                     s.tracking.min_overlap <= 1,
                 "min_agreement and min_overlap are ", s.tracking.min_agreement, " and ", s.tracking.min_overlap,
                 "; they are shares and must be in [0, 1]");
  validate(s.tracking.source);
  validate(s.tracking.gicp);
  validate(s.mapping.initialization);
  validate(s.mapping.learning_rates);
  s.mapping.pose_refinement.check();
}

}  // namespace langgs
