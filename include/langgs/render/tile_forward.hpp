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

/// What a tile says about one of its splats.
struct InstanceStatistics {
  std::int32_t topk_count;  ///< pixels of the tile that have the splat among their K largest weights
  float max_weight;         ///< largest weight in the tile
};

/// Top-K records and per-instance statistics; recorded in the same pass where K > 0.
struct TopKPlanes {
  std::int32_t* id = nullptr;                 ///< [K, H, W] Gaussian index, -1 where empty
  float* weight = nullptr;                    ///< [K, H, W] raw blending weights, descending
  std::int32_t* instance_gaussian = nullptr;  ///< [num_instances + 1] scratch, by sorted position
  std::int32_t* instance_count = nullptr;     ///< [num_instances] scratch, by sorted position, zeroed by the caller
  float* instance_max_weight = nullptr;       ///< [num_instances] scratch, by sorted position, zeroed by the caller
  InstanceStatistics* slot = nullptr;         ///< [num_instances] by slot
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
    typename Block::template ItemTotals<1, (K > 0 ? kBatch : 1)> largest;  // weights
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
    typename Block::template PerWarp<bool> is_live, records;

    const F columns = pixel_columns(grid, block);
    const PixelRows<Block> rows(grid, block);
    block.warps([&](const auto& warp) {
      const WarpPixels<Block> pixels(grid, block.index(), warp);
      transmittance.store(warp, pixels.initial_transmittance(warp));
      for (auto* row : {&red, &green, &blue, &depth}) row->store(warp, F(0.f));
      topk.clear(warp);
    });

    for (int first = begin; first < end; first += kBatch) {
      const int n = shared.batch.load(block, instances, first, end);
      if constexpr (K > 0)
        block.threads(n, [&](auto thread) {
          top.instance_gaussian[first + thread.index] =
              instances.splat_gaussian[instances.sorted(first + thread.index).splat];
        });
      block.warps([&](const auto& warp) {
        const F T = transmittance.load(warp);
        is_live.store(warp, warp.any(T > 0.f));
        // No weight exceeds T: once T is below the smallest of the K, nothing can change any more.
        if constexpr (K > 0) records.store(warp, warp.any(T > topk.weight[K - 1].load(warp)));
      });
      block.sync();
      block.for_each_item(
          n, [&](int j) { return shared.batch.warps(j); },
          [&](const auto& item) LANGGS_INLINE_LAMBDA {
            const Splat& s = shared.batch.splat(item.index());
            const SplatColumn<F> column(s, columns);
            [[maybe_unused]] F largest(0.f);
            item.warps([&](const auto& warp) LANGGS_INLINE_LAMBDA {
              if (!is_live.load(warp)) return;
              const Footprint<F> at(s, column, rows.of(warp));
              const BlendStep<F> step(at, transmittance.load(warp));
              transmittance.store(warp, step.next_transmittance);
              red.store(warp, red.load(warp) + step.weight * s.red);
              green.store(warp, green.load(warp) + step.weight * s.green);
              blue.store(warp, blue.load(warp) + step.weight * s.blue);
              depth.store(warp, depth.load(warp) + step.weight * s.depth);
              if constexpr (K > 0) {
                largest = max(largest, step.weight);
                if (records.load(warp) && warp.any(step.weight > topk.weight[K - 1].load(warp)))
                  topk.insert(warp, step.weight, first + item.index());
              }
            });
            if constexpr (K > 0) shared.largest.put_max(item, largest);
          });
      if constexpr (K > 0) {
        block.sync();
        block.threads(n, [&](auto thread) {
          const WarpRange warps = shared.batch.warps(thread.index);
          if (warps.first <= warps.last)
            top.instance_max_weight[first + thread.index] = shared.largest.max(thread.index, warps);
        });
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
        block.threads(min(kThreads, end - first), [&](auto thread) {
          const int i = first + thread.index;
          top.slot[instances.sorted_slot[i]] = {top.instance_count[i], top.instance_max_weight[i]};
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
    LANGGS_INLINE void insert(const typename Block::Warp& warp, const VaryingOf<float, Block>& w, std::int32_t who) {
      Row row = load(warp);
      row.insert(w, who);
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
    const std::int32_t begin = instances.tile_begin[block.index()];
    const std::ptrdiff_t plane = static_cast<std::ptrdiff_t>(grid.width) * grid.height;
    for (int k = 0; k < K; ++k) {
      const auto filled = best.id[k] >= 0;
      pixels.store(warp, top.id + k * plane,
                   select(filled, warp.gather(top.instance_gaussian, max(best.id[k], begin)), -1));
      pixels.store(warp, top.weight + k * plane, best.weight[k]);
      block.count(top.instance_count, best.id[k], filled);
    }
  }
};

}  // namespace langgs
