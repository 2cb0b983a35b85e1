// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

#include "langgs/core/image.hpp"
#include "langgs/core/pose.hpp"
#include "langgs/frame/feature_map.hpp"

namespace langgs {

/// A frame that the map is optimised against.
template <int FeatDim>
struct Keyframe {
  int frame_index = 0;
  double timestamp = 0;          ///< seconds
  Pose T_world_camera;           ///< the current estimate; refined during mapping
  Pose T_world_camera_tracked;   ///< as the tracker gave it
  Image<std::uint8_t> colour;    ///< [H, W, 3], RGB
  Image<float> depth;            ///< [H, W], metres; 0 where nothing was measured
  FeatureMap<FeatDim> features;  ///< the teacher, at its own resolution; empty without features
  int visits = 0;                ///< mapping iterations that rendered it

  [[nodiscard]] bool has_images() const { return !colour.empty(); }
  [[nodiscard]] std::size_t bytes() const { return colour.size() + depth.size() * sizeof(float) + features.bytes(); }
};

}  // namespace langgs
