// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "langgs/core/config.hpp"
#include "langgs/device/block.hpp"
#include "langgs/device/math.hpp"
#include "langgs/render/constants.hpp"

/// @file What one splat does to one pixel (paper Eq. 1). Forward and backward share it, so they cannot disagree.

namespace langgs {

/// A projected Gaussian as the tile kernels read it.
struct Splat {
  float x, y;                  ///< mean [px]
  float half_xx, xy, half_yy;  ///< conic, as power = -(half_xx dx^2 + xy dx dy + half_yy dy^2)
  float opacity;
  float red, green, blue, depth;  ///< colour and camera-space z of the mean [m]
  short first_row, last_row;      ///< rows of the image that it can touch, inclusive
  short first_column, last_column;
};

/// A splat's footprint at a pixel (per lane).
template <class V>
struct Footprint {
  V dx, dy;   ///< splat mean minus pixel [px]
  V falloff;  ///< exp(power), in (0, 1]
  V alpha;    ///< min(kMaxAlpha, opacity * falloff)

  LANGGS_INLINE Footprint(const Splat& s, const V& column, const V& row) {
    dx = s.x - column;
    dy = s.y - row;
    // Positive definite up to rounding; the bound at 0 takes the rest.
    const V power = min(-(s.half_xx * dx * dx + (s.half_yy * dy + s.xy * dx) * dy), 0.f);
    falloff = exp(power);
    alpha = min(s.opacity * falloff, RasterConstants::kMaxAlpha);
  }
};

/// One step of front-to-back blending. A pixel that has stopped keeps its transmittance, negated.
template <class V>
struct BlendStep {
  V weight;  ///< w = alpha T, or 0 where the splat is skipped
  V next_transmittance;

  LANGGS_INLINE BlendStep(const V& alpha, const V& transmittance) {
    using C = RasterConstants;
    const V candidate = alpha * transmittance;
    const V remaining = transmittance - candidate;
    const auto visible = alpha >= C::kMinAlpha;
    const auto goes_on = remaining >= C::kMinTransmittance;
    weight = select(visible & goes_on, candidate, V(0.f));
    next_transmittance = select(visible, select(goes_on, remaining, -abs(transmittance)), transmittance);
  }
};

}  // namespace langgs
