// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "langgs/core/image.hpp"
#include "langgs/core/pose.hpp"
#include "langgs/track/gicp_tracker.hpp"
#include "langgs/track/keyframe_policy.hpp"

namespace langgs {

/// What the caller knows about a frame that the frame itself does not say.
struct FrameRole {
  bool is_last = false;   ///< the last frame of a sequence becomes a keyframe
  bool held_out = false;  ///< tracked, but never mapped: it can score novel views
};

/// What became of a frame.
struct FrameReport {
  int frame_index = 0;
  Pose T_world_camera = Pose::Identity();
  GicpStatus status = GicpStatus::converged;
  double overlap = 0;    ///< share of the frame's points that the map covers
  double agreement = 1;  ///< share of the map's surfaces in view that the frame's depth confirms (DepthAgreement)
  KeyframeKind keyframe = KeyframeKind::none;
  bool skipped = false;  ///< not usable; its pose is the predicted one
  std::string reason;    ///< why it was skipped or lost
  int num_gaussians = 0;
  double loss = 0;  ///< geometric loss of the last mapping iteration
};

/// Counts and times of a run so far. Times are wall-clock milliseconds and the only thing that is not reproducible;
/// on a device those of mapping are what the host takes to hand over the work, and to wait where it does.
struct SlamStatistics {
  int frames = 0, keyframes = 0, gaussians = 0;
  int geometry_iterations = 0, feature_iterations = 0;
  int lost_frames = 0;      ///< tracking found no pose; the predicted one stands
  int relocalizations = 0;  ///< times a lost or doubtful camera was found again
  int skipped_frames = 0;   ///< frames without usable data
  int inserted = 0, suppressed = 0, pruned = 0;
  std::vector<float> track_ms, geometry_ms, feature_ms;
};

/// A rendered view on the host.
struct RenderedImages {
  Image<float> colour;         ///< [H, W, 3], RGB
  Image<float> depth;          ///< [H, W] metres, as blended
  Image<float> transmittance;  ///< [H, W]
};

}  // namespace langgs
