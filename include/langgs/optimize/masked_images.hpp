// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "langgs/core/config.hpp"
#include "langgs/core/error.hpp"
#include "langgs/device/buffer.hpp"
#include "langgs/device/copy.hpp"
#include "langgs/device/launch.hpp"

namespace langgs {

/// What an image loss compares: planar float images of shape [planes, height, width].
/// Every array is read up to 32 elements past its end, which a Buffer allows.
struct MaskedImages {
  const float* rendered = nullptr;
  const float* target = nullptr;
  const float* depth = nullptr;  ///< [height, width] metres: pixels without valid depth are left out; null: none are
  int width = 0, height = 0, planes = 1;

  [[nodiscard]] LANGGS_HD int num_pixels() const { return width * height; }
};

/// Throws InvalidArgument unless there is something to compare.
inline void validate(const MaskedImages& images) {
  LANGGS_EXPECTS(images.width > 0 && images.height > 0 && images.width <= 16384 && images.height <= 16384,
                 "loss images are ", images.width, "x", images.height, "; each side must be in [1, 16384]");
  LANGGS_EXPECTS(images.planes >= 1 && images.planes <= 4, "loss images have ", images.planes,
                 " planes; colour has 3, depth 1");
  LANGGS_EXPECTS(images.rendered && images.target, "a loss image is null; pass both the rendered and the target image");
}

namespace detail {

/// Farther readings are sensor errors [m]; also excludes infinity.
inline constexpr float kMaxTargetDepth = 1e4f;

/// Mask of pixels whose target depth was measured; 0, negative, NaN and infinite are not.
template <class V>
[[nodiscard]] LANGGS_INLINE auto is_measured(const V& depth) {
  return (depth > 0.f) & (depth < kMaxTargetDepth);
}

/// scale * sign(difference), 0 where there is no difference: what |rendered - target| pulls at a pixel.
template <class V>
[[nodiscard]] LANGGS_INLINE V l1_gradient(const V& difference, float scale) {
  return select(difference > 0.f, V(scale), select(difference < 0.f, V(-scale), V(0.f)));
}

/// Sums a value over a block: every warp sets its part, then one thread adds the parts in their order.
template <class Block>
struct BlockSum {
  typename Block::template SharedArray<float, Block::kWarps> parts;

  LANGGS_INLINE void write(Block& block, float* to) const {
    block.sync();
    block.threads([&](auto thread) {
      if (thread.index != 0) return;
      float sum = 0;
      for (int w = 0; w < Block::kWarps; ++w) sum += parts[w];
      *to = sum;
    });
  }
};

}  // namespace detail
}  // namespace langgs
