// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <concepts>

#include "langgs/core/error.hpp"

namespace langgs {

/// What becomes of a tracked frame (A.7.1, A.7.2).
enum class KeyframeKind {
  none,
  mapping,   ///< trains the map; the registration target stays
  tracking,  ///< trains the map, adds trackable Gaussians, and renews the registration target
};

/// A user's own policy: called once for every frame in order, with the overlap of GicpResult.
template <class P>
concept KeyframeSelector = requires(P policy, double overlap, bool flag) {
  { policy.decide(overlap, /*is_first=*/flag, /*is_last=*/flag) } -> std::same_as<KeyframeKind>;
};

struct KeyframeSettings {
  double overlap_threshold = 0.8;  ///< tracking keyframe when less of the frame is covered by the map
  int mapping_interval = 10;       ///< mapping keyframe every so many frames after a tracking keyframe; 0: none
};

/// The paper's policy: a tracking keyframe where the map covers too little of the frame, and at the ends of the
/// sequence; mapping keyframes at regular intervals between.
class KeyframePolicy {
 public:
  explicit KeyframePolicy(KeyframeSettings settings = {}) : settings_(settings) {
    LANGGS_EXPECTS(settings_.overlap_threshold >= 0 && settings_.overlap_threshold <= 1, "overlap_threshold is ",
                   settings_.overlap_threshold, "; it is a fraction and must be in [0, 1]");
    LANGGS_EXPECTS(settings_.mapping_interval >= 0, "mapping_interval is ", settings_.mapping_interval,
                   " frames; it must not be negative");
  }

  [[nodiscard]] KeyframeKind decide(double overlap, bool is_first, bool is_last) {
    ++frames_since_tracking_;
    // Written so that an overlap of NaN asks for a keyframe.
    if (is_first || is_last || !(overlap >= settings_.overlap_threshold)) {
      frames_since_tracking_ = 0;
      return KeyframeKind::tracking;
    }
    if (settings_.mapping_interval > 0 && frames_since_tracking_ % settings_.mapping_interval == 0)
      return KeyframeKind::mapping;
    return KeyframeKind::none;
  }

 private:
  KeyframeSettings settings_;
  int frames_since_tracking_ = 0;
};

static_assert(KeyframeSelector<KeyframePolicy>);

}  // namespace langgs
