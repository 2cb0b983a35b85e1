// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "langgs/render/tile_forward.hpp"
#include "langgs/render/tiles.hpp"
#include "langgs/render/weight_gradient.hpp"

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
/// Floats from the sums of one instance to those of the next: a cache line, so that each is written as a whole.
inline constexpr int kSplatSumStride = 16;

/// Backward pass of the blending, front to back: the transmittance is recomputed by multiplication and the colour
/// behind a splat is the final value minus what has been blended so far. Each instance row has one writer, so no
/// atomics. WeightGradient is NoWeightGradient, or adds a loss on the blending weights.
template <class WeightGradient>
struct TileBackwardWith {
  static constexpr int kThreads = TileGrid::kThreads;
  static constexpr int kBatch = 64;

  template <class Block>
  using WeightReader = typename WeightGradient::template Reader<Block, kBatch>;
  template <class Block>
  struct Shared {
    TileBatch<Block, kBatch> batch;
    typename Block::template ItemTotals<kNumSplatSums, kBatch> sums;
    typename WeightReader<Block>::Shared weights;
  };

  TileGrid grid;
  InstanceView instances;
  RenderPlanes rendered;
  RenderGradient gradient;
  float* slot_sums = nullptr;  ///< [num_instances, kSplatSumStride] by slot, aligned to 64 bytes
  WeightGradient weight_gradient = {};

  template <class Block>
  LANGGS_HD void operator()(Block& block, Shared<Block>& shared) const {
    using F = VaryingOf<float, Block>;
    const int begin = instances.tile_begin[block.index()], end = instances.tile_begin[block.index() + 1];
    if (begin == end) return;
    // `behind` is the part of dL/dC . C + dL/dD D (+ sum of w dL/dw) that is not blended yet.
    typename Block::template PerThread<float> rows, transmittance, behind, up_red, up_green, up_blue, up_depth;
    typename Block::template PerWarp<bool> is_live;
    WeightReader<Block> weights(weight_gradient, instances);
    const F columns = pixel_columns(grid, block);
    block.warps([&](const auto& warp) {
      const WarpPixels<Block> pixels(grid, block.index(), warp);
      const std::ptrdiff_t plane = static_cast<std::ptrdiff_t>(grid.width) * grid.height;
      F sum(0.f);
      const auto take = [&](auto& row, const float* upstream, const float* value) {
        const F up = pixels.load(warp, upstream, 0.f);
        row.store(warp, up);
        sum += up * pixels.load(warp, value, 0.f);
      };
      take(up_red, gradient.colour, rendered.colour);
      take(up_green, gradient.colour + plane, rendered.colour + plane);
      take(up_blue, gradient.colour + 2 * plane, rendered.colour + 2 * plane);
      take(up_depth, gradient.depth, rendered.depth);
      weights.load(warp, pixels, plane, sum);
      behind.store(warp, sum);
      rows.store(warp, pixel_rows(grid, block, warp));
      transmittance.store(warp, pixels.initial_transmittance(warp));
    });

    int first = begin;
    for (bool goes_on = true; goes_on && first < end; first += kBatch) {
      const int n = shared.batch.load(block, instances, first, end);
      weights.begin_batch(block, shared.weights, first, n);
      block.warps([&](const auto& warp) { is_live.store(warp, warp.any(transmittance.load(warp) > 0.f)); });
      block.sync();
      block.for_each_item(
          n, [&](int j) { return shared.batch.warps(j); },
          [&](const auto& item) LANGGS_INLINE_LAMBDA {
            const Splat& s = shared.batch.splat(item.index());
            const auto gaussian = weights.gaussian(shared.weights, item.index());
            const SplatColumn<F> column(s, columns);
            F p_sum(0.f), py_sum(0.f), pyy_sum(0.f), red(0.f), green(0.f), blue(0.f), depth(0.f);
            item.warps([&](const auto& warp) LANGGS_INLINE_LAMBDA {
              if (!is_live.load(warp)) return;
              const F T = transmittance.load(warp);
              const Footprint<F> at(s, column, rows.load(warp));
              const BlendStep<F> step(at, T);
              transmittance.store(warp, step.next_transmittance);
              const F r = up_red.load(warp), g = up_green.load(warp), b = up_blue.load(warp), d = up_depth.load(warp);
              F value = r * s.red + g * s.green + b * s.blue + d * s.depth;
              weights.add(warp, gaussian, value);
              const F rest = behind.load(warp) - step.weight * value;
              behind.store(warp, rest);
              // p = alpha dL/dalpha, with dL/dalpha = T value - rest / (1 - alpha).
              const F p = select((step.weight > 0.f) & !at.is_clamped(),
                                 step.weight * value - at.alpha * rest / (1.f - at.alpha), F(0.f));
              const F py = p * at.dy;
              p_sum += p;
              py_sum += py;
              pyy_sum += py * at.dy;
              red += step.weight * r;
              green += step.weight * g;
              blue += step.weight * b;
              depth += step.weight * d;
            });
            const F px_sum = p_sum * column.dx;
            const F sums[kNumSplatSums] = {p_sum, px_sum, py_sum, px_sum * column.dx, py_sum * column.dx, pyy_sum, red,
                                           green, blue,   depth};
            shared.sums.put_sums(item, sums);
          });
      block.sync();
      block.threads(n, [&](auto thread) {
        shared.sums.write_sums(thread.index, shared.batch.warps(thread.index), sums_of(first + thread.index));
      });
      goes_on = !block.all([&](const auto& warp) { return transmittance.load(warp) < 0.f; });
    }
    // What lies behind the last splat that any pixel saw.
    for (; first < end; first += kThreads)
      block.threads(min(kThreads, end - first), [&](auto thread) {
        float* const out = sums_of(first + thread.index);
        for (int sum = 0; sum < kNumSplatSums; ++sum) out[sum] = 0.f;
      });
  }

 private:
  [[nodiscard]] LANGGS_INLINE float* sums_of(int instance) const {
    return slot_sums + static_cast<std::ptrdiff_t>(instances.sorted_slot[instance]) * kSplatSumStride;
  }
};

/// The gradients of losses on colour and depth.
using TileBackward = TileBackwardWith<NoWeightGradient>;

}  // namespace langgs
