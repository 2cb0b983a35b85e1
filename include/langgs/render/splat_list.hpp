// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <vector>

#include "langgs/device/algorithm.hpp"
#include "langgs/device/buffer.hpp"
#include "langgs/device/launch.hpp"
#include "langgs/render/projection.hpp"
#include "langgs/render/tiles.hpp"

namespace langgs {

/// What `ProjectGaussians` writes for each Gaussian of the map, one plane each.
enum ProjectedPlane : int {
  kPixelX,
  kPixelY,
  kConicXX,
  kConicXY,
  kConicYY,
  kLogOpacity,
  kDepth,
  kHalfWidth,
  kHalfHeight,
  kNumProjected
};

/// Projects every Gaussian; flags those that can touch a pixel.
struct ProjectGaussians {
  PlanesView map;
  View view;
  float* projected;  ///< [kNumProjected, stride]
  std::ptrdiff_t stride;
  std::int32_t* visible;  ///< [N] 1 or 0

  template <class Lanes>
  LANGGS_HD void operator()(const Lanes& lanes) const {
    using F = VaryingOf<float, Lanes>;
    const Projection<F> p(GaussianParameters<F>::read([&](int plane) { return lanes.load(map.plane(plane)); }), view);
    F half_width, half_height;
    splat_extent(p, half_width, half_height);
    const float right = static_cast<float>(view.camera.width - 1), bottom = static_cast<float>(view.camera.height - 1);
    // Written so that a NaN in what is drawn makes the Gaussian invisible.
    const auto usable = [&](const F& v) { return abs(v) < RasterConstants::kLargestValue; };
    const auto visible_mask =
        (p.t[2] > RasterConstants::kNearPlane) & (half_width > 0.f) & (p.determinant > 0.f) & (p.determinant < 1e30f) &
        (p.pixel[0] + half_width >= 0.f) & (p.pixel[0] - half_width <= right) & (p.pixel[1] + half_height >= 0.f) &
        (p.pixel[1] - half_height <= bottom) & usable(p.t[2]) & usable(lanes.load(map.plane(kRed))) &
        usable(lanes.load(map.plane(kGreen))) & usable(lanes.load(map.plane(kBlue)));
    const auto put = [&](ProjectedPlane plane, const F& v) { lanes.store(projected + plane * stride, v); };
    put(kPixelX, p.pixel[0]);
    put(kPixelY, p.pixel[1]);
    put(kConicXX, p.conic[0]);
    put(kConicXY, p.conic[1]);
    put(kConicYY, p.conic[2]);
    put(kLogOpacity, kLog256 * log(p.opacity));
    put(kDepth, p.t[2]);
    put(kHalfWidth, half_width);
    put(kHalfHeight, half_height);
    using Int = VaryingOf<std::int32_t, Lanes>;
    lanes.store(visible, select(visible_mask, Int(1), Int(0)));
  }
};

/// floor(x) for x in [-1, 65535], at most one more: what is rounded away makes a box larger, never smaller.
LANGGS_INLINE int floor_or_more(float x) { return static_cast<int>(x + 1.f) - 1; }
/// ceil(x) for x in [-1, 65535], at most one less.
LANGGS_INLINE int ceil_or_less(float x) { return 65536 - static_cast<int>(65536.f - x); }

/// The pixels that a splat's box covers, and the tiles that they lie in.
struct TileBox {
  int first_column, last_column, first_row, last_row;  ///< [px], inclusive

  LANGGS_INLINE TileBox(const Splat& s, int width, int height) {
    range(s.x, s.half_width, width, first_column, last_column);
    range(s.y, s.half_height, height, first_row, last_row);
  }
  [[nodiscard]] LANGGS_INLINE int first_tile_column() const { return first_column / TileGrid::kSize; }
  [[nodiscard]] LANGGS_INLINE int last_tile_column() const { return last_column / TileGrid::kSize; }
  [[nodiscard]] LANGGS_INLINE int first_tile_row() const { return first_row / TileGrid::kSize; }
  [[nodiscard]] LANGGS_INLINE int last_tile_row() const { return last_row / TileGrid::kSize; }
  /// Number of tiles; 0 for a splat between two pixel centres.
  [[nodiscard]] LANGGS_INLINE int count() const {
    if (last_column < first_column || last_row < first_row) return 0;
    return (last_tile_column() - first_tile_column() + 1) * (last_tile_row() - first_tile_row() + 1);
  }

 private:
  static LANGGS_INLINE void range(float centre, float half, int size, int& first, int& last) {
    const float limit = static_cast<float>(size - 1);
    first = ceil_or_less(min(max(centre - half, 0.f), limit));
    last = floor_or_more(max(min(centre + half, limit), 0.f));
  }
};

/// The rows that the ellipse of a splat reaches within a band of columns: exact, where the box takes its corners too.
class RowsOfColumns {
 public:
  LANGGS_INLINE RowsOfColumns(const Splat& s, const TileBox& box) : x_(s.x), y_(s.y), box_(box) {
    slope_ = -0.5f * s.xy / s.half_yy;
    highest_at_ = -0.5f * s.xy / s.half_xx * s.half_height;
    // q(u, v) = half_xx u^2 + xy u v + half_yy v^2 <= level, solved for v; u = half_width touches the ellipse.
    span_ = sqrt(1.001f * (s.log_opacity - Footprint<float>::kMinLog) / s.half_yy);
    inverse_width_ = 1.f / s.half_width;
  }
  LANGGS_INLINE void operator()(int first_column, int last_column, int& first_row, int& last_row) const {
    const float left = static_cast<float>(max(first_column, box_.first_column)) - x_;
    const float right = static_cast<float>(min(last_column, box_.last_column)) - x_;
    first_row = ceil_or_less(min(max(y_ + edge(left, right, -1.f), static_cast<float>(box_.first_row)), 65535.f));
    last_row = floor_or_more(max(min(y_ + edge(left, right, 1.f), static_cast<float>(box_.last_row)), -1.f));
  }

 private:
  /// The extreme v of the side (1: largest, -1: smallest) for u in [left, right].
  [[nodiscard]] LANGGS_INLINE float edge(float left, float right, float side) const {
    const float u = min(max(side * highest_at_, left), right), share = u * inverse_width_;
    return slope_ * u + side * span_ * sqrt(max(1.f - share * share, 0.f));
  }

  float x_, y_;
  const TileBox& box_;
  float slope_, highest_at_, span_, inverse_width_;
};

/// Packs the visible Gaussians as splats with their pixel boxes, depth keys and numbers of tiles.
struct PackSplats {
  PlanesView map;
  Camera camera;
  const float* projected;
  std::ptrdiff_t stride;
  const std::int32_t* gaussian;  ///< [V]
  Splat* splats;                 ///< [V]
  std::uint32_t* depth_key;      ///< [V]
  std::int32_t* num_tiles;       ///< [V]

  LANGGS_HD void operator()(int c) const {
    const int i = gaussian[c];
    const auto at = [&](ProjectedPlane plane) { return projected[plane * stride + i]; };
    Splat s;
    s.x = at(kPixelX);
    s.y = at(kPixelY);
    s.half_xx = 0.5f * kLog256 * at(kConicXX);
    s.xy = kLog256 * at(kConicXY);
    s.half_yy = 0.5f * kLog256 * at(kConicYY);
    s.log_opacity = at(kLogOpacity);
    s.depth = at(kDepth);
    s.red = map.plane(kRed)[i];
    s.green = map.plane(kGreen)[i];
    s.blue = map.plane(kBlue)[i];
    s.half_width = at(kHalfWidth);
    s.half_height = at(kHalfHeight);
    splats[c] = s;
    // Positive floats order as their bits.
    std::memcpy(&depth_key[c], &s.depth, sizeof(float));
    num_tiles[c] = TileBox(s, camera.width, camera.height).count();
  }
};

/// Writes the (tile, slot) pairs of each splat. Splats are read as they lie in memory, and write to the places that
/// they have from near to far: a store to anywhere is cheap, a load from anywhere is not.
struct EmitInstances {
  TileGrid grid;
  const std::int32_t* emit_begin;  ///< [V] by splat: places of its pairs, in order of depth
  const std::int32_t* slot_begin;  ///< [V + 1] by splat
  const Splat* splats;
  std::uint32_t* tile;  ///< [I]
  std::int32_t* slot;   ///< [I]
  Instance* instance;   ///< [I] by slot

  LANGGS_HD void operator()(int c) const {
    const Splat& s = splats[c];
    const TileBox box(s, grid.width, grid.height);
    if (box.count() == 0) return;
    const RowsOfColumns rows_of(s, box);
    int e = emit_begin[c], k = slot_begin[c];
    for (int column = box.first_tile_column(); column <= box.last_tile_column(); ++column) {
      int first, last;
      rows_of(column * TileGrid::kSize, column * TileGrid::kSize + TileGrid::kSize - 1, first, last);
      for (int row = box.first_tile_row(); row <= box.last_tile_row(); ++row) {
        const int top = row * TileGrid::kSize;
        tile[e] = static_cast<std::uint32_t>(row * grid.columns + column);
        slot[e++] = k;
        instance[k++] = {c, warp_of(max(first - top, 0)), warp_of(min(last - top, TileGrid::kSize - 1))};
      }
    }
  }

 private:
  /// The warp of a row of a tile; rows beyond the tile stay beyond its warps.
  static LANGGS_INLINE std::int16_t warp_of(int row) {
    static_assert(TileGrid::kRowsPerWarp == 2);
    return static_cast<std::int16_t>(row >> 1);
  }
};

/// The visible Gaussians of a view as splats, and the tiles that each of them touches, sorted by depth in each tile.
/// Owns its buffers and reuses them from view to view.
template <class Backend>
class SplatList {
 public:
  void build(const Executor<Backend>& executor, const PlanesView& map, const View& view) {
    grid_ = TileGrid(view.camera);
    project(executor, map, view);
    sort_into_tiles(executor);
  }

  [[nodiscard]] const TileGrid& grid() const { return grid_; }
  [[nodiscard]] int num_splats() const { return num_splats_; }
  [[nodiscard]] int num_instances() const { return num_instances_; }
  /// [V] Gaussian of each splat, ascending.
  [[nodiscard]] const std::int32_t* gaussian() const { return gaussian_.data(); }
  /// [V + 1] slots of splat c are slot_begin()[c] .. slot_begin()[c + 1].
  [[nodiscard]] const std::int32_t* slot_begin() const { return slot_begin_.data(); }
  [[nodiscard]] InstanceView instances() const {
    return {tile_begin_.data(), sorted_slot_.data(), instance_.data(), splats_.data(), gaussian_.data()};
  }

 private:
  void project(const Executor<Backend>& executor, const PlanesView& map, const View& view) {
    const int n = map.size;
    projected_.resize_discard(static_cast<std::size_t>(kNumProjected) * map.stride);
    visible_.resize_discard(n);
    gaussian_.resize_discard(n + 1);
    for_each_lanes(executor, n, ProjectGaussians{map, view, projected_.data(), map.stride, visible_.data()});
    num_splats_ = select_flagged(executor, visible_.data(), gaussian_.data(), n);
    splats_.resize_discard(num_splats_);
    depth_key_.resize_discard(num_splats_);
    num_tiles_.resize_discard(num_splats_);
    for_each_n(executor, num_splats_,
               PackSplats{map, view.camera, projected_.data(), map.stride, gaussian_.data(), splats_.data(),
                          depth_key_.data(), num_tiles_.data()});
  }

  void sort_into_tiles(const Executor<Backend>& executor) {
    slot_begin_.resize_discard(num_splats_ + 1);
    emit_begin_.resize_discard(num_splats_);
    order_.resize_discard(num_splats_);
    num_instances_ = exclusive_scan(executor, num_tiles_.data(), slot_begin_.data(), num_splats_);
    for (int c = 0; c < num_splats_; ++c) order_.data()[c] = c;
    sort_by_key(executor, depth_key_.data(), order_.data(), num_splats_);
    std::int32_t total = 0;
    for (int rank = 0; rank < num_splats_; ++rank) {
      const int c = order_.data()[rank];
      emit_begin_.data()[c] = total;
      total += num_tiles_.data()[c];
    }
    tile_.resize_discard(num_instances_);
    slot_.resize_discard(num_instances_);
    instance_.resize_discard(num_instances_);
    sorted_slot_.resize_discard(num_instances_);
    for_each_n(executor, num_splats_,
               EmitInstances{grid_, emit_begin_.data(), slot_begin_.data(), splats_.data(), tile_.data(), slot_.data(),
                             instance_.data()});
    group_by_key(executor, tile_.data(), slot_.data(), num_instances_, sorted_slot_.data(), tile_begin_, grid_.count(),
                 scratch_);
  }

  TileGrid grid_;
  int num_splats_ = 0, num_instances_ = 0;
  Buffer<float, Backend> projected_;
  Buffer<Splat, Backend> splats_;
  Buffer<std::uint32_t, Backend> depth_key_, tile_;
  Buffer<std::int32_t, Backend> visible_, gaussian_, num_tiles_, slot_begin_, emit_begin_, order_;
  Buffer<std::int32_t, Backend> slot_, sorted_slot_;
  Buffer<Instance, Backend> instance_;
  std::vector<std::int32_t> tile_begin_, scratch_;
};

}  // namespace langgs
