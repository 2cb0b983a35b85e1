// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "langgs/core/config.hpp"
#include "langgs/device/block.hpp"
#include "langgs/device/math.hpp"
#include "langgs/render/constants.hpp"

/// @file What one splat does to one pixel (paper Eq. 1). Forward and backward share it, so they cannot disagree.

namespace langgs {

/// log(x) / log(256), so that an 8-bit image's range of opacities, 1/255 to 1, is about [-1, 0].
inline constexpr float kLog256 = 0.18033688f;  // 1 / ln 256

/// A projected Gaussian as the tile kernels read it: log256(alpha) = log_opacity - (half_xx dx^2 + xy dx dy +
/// half_yy dy^2) with (dx, dy) the mean minus the pixel.
struct alignas(16) Splat {
  float x, y;                     ///< mean [px]
  float half_xx, xy, half_yy;     ///< conic times kLog256
  float log_opacity;              ///< to the base 256
  float red, green, blue, depth;  ///< colour and camera-space z of the mean [m]
  float half_width, half_height;  ///< of the box outside of which the splat is invisible [px]
};

/// What the pixels of one column have in common with respect to a splat (per lane).
template <class V>
struct SplatColumn {
  V dx, level, slope;

  LANGGS_INLINE SplatColumn(const Splat& s, const V& column) {
    dx = s.x - column;
    level = s.log_opacity - s.half_xx * dx * dx;
    slope = s.xy * dx;
  }
};

/// A splat's footprint at a pixel (per lane).
template <class V>
struct Footprint {
  static constexpr float kMinLog = -0.99929418f;  // log256(RasterConstants::kMinAlpha)
  static constexpr float kMaxLog = -0.00181245f;  // log256(RasterConstants::kMaxAlpha)

  V dy;         ///< splat mean minus pixel [px]
  V log_alpha;  ///< to the base 256, not bounded
  V alpha;      ///< at most kMaxAlpha, meaningful where visible

  LANGGS_INLINE Footprint(const Splat& s, const SplatColumn<V>& column, const V& row) {
    dy = s.y - row;
    log_alpha = column.level - (s.half_yy * dy + column.slope) * dy;
    // The upper bound also takes the rounding of a conic that is positive definite only in exact arithmetic.
    alpha = exp256(min(log_alpha, kMaxLog));
  }
  [[nodiscard]] LANGGS_INLINE auto is_visible() const { return log_alpha >= kMinLog; }
  [[nodiscard]] LANGGS_INLINE auto is_clamped() const { return log_alpha >= kMaxLog; }
};

/// One step of front-to-back blending. A pixel that has stopped keeps its transmittance, negated.
template <class V>
struct BlendStep {
  V weight;  ///< w = alpha T, or 0 where the splat is skipped
  V next_transmittance;

  LANGGS_INLINE BlendStep(const Footprint<V>& at, const V& transmittance) {
    const V candidate = select(at.is_visible(), at.alpha, V(0.f)) * transmittance;
    const V remaining = transmittance - candidate;
    // Never where stopped; always where the splat is skipped, which leaves the transmittance as it is.
    const auto goes_on = remaining >= RasterConstants::kMinTransmittance;
    weight = select(goes_on, candidate, V(0.f));
    next_transmittance = select(goes_on, remaining, negative_abs(transmittance));
  }
};

}  // namespace langgs
