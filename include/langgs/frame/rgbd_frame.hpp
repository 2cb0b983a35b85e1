// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <concepts>
#include <cstdint>
#include <optional>

#include "langgs/core/camera.hpp"
#include "langgs/core/image.hpp"
#include "langgs/core/pose.hpp"

namespace langgs {

/// One RGB-D frame: colour and depth registered to each other, one camera.
struct RgbdFrame {
  double timestamp = 0;          ///< of the colour image [s]
  double depth_time_offset = 0;  ///< when the depth image was taken, relative to the colour image [s]
  Image<std::uint8_t> colour;    ///< [H, W, 3], RGB
  Image<float> depth;            ///< [H, W], metres along the optical axis; 0 where nothing was measured
  /// Pose to map with when poses are given instead of tracked; a tracked run never reads it.
  std::optional<Pose> T_world_camera;
};

/// Where frames come from: a camera, a data set, a simulator. Poses are optional everywhere.
template <class S>
concept FrameSource = requires(S source, RgbdFrame frame) {
  { source.camera() } -> std::convertible_to<Camera>;  ///< intrinsics of every frame
  { source.next(frame) } -> std::same_as<bool>;        ///< fills `frame`, or returns false at the end
};

}  // namespace langgs
