// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "langgs/render/tiles.hpp"
#include "langgs/render/topk_recorder.hpp"

namespace langgs {

/// Images that the forward pass writes; planes of [H, W], row-major and dense.
struct RenderPlanes {
  float* colour = nullptr;         ///< [3, H, W]
  float* depth = nullptr;          ///< [H, W] metres, not divided by the accumulated alpha
  float* transmittance = nullptr;  ///< [H, W] what is left of the ray behind the last splat
};

/// Paper Eq. 1 (colour and depth by alpha blending) and Eq. 2 (the K largest weights), one block a tile.
/// K = 0 records nothing.
template <int K>
struct TileForward {
  static constexpr int kThreads = TileGrid::kThreads;
  static constexpr int kBatch = 64;

  template <class Block>
  struct Shared {
    TileBatch<Block, kBatch> batch;
    typename TopKRecorder<K, kBatch, Block>::Shared recorder;
  };

  TileGrid grid;
  InstanceView instances;
  RenderPlanes out;
  TopKPlanes top;

  template <class Block>
  LANGGS_HD void operator()(Block& block, Shared<Block>& shared) const {
    using F = VaryingOf<float, Block>;
    const int begin = instances.tile_begin[block.index()], end = instances.tile_begin[block.index() + 1];
    typename Block::template PerThread<float> rows, transmittance, red, green, blue, depth;
    typename Block::template PerWarp<bool> is_live;
    TopKRecorder<K, kBatch, Block> recorder(top, instances, block);

    const F columns = pixel_columns(grid, block);
    block.warps([&](const auto& warp) {
      const WarpPixels<Block> pixels(grid, block.index(), warp);
      rows.store(warp, pixel_rows(grid, block, warp));
      transmittance.store(warp, pixels.initial_transmittance(warp));
      for (auto* row : {&red, &green, &blue, &depth}) row->store(warp, F(0.f));
      recorder.clear(warp);
    });

    int first = begin;
    for (bool goes_on = true; goes_on && first < end; first += kBatch) {
      const int n = shared.batch.load(block, instances, first, end);
      recorder.begin_batch(block, first, n);
      block.warps([&](const auto& warp) { is_live.store(warp, warp.any(transmittance.load(warp) > 0.f)); });
      block.sync();
      block.for_each_item(
          n, [&](int j) { return shared.batch.warps(j); },
          [&](const auto& item) LANGGS_INLINE_LAMBDA {
            const Splat& s = shared.batch.splat(item.index());
            const SplatColumn<F> column(s, columns);
            F largest(0.f);
            item.warps([&](const auto& warp) LANGGS_INLINE_LAMBDA {
              if (!is_live.load(warp)) return;
              const Footprint<F> at(s, column, rows.load(warp));
              const BlendStep<F> step(at, transmittance.load(warp));
              transmittance.store(warp, step.next_transmittance);
              red.store(warp, red.load(warp) + step.weight * s.red);
              green.store(warp, green.load(warp) + step.weight * s.green);
              blue.store(warp, blue.load(warp) + step.weight * s.blue);
              depth.store(warp, depth.load(warp) + step.weight * s.depth);
              recorder.offer(warp, step.weight, first + item.index());
              largest = max(largest, step.weight);
            });
            recorder.put_largest(shared.recorder, item, largest);
          });
      recorder.end_batch(block, shared.recorder, first, n, [&](int j) { return shared.batch.warps(j); });
      goes_on = !block.all([&](const auto& warp) { return transmittance.load(warp) < 0.f; });
    }

    block.warps([&](const auto& warp) {
      const WarpPixels<Block> pixels(grid, block.index(), warp);
      const std::ptrdiff_t plane = static_cast<std::ptrdiff_t>(grid.width) * grid.height;
      pixels.store(warp, out.colour, red.load(warp));
      pixels.store(warp, out.colour + plane, green.load(warp));
      pixels.store(warp, out.colour + 2 * plane, blue.load(warp));
      pixels.store(warp, out.depth, depth.load(warp));
      pixels.store(warp, out.transmittance, abs(transmittance.load(warp)));
    });
    recorder.store(block, grid, first);
  }
};

}  // namespace langgs
