// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "langgs/render/tiles.hpp"
#include "langgs/render/topk.hpp"

namespace langgs {

/// Images that the forward pass writes; planes of [H, W], row-major and dense.
struct RenderPlanes {
  float* colour = nullptr;         ///< [3, H, W]
  float* depth = nullptr;          ///< [H, W] metres, not divided by the accumulated alpha
  float* transmittance = nullptr;  ///< [H, W] what is left of the ray behind the last splat
};

/// Top-K records and per-instance statistics; recorded in the same pass where K > 0.
struct TopKPlanes {
  std::int32_t* id = nullptr;                 ///< [K, H, W] Gaussian index, -1 where empty
  float* weight = nullptr;                    ///< [K, H, W] raw blending weights, descending
  std::int32_t* instance_gaussian = nullptr;  ///< [num_instances] scratch, by sorted position
  std::int32_t* instance_count = nullptr;     ///< [num_instances] scratch, by sorted position, zeroed by the caller
  std::int32_t* slot_count = nullptr;         ///< [num_instances] by slot: pixels that selected this instance
  float* slot_max_weight = nullptr;           ///< [num_instances] by slot: largest weight, zeroed by the caller
};

/// Paper Eq. 1 (colour and depth by alpha blending) and Eq. 2 (the K largest weights), one block a tile.
/// K = 0 records nothing.
template <int K>
struct TileForward {
  static constexpr int kThreads = TileGrid::kThreads;
  static constexpr int kWarps = kThreads / 32;
  static constexpr int kBatch = 256;
  static constexpr int kStopTestPeriod = 8;  // hits between two looks at whether the whole warp has stopped

  template <class Block>
  struct Shared {
    typename Block::template SharedArray<Splat, kBatch> splat;
    typename Block::template SharedArray<float, (K > 0 ? kWarps * kBatch : 32)> max_weight;
  };

  TileGrid grid;
  InstanceView instances;
  RenderPlanes out;
  TopKPlanes top;

  template <class Block>
  LANGGS_HD void operator()(Block& block, Shared<Block>& shared) const {
    using F = VaryingOf<float, Block>;
    const int begin = instances.tile_begin[block.index()], end = instances.tile_begin[block.index() + 1];
    typename Block::template PerThread<float> transmittance, red, green, blue, depth;
    TopKState<Block> topk;

    block.warps([&](const auto& warp) {
      const WarpPixels<Block> pixels(grid, block.index(), warp);
      transmittance.store(warp, pixels.initial_transmittance());
      for (auto* row : {&red, &green, &blue, &depth}) row->store(warp, F(0.f));
      topk.clear(warp);
    });

    for (int first = begin; first < end; first += kBatch) {
      const int n = end - first < kBatch ? end - first : kBatch;
      block.threads([&](auto thread) {
        if (thread.index >= n) return;
        const int splat = instances.slot_splat[instances.sorted_slot[first + thread.index]];
        shared.splat.set(thread.index, instances.splats[splat]);
        if constexpr (K > 0) top.instance_gaussian[first + thread.index] = instances.splat_gaussian[splat];
      });
      block.sync();
      block.warps([&](const auto& warp) {
        F T = transmittance.load(warp);
        const WarpPixels<Block> pixels(grid, block.index(), warp);
        if constexpr (K > 0)
          for (int j = 0; j < n; j += 32) shared.max_weight.store(warp.index() * kBatch + j, F(0.f), warp);
        if (warp.all(T < 0.f)) return;
        F r = red.load(warp), g = green.load(warp), b = blue.load(warp), d = depth.load(warp);
        auto best = topk.load(warp);
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
              T = step.next_transmittance;
              r += step.weight * s.red;
              g += step.weight * s.green;
              b += step.weight * s.blue;
              d += step.weight * s.depth;
              if constexpr (K > 0) {
                best.insert(step.weight, first + j);
                shared.max_weight.set(warp.index() * kBatch + j, warp.max(step.weight));
              }
              return ++hits % kStopTestPeriod != 0 || !warp.all(T < 0.f);
            });
        transmittance.store(warp, T);
        red.store(warp, r);
        green.store(warp, g);
        blue.store(warp, b);
        depth.store(warp, d);
        topk.store(warp, best);
      });
      block.sync();
      if constexpr (K > 0) {
        block.threads([&](auto thread) {
          if (thread.index >= n) return;
          float most = 0;
          for (int w = 0; w < kWarps; ++w) most = max(most, shared.max_weight[w * kBatch + thread.index]);
          top.slot_max_weight[instances.sorted_slot[first + thread.index]] = most;
        });
        block.sync();
      }
      if (block.all([&](const auto& warp) { return transmittance.load(warp) < 0.f; })) break;
    }

    block.warps([&](const auto& warp) {
      const WarpPixels<Block> pixels(grid, block.index(), warp);
      const std::ptrdiff_t plane = static_cast<std::ptrdiff_t>(grid.width) * grid.height;
      pixels.store(warp, out.colour, red.load(warp));
      pixels.store(warp, out.colour + plane, green.load(warp));
      pixels.store(warp, out.colour + 2 * plane, blue.load(warp));
      pixels.store(warp, out.depth, depth.load(warp));
      pixels.store(warp, out.transmittance, abs(transmittance.load(warp)));
      if constexpr (K > 0) store_topk(block, warp, pixels, topk.load(warp));
    });
    if constexpr (K > 0) {
      block.sync();
      for (int first = begin; first < end; first += kThreads)
        block.threads([&](auto thread) {
          const int i = first + thread.index;
          if (i < end) top.slot_count[instances.sorted_slot[i]] = top.instance_count[i];
        });
    }
  }

 private:
  /// The Top-K rows of a block; ids are positions in the sorted instance list until they are stored.
  template <class Block>
  struct TopKState {
    typename Block::template PerThread<float> weight[K > 0 ? K : 1];
    typename Block::template PerThread<std::int32_t> id[K > 0 ? K : 1];
    using Row = TopK<(K > 0 ? K : 1), Block>;

    LANGGS_INLINE void clear(const typename Block::Warp& warp) {
      Row row;
      row.clear();
      store(warp, row);
    }
    LANGGS_INLINE Row load(const typename Block::Warp& warp) const {
      Row row;
      for (int k = 0; k < K; ++k) {
        row.weight[k] = weight[k].load(warp);
        row.id[k] = id[k].load(warp);
      }
      return row;
    }
    LANGGS_INLINE void store(const typename Block::Warp& warp, const Row& row) {
      for (int k = 0; k < K; ++k) {
        weight[k].store(warp, row.weight[k]);
        id[k].store(warp, row.id[k]);
      }
    }
  };

  template <class Block>
  LANGGS_INLINE void store_topk(const Block& block, const typename Block::Warp& warp, const WarpPixels<Block>& pixels,
                                const TopK<(K > 0 ? K : 1), Block>& best) const {
    const std::ptrdiff_t plane = static_cast<std::ptrdiff_t>(grid.width) * grid.height;
    for (int k = 0; k < K; ++k) {
      const auto filled = best.id[k] >= 0;
      pixels.store(warp, top.id + k * plane, warp.gather(top.instance_gaussian, best.id[k], filled, -1));
      pixels.store(warp, top.weight + k * plane, best.weight[k]);
      block.count(top.instance_count, best.id[k], filled);
    }
  }
};

}  // namespace langgs
