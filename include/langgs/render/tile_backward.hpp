// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "langgs/render/tile_forward.hpp"
#include "langgs/render/tiles.hpp"

namespace langgs {

/// Upstream gradients of a loss with respect to the rendered planes.
struct RenderGradient {
  const float* colour = nullptr;  ///< dL/dC [3, H, W]
  const float* depth = nullptr;   ///< dL/dD [H, W]
};

/// What the pixels of a tile say about one splat: sums over pixels, from which its 2D gradients follow.
/// p = alpha dL/dalpha is the gradient with respect to the exponent (0 where alpha is clamped).
enum SplatSum : int {
  kSumP,
  kSumPX,
  kSumPY,
  kSumPXX,
  kSumPXY,
  kSumPYY,
  kSumRed,
  kSumGreen,
  kSumBlue,
  kSumDepth,
  kNumSplatSums
};

/// Backward pass of the blending, front to back: the transmittance is recomputed by multiplication and the colour
/// behind a splat is the final value minus what has been blended so far. Each instance row has one writer, so no
/// atomics.
struct TileBackward {
  static constexpr int kThreads = TileGrid::kThreads;
  static constexpr int kWarps = kThreads / 32;
  static constexpr int kBatch = 64;
  static constexpr int kStopTestPeriod = 8;

  template <class Block>
  struct Shared {
    typename Block::template SharedArray<Splat, kBatch> splat;
    typename Block::template SharedArray<float, kWarps * kNumSplatSums * kBatch> partial;  // [warp, sum, splat]
  };

  TileGrid grid;
  InstanceView instances;
  RenderPlanes rendered;
  RenderGradient gradient;
  float* slot_sums = nullptr;  ///< [num_instances, kNumSplatSums] by slot, zeroed by the caller

  template <class Block>
  LANGGS_HD void operator()(Block& block, Shared<Block>& shared) const {
    using F = VaryingOf<float, Block>;
    const int begin = instances.tile_begin[block.index()], end = instances.tile_begin[block.index() + 1];
    if (begin == end) return;
    // `behind` is the part of dL/dC . C + dL/dD D that is not blended yet.
    typename Block::template PerThread<float> transmittance, behind;
    block.warps([&](const auto& warp) {
      const WarpPixels<Block> pixels(grid, block.index(), warp);
      const Upstream<Block> up(*this, pixels, warp);
      const std::ptrdiff_t plane = plane_size();
      transmittance.store(warp, pixels.initial_transmittance());
      behind.store(warp, up.red * pixels.load(warp, rendered.colour, 0.f) +
                             up.green * pixels.load(warp, rendered.colour + plane, 0.f) +
                             up.blue * pixels.load(warp, rendered.colour + 2 * plane, 0.f) +
                             up.depth * pixels.load(warp, rendered.depth, 0.f));
    });

    for (int first = begin; first < end; first += kBatch) {
      const int n = end - first < kBatch ? end - first : kBatch;
      block.threads([&](auto thread) {
        if (thread.index < n)
          shared.splat.set(thread.index,
                           instances.splats[instances.slot_splat[instances.sorted_slot[first + thread.index]]]);
      });
      block.sync();
      block.warps([&](const auto& warp) {
        for (int i = 0; i < kNumSplatSums * kBatch; i += 32)
          shared.partial.store(warp.index() * kNumSplatSums * kBatch + i, F(0.f), warp);
        F T = transmittance.load(warp);
        if (warp.all(T < 0.f)) return;
        F rest = behind.load(warp);
        const WarpPixels<Block> pixels(grid, block.index(), warp);
        const Upstream<Block> up(*this, pixels, warp);
        int hits = 0;
        warp.for_each_selected(
            n,
            [&](int j) {
              const Splat& s = shared.splat[j];
              return pixels.touches(s.first_row, s.last_row);
            },
            [&](int j) {
              const Splat s = shared.splat[j];
              const Footprint<F> at(s, pixels.column, pixels.row);
              const BlendStep<F> step(at.alpha, T);
              const F value = up.red * s.red + up.green * s.green + up.blue * s.blue + up.depth * s.depth;
              rest -= step.weight * value;
              // p = alpha dL/dalpha, with dL/dalpha = T value - rest / (1 - alpha).
              const F p = select((step.weight > 0.f) & (at.alpha < RasterConstants::kMaxAlpha),
                                 step.weight * value - at.alpha * rest / (1.f - at.alpha), F(0.f));
              T = step.next_transmittance;
              const F px = p * at.dx, py = p * at.dy;
              const int row = warp.index() * kNumSplatSums * kBatch + j;
              const auto put = [&](SplatSum sum, const F& v) { shared.partial.set(row + sum * kBatch, warp.sum(v)); };
              put(kSumP, p);
              put(kSumPX, px);
              put(kSumPY, py);
              put(kSumPXX, px * at.dx);
              put(kSumPXY, px * at.dy);
              put(kSumPYY, py * at.dy);
              put(kSumRed, step.weight * up.red);
              put(kSumGreen, step.weight * up.green);
              put(kSumBlue, step.weight * up.blue);
              put(kSumDepth, step.weight * up.depth);
              return ++hits % kStopTestPeriod != 0 || !warp.all(T < 0.f);
            });
        transmittance.store(warp, T);
        behind.store(warp, rest);
      });
      block.sync();
      block.threads([&](auto thread) {
        if (thread.index >= n) return;
        float* out =
            slot_sums + static_cast<std::ptrdiff_t>(instances.sorted_slot[first + thread.index]) * kNumSplatSums;
        for (int sum = 0; sum < kNumSplatSums; ++sum) {
          float total = 0;
          for (int w = 0; w < kWarps; ++w) total += shared.partial[(w * kNumSplatSums + sum) * kBatch + thread.index];
          out[sum] = total;
        }
      });
      block.sync();
      if (block.all([&](const auto& warp) { return transmittance.load(warp) < 0.f; })) break;
    }
  }

 private:
  LANGGS_INLINE std::ptrdiff_t plane_size() const { return static_cast<std::ptrdiff_t>(grid.width) * grid.height; }

  /// Gradients of the loss at the warp's pixels.
  template <class Block>
  struct Upstream {
    VaryingOf<float, Block> red, green, blue, depth;
    LANGGS_INLINE Upstream(const TileBackward& k, const WarpPixels<Block>& pixels, const typename Block::Warp& warp)
        : red(pixels.load(warp, k.gradient.colour, 0.f)),
          green(pixels.load(warp, k.gradient.colour + k.plane_size(), 0.f)),
          blue(pixels.load(warp, k.gradient.colour + 2 * k.plane_size(), 0.f)),
          depth(pixels.load(warp, k.gradient.depth, 0.f)) {}
  };
};

}  // namespace langgs
