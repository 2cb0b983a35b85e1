// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

#include "langgs/render/tiles.hpp"

namespace langgs {

/// What a tile says about one of its splats.
struct InstanceStatistics {
  std::int32_t topk_count;  ///< pixels of the tile that have the splat among their K largest weights
  float max_weight;         ///< largest weight in the tile
};

/// Top-K records and per-instance statistics. The scratch rows have a place for each instance of each tile, behind a
/// place for nobody: those of tile t begin at tile_begin[t] + t.
struct TopKPlanes {
  std::int32_t* id = nullptr;              ///< [K, H, W] Gaussian index, -1 where empty
  float* weight = nullptr;                 ///< [K, H, W] raw blending weights, descending
  InstanceStatistics* slot = nullptr;      ///< [num_instances] by slot
  std::int32_t* place_gaussian = nullptr;  ///< [num_instances + num_tiles] scratch
  std::int32_t* place_count = nullptr;     ///< [num_instances + num_tiles] scratch
  float* place_max_weight = nullptr;       ///< [num_instances + num_tiles] scratch
};

/// Records the K largest weights of every pixel of a tile (paper Eq. 2), and for each splat of the tile its largest
/// weight and the number of pixels that have it among their K. Of equal weights the front-most is kept and comes first.
template <int K, int kBatch, class Block>
class TopKRecorder {
 public:
  using F = VaryingOf<float, Block>;
  using Int = VaryingOf<std::int32_t, Block>;
  using Warp = typename Block::Warp;
  struct Shared {
    typename Block::template ItemTotals<1, kBatch> largest;
  };

  LANGGS_INLINE TopKRecorder(const TopKPlanes& planes, const InstanceView& instances, const Block& block)
      : planes_(planes),
        instances_(instances),
        begin_(instances.tile_begin[block.index()]),
        end_(instances.tile_begin[block.index() + 1]),
        places_(static_cast<std::ptrdiff_t>(begin_) + block.index()) {}

  LANGGS_INLINE void clear(const Warp& warp) { weights_.clear(warp); }

  /// Before the n instances of the sorted list from `first` on are offered.
  LANGGS_INLINE void begin_batch(Block& block, int first, int n) const {
    block.threads(n, [&](auto thread) LANGGS_INLINE_LAMBDA {
      const int i = first + thread.index;
      planes_.place_gaussian[place_of(i)] = instances_.splat_gaussian[instances_.sorted(i).splat];
      planes_.place_count[place_of(i)] = 0;
      block.prefetch(planes_.slot + instances_.sorted_slot[i]);  // for the end of the tile
    });
  }
  LANGGS_INLINE void offer(const Warp& warp, const F& weight, int instance) {
    weights_.offer(warp, weight, 1 + instance - begin_);
  }
  /// The largest weight of an item of the batch, over the warps that it concerns.
  template <class Item>
  LANGGS_INLINE void put_largest(Shared& shared, const Item& item, const F& weight) const {
    shared.largest.put_max(item, weight);
  }
  template <class WarpsOf>
  LANGGS_INLINE void end_batch(Block& block, const Shared& shared, int first, int n, const WarpsOf& warps_of) {
    block.warps([&](const auto& warp) LANGGS_INLINE_LAMBDA { weights_.settle(warp); });
    block.sync();
    block.threads(n, [&](auto thread) LANGGS_INLINE_LAMBDA {
      planes_.place_max_weight[place_of(first + thread.index)] =
          shared.largest.max(thread.index, warps_of(thread.index));
    });
  }

  /// Writes what was recorded, once all instances before `seen_end` have been offered.
  LANGGS_INLINE void store(Block& block, const TileGrid& grid, int seen_end) const {
    const std::ptrdiff_t plane = static_cast<std::ptrdiff_t>(grid.width) * grid.height;
    block.threads(1, [&](auto) LANGGS_INLINE_LAMBDA {
      planes_.place_gaussian[places_] = -1;
      planes_.place_count[places_] = 0;  // nobody reads how many are empty, but they are counted
    });
    block.sync();
    block.warps([&](const auto& warp) {
      const WarpPixels<Block> pixels(grid, block.index(), warp);
      Int place[K];
      for (int k = 0; k < K; ++k) {
        place[k] = weights_.tag(warp, k);
        pixels.store(warp, planes_.id + k * plane, warp.gather(planes_.place_gaussian + places_, place[k]));
        pixels.store(warp, planes_.weight + k * plane, weights_.value(warp, k));
      }
      block.count(planes_.place_count + places_, place);
    });
    block.sync();
    for (int first = begin_; first < end_; first += Block::kThreads)
      block.threads(min(Block::kThreads, end_ - first), [&](auto thread) LANGGS_INLINE_LAMBDA {
        const int i = first + thread.index;
        InstanceStatistics seen{0, 0.f};
        if (i < seen_end) seen = {planes_.place_count[place_of(i)], planes_.place_max_weight[place_of(i)]};
        planes_.slot[instances_.sorted_slot[i]] = seen;
      });
  }

 private:
  [[nodiscard]] LANGGS_INLINE std::ptrdiff_t place_of(int instance) const { return places_ + 1 + instance - begin_; }

  const TopKPlanes& planes_;
  const InstanceView& instances_;
  int begin_, end_;
  std::ptrdiff_t places_;
  typename Block::template KLargest<K, kBatch> weights_;
};

/// Records nothing.
template <int kBatch, class Block>
class TopKRecorder<0, kBatch, Block> {
 public:
  struct Shared {};
  LANGGS_INLINE TopKRecorder(const TopKPlanes&, const InstanceView&, const Block&) {}
  LANGGS_INLINE void clear(const typename Block::Warp&) {}
  LANGGS_INLINE void begin_batch(Block&, int, int) const {}
  LANGGS_INLINE void offer(const typename Block::Warp&, const VaryingOf<float, Block>&, int) {}
  template <class Item>
  LANGGS_INLINE void put_largest(Shared&, const Item&, const VaryingOf<float, Block>&) const {}
  template <class WarpsOf>
  LANGGS_INLINE void end_batch(Block&, const Shared&, int, int, const WarpsOf&) {}
  LANGGS_INLINE void store(Block&, const TileGrid&, int) const {}
};

}  // namespace langgs
