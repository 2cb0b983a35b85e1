// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "langgs/core/image.hpp"
#include "langgs/core/rng.hpp"
#include "langgs/frame/synthetic/raycaster.hpp"

/// @file What a real RGB-D camera does to an ideal image. Every value depends on (seed, frame, pixel) alone.

namespace langgs::detail {

/// Axial noise of a structured-light camera [m] at depth z (Nguyen, Izadi & Lovell 2012).
[[nodiscard]] inline double axial_sigma(double z) { return 0.0012 + 0.0019 * (z - 0.4) * (z - 0.4); }

/// Disparity steps per inverse metre: 75 mm baseline, 580 px focal length, eighths of a pixel (Khoshelham & Elberink
/// 2012).
inline constexpr double kDisparitySteps = 8 * 580 * 0.075;

/// Adds noise growing with z^2, quantises disparity, and removes most measurements at depth edges and grazing angles.
inline void degrade_depth(CastView& view, const CounterRng& rng) {
  constexpr float kEdge = 0.04f;     // relative jump to a neighbour that makes a pixel an edge
  constexpr float kGrazing = 0.17f;  // cosine: ten degrees
  const Image<float> exact = view.depth;
  const int width = exact.width(), height = exact.height();
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const std::uint64_t pixel = static_cast<std::uint64_t>(y) * width + x;
      const float z = exact(x, y);
      const auto jumps = [&](int i, int j) {
        return i >= 0 && j >= 0 && i < width && j < height &&
               std::abs(exact(i, j) - z) > kEdge * std::min(z, exact(i, j));
      };
      const bool edge = jumps(x - 1, y) || jumps(x + 1, y) || jumps(x, y - 1) || jumps(x, y + 1);
      const bool grazing = view.facing(x, y) < kGrazing;
      const bool lost = (edge || grazing) && rng.uniform(4 * pixel + 2) < 0.8;
      const double noisy = z + axial_sigma(z) * rng.normal(2 * pixel);
      const double step = std::round(kDisparitySteps / std::max(noisy, 0.1));
      view.depth(x, y) = lost || step < 1 ? 0.f : static_cast<float>(kDisparitySteps / step);
    }
  }
}

/// Adds normal noise of `sigma` 8-bit levels to every channel.
inline void degrade_colour(Image<std::uint8_t>& colour, double sigma, const CounterRng& rng) {
  for (std::size_t i = 0; i < colour.size(); ++i) {
    const double value = colour.data()[i] + sigma * rng.normal(i);
    colour.data()[i] = static_cast<std::uint8_t>(std::clamp(std::floor(value + 0.5), 0.0, 255.0));
  }
}

}  // namespace langgs::detail
