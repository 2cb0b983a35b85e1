// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

#include "langgs/core/config.hpp"
#include "langgs/device/math.hpp"
#include "langgs/render/topk_rasterizer.hpp"

/// @file The element-wise loops of mapping.

namespace langgs::detail {

/// A keyframe's images as planes of floats.
struct UnpackTarget {
  const std::uint8_t* colour;  ///< [H, W, 3]
  const float* depth;          ///< [H, W]
  float* out;                  ///< [4, H, W]
  std::ptrdiff_t plane;
  LANGGS_HD void operator()(int p) const {
    for (int c = 0; c < 3; ++c) out[c * plane + p] = static_cast<float>(colour[3 * p + c]) * (1.f / 255.f);
    out[3 * plane + p] = depth[p];
  }
};

/// Adds what one render says about a splat to what the map knows about its Gaussian.
struct CollectStatistics {
  const std::int32_t* gaussian;
  SplatStatistics seen;
  std::int32_t* topk_count;
  float* max_weight;
  std::int32_t* num_views;
  LANGGS_HD void operator()(int c) const {
    const int i = gaussian[c];
    topk_count[i] += seen.topk_count[c];
    max_weight[i] = max(max_weight[i], seen.max_weight[c]);
    ++num_views[i];
  }
};

}  // namespace langgs::detail
