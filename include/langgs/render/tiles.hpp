// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

#include "langgs/core/camera.hpp"
#include "langgs/core/config.hpp"
#include "langgs/device/block.hpp"
#include "langgs/render/blend.hpp"

namespace langgs {

/// The image cut into 16x16 tiles; a warp owns two rows of one.
struct TileGrid {
  static constexpr int kSize = RasterConstants::kTileSize;
  static constexpr int kThreads = kSize * kSize;
  static constexpr int kRowsPerWarp = 32 / kSize;

  int width = 0, height = 0;  ///< of the image [px]
  int columns = 0, rows = 0;  ///< of tiles

  TileGrid() = default;
  explicit TileGrid(const Camera& camera)
      : width(camera.width),
        height(camera.height),
        columns((camera.width + kSize - 1) / kSize),
        rows((camera.height + kSize - 1) / kSize) {}
  [[nodiscard]] LANGGS_HD int count() const { return columns * rows; }
};

/// The pixel columns of a tile, one a lane: the same for all its warps.
template <class Block>
[[nodiscard]] LANGGS_INLINE VaryingOf<float, Block> pixel_columns(const TileGrid& grid, const Block& block) {
  return to_float(block.lane_index() & (TileGrid::kSize - 1)) +
         static_cast<float>(block.index() % grid.columns * TileGrid::kSize);
}

/// The pixel rows of a warp of a tile, one a lane.
template <class Block>
[[nodiscard]] LANGGS_INLINE VaryingOf<float, Block> pixel_rows(const TileGrid& grid, const Block& block,
                                                               const typename Block::Warp& warp) {
  const auto lane = block.lane_index();
  return to_float(lane - (lane & (TileGrid::kSize - 1))) * (1.f / TileGrid::kSize) +
         static_cast<float>(block.index() / grid.columns * TileGrid::kSize + warp.index() * TileGrid::kRowsPerWarp);
}

/// The pixels of one warp of one tile.
template <class Block>
struct WarpPixels {
  using F = VaryingOf<float, Block>;

  int first_column, first_row;  ///< of the warp, on the image
  int num_columns, num_rows;    ///< of the warp that lie on the image
  std::ptrdiff_t offset;        ///< of its first pixel in an image plane
  std::ptrdiff_t pitch;

  LANGGS_INLINE WarpPixels(const TileGrid& grid, int tile, const typename Block::Warp& warp) {
    first_column = (tile % grid.columns) * TileGrid::kSize;
    first_row = (tile / grid.columns) * TileGrid::kSize + warp.index() * TileGrid::kRowsPerWarp;
    num_columns = clamp_count(grid.width - first_column, TileGrid::kSize);
    num_rows = clamp_count(grid.height - first_row, TileGrid::kRowsPerWarp);
    pitch = grid.width;
    offset = first_row * pitch + first_column;
  }
  /// Reads a pixel of an image plane for each lane; `outside` off the image.
  template <class T>
  [[nodiscard]] LANGGS_INLINE VaryingOf<T, Block> load(const typename Block::Warp& warp, const T* plane,
                                                       T outside) const {
    return warp.template load_rect<TileGrid::kSize>(plane + offset, pitch, num_columns, num_rows, outside);
  }
  template <class T>
  LANGGS_INLINE void store(const typename Block::Warp& warp, T* plane, const VaryingOf<T, Block>& v) const {
    warp.template store_rect<TileGrid::kSize>(plane + offset, pitch, num_columns, num_rows, v);
  }
  /// 1 for pixels on the image, -1 (a stopped pixel) for the others.
  [[nodiscard]] LANGGS_INLINE F initial_transmittance(const typename Block::Warp& warp) const {
    const auto lane = warp.lane_index(), column = lane & (TileGrid::kSize - 1);
    return select((column < num_columns) & (lane - column < num_rows * TileGrid::kSize), F(1.f), F(-1.f));
  }

 private:
  static LANGGS_INLINE int clamp_count(int n, int most) { return n < 0 ? 0 : (n > most ? most : n); }
};

/// A splat in one tile, with the tile's warps that it reaches.
struct Instance {
  std::int32_t splat;
  std::int16_t first_warp, last_warp;  ///< inclusive

  [[nodiscard]] LANGGS_INLINE WarpRange warps() const { return {first_warp, last_warp}; }
};

/// The (tile, splat) instances of a view. Sorted by tile, then by depth; ties by Gaussian index.
/// A *slot* numbers an instance grouped by splat, so that per-instance rows of one splat are contiguous.
struct InstanceView {
  const std::int32_t* tile_begin = nullptr;      ///< [num_tiles + 1] into sorted_slot
  const std::int32_t* sorted_slot = nullptr;     ///< [num_instances]
  const Instance* slot = nullptr;                ///< [num_instances]
  const Splat* splats = nullptr;                 ///< [num_splats], ascending by Gaussian index
  const std::int32_t* splat_gaussian = nullptr;  ///< [num_splats] Gaussian of each splat in the map

  [[nodiscard]] LANGGS_INLINE const Instance& sorted(int i) const { return slot[sorted_slot[i]]; }
};

/// The next instances of a tile in shared memory, front to back.
template <class Block, int kBatch>
class TileBatch {
 public:
  /// Loads the instances of the sorted list from `first` on that lie before `end`, and returns how many there are;
  /// `sync` before the first use.
  [[nodiscard]] LANGGS_INLINE int load(Block& block, const InstanceView& instances, int first, int end) {
    const int n = min(end - first, kBatch);
    block.sync();  // the batch before has been read
    block.threads(n, [&](auto thread) LANGGS_INLINE_LAMBDA {
      const int at = first + thread.index;
      const Instance& instance = instances.sorted(at);
      splat_.set(thread.index, instances.splats[instance.splat]);
      warps_.set(thread.index, instance.warps());
      if (at + kBatch < end) block.prefetch(&instances.splats[instances.sorted(at + kBatch).splat]);
    });
    return n;
  }
  [[nodiscard]] LANGGS_INLINE decltype(auto) splat(int j) const { return splat_[j]; }
  [[nodiscard]] LANGGS_INLINE WarpRange warps(int j) const { return warps_[j]; }

 private:
  typename Block::template SharedArray<Splat, kBatch> splat_;
  typename Block::template SharedArray<WarpRange, kBatch> warps_;
};

}  // namespace langgs
