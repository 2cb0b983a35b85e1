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

/// The pixels of one warp of one tile.
template <class Block>
struct WarpPixels {
  using F = VaryingOf<float, Block>;

  int first_column, first_row;  ///< of the warp, on the image
  int num_columns, num_rows;    ///< of the warp that lie on the image
  std::ptrdiff_t offset;        ///< of its first pixel in an image plane
  std::ptrdiff_t pitch;
  F column, row;  ///< pixel coordinates per lane

  LANGGS_INLINE WarpPixels(const TileGrid& grid, int tile, const typename Block::Warp& warp) {
    first_column = (tile % grid.columns) * TileGrid::kSize;
    first_row = (tile / grid.columns) * TileGrid::kSize + warp.index() * TileGrid::kRowsPerWarp;
    num_columns = clamp_count(grid.width - first_column, TileGrid::kSize);
    num_rows = clamp_count(grid.height - first_row, TileGrid::kRowsPerWarp);
    pitch = grid.width;
    offset = first_row * pitch + first_column;
    const auto lane = warp.lane_index();
    const auto in_row = lane & (TileGrid::kSize - 1);
    column = to_float(in_row) + static_cast<float>(first_column);
    row = to_float((lane - in_row)) * (1.f / TileGrid::kSize) + static_cast<float>(first_row);
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
  [[nodiscard]] LANGGS_INLINE F initial_transmittance() const {
    return select(
        (column < static_cast<float>(first_column + num_columns)) & (row < static_cast<float>(first_row + num_rows)),
        F(1.f), F(-1.f));
  }
  /// Whether the splat's box touches this warp's pixels.
  [[nodiscard]] LANGGS_INLINE bool touches(int splat_first_row, int splat_last_row) const {
    return splat_first_row < first_row + TileGrid::kRowsPerWarp && splat_last_row >= first_row;
  }

 private:
  static LANGGS_INLINE int clamp_count(int n, int most) { return n < 0 ? 0 : (n > most ? most : n); }
};

/// The (tile, splat) instances of a view. Sorted by tile, then by depth; ties by Gaussian index.
/// A *slot* numbers an instance grouped by splat, so that per-instance rows of one splat are contiguous.
struct InstanceView {
  const std::int32_t* tile_begin = nullptr;      ///< [num_tiles + 1] into sorted_slot
  const std::int32_t* sorted_slot = nullptr;     ///< [num_instances]
  const std::int32_t* slot_splat = nullptr;      ///< [num_instances] splat of each slot
  const Splat* splats = nullptr;                 ///< [num_splats], ascending by Gaussian index
  const std::int32_t* splat_gaussian = nullptr;  ///< [num_splats] Gaussian of each splat in the map
};

}  // namespace langgs
