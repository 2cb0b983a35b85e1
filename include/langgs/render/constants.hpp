// SPDX-License-Identifier: Apache-2.0
#pragma once

/// @file The constants of the rasteriser, each with its reason. One place: forward, backward and oracle agree on them.

namespace langgs {

struct RasterConstants {
  static constexpr int kTileSize = 16;  ///< a tile is 16x16 pixels: 8 warps of two rows

  /// Contributions below one grey level of an 8-bit image are skipped.
  static constexpr float kMinAlpha = 1.f / 255.f;
  /// Keeps 1 - alpha away from 0, so that Gaussians behind an opaque one still get a gradient.
  static constexpr float kMaxAlpha = 0.99f;
  /// A pixel stops before its transmittance would fall below this: (1 - kMaxAlpha)^2.
  static constexpr float kMinTransmittance = 1e-4f;

  /// Variance added to the projected covariance [px^2]: no splat is thinner than about one pixel.
  static constexpr float kLowPass = 0.3f;
  /// Gaussians whose mean is nearer than this are not drawn [m].
  static constexpr float kNearPlane = 0.05f;
  /// Gaussians with a depth [m] or colour beyond this are not drawn, so that no sum over a ray can overflow.
  static constexpr float kLargestValue = 1e9f;
  /// The projection is linearised at most this share of the image size beyond the image's border.
  static constexpr float kFrustumMargin = 0.15f;

  /// Log-scales and logits are bounded to these when used, so that no parameter value can overflow.
  static constexpr float kMinLogScale = -15.f, kMaxLogScale = 5.f, kMaxLogit = 20.f;
};

}  // namespace langgs
