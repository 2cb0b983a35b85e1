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
  kOpacity,
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
    put(kOpacity, p.opacity);
    put(kDepth, p.t[2]);
    put(kHalfWidth, half_width);
    put(kHalfHeight, half_height);
    using Int = VaryingOf<std::int32_t, Lanes>;
    lanes.store(visible, select(visible_mask, Int(1), Int(0)));
  }
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
    s.half_xx = 0.5f * at(kConicXX);
    s.xy = at(kConicXY);
    s.half_yy = 0.5f * at(kConicYY);
    s.opacity = at(kOpacity);
    s.depth = at(kDepth);
    s.red = map.plane(kRed)[i];
    s.green = map.plane(kGreen)[i];
    s.blue = map.plane(kBlue)[i];
    range(s.x, at(kHalfWidth), camera.width, s.first_column, s.last_column);
    range(s.y, at(kHalfHeight), camera.height, s.first_row, s.last_row);
    splats[c] = s;
    // Positive floats order as their bits.
    std::memcpy(&depth_key[c], &s.depth, sizeof(float));
    const int columns = s.last_column / TileGrid::kSize - s.first_column / TileGrid::kSize + 1;
    const int rows = s.last_row / TileGrid::kSize - s.first_row / TileGrid::kSize + 1;
    // A splat between two pixel centres touches none.
    num_tiles[c] = s.last_column < s.first_column || s.last_row < s.first_row ? 0 : columns * rows;
  }

 private:
  LANGGS_HD static void range(float centre, float half, int size, short& first, short& last) {
    const float limit = static_cast<float>(size - 1);
    first = static_cast<short>(std::ceil(min(max(centre - half, 0.f), limit)));
    last = static_cast<short>(std::floor(max(min(centre + half, limit), 0.f)));
  }
};

/// Writes the (tile, slot) pairs of each splat, splats taken from near to far.
struct EmitInstances {
  int tile_columns;
  const std::int32_t* order;       ///< [V] splats from near to far
  const std::int32_t* emit_begin;  ///< [V + 1] by rank
  const std::int32_t* slot_begin;  ///< [V + 1] by splat
  const Splat* splats;
  std::uint32_t* tile;       ///< [I]
  std::int32_t* slot;        ///< [I]
  std::int32_t* slot_splat;  ///< [I]

  LANGGS_HD void operator()(int rank) const {
    const int c = order[rank];
    const Splat& s = splats[c];
    int e = emit_begin[rank], k = slot_begin[c];
    if (slot_begin[c + 1] == k) return;
    for (int row = s.first_row / TileGrid::kSize; row <= s.last_row / TileGrid::kSize; ++row)
      for (int column = s.first_column / TileGrid::kSize; column <= s.last_column / TileGrid::kSize; ++column) {
        tile[e] = static_cast<std::uint32_t>(row * tile_columns + column);
        slot[e++] = k;
        slot_splat[k++] = c;
      }
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
    return {tile_begin_.data(), sorted_slot_.data(), slot_splat_.data(), splats_.data(), gaussian_.data()};
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
    emit_begin_.resize_discard(num_splats_ + 1);
    order_.resize_discard(num_splats_);
    num_instances_ = exclusive_scan(executor, num_tiles_.data(), slot_begin_.data(), num_splats_);
    for (int c = 0; c < num_splats_; ++c) order_.data()[c] = c;
    sort_by_key(executor, depth_key_.data(), order_.data(), num_splats_);
    std::int32_t total = 0;
    for (int rank = 0; rank < num_splats_; ++rank) {
      emit_begin_.data()[rank] = total;
      total += num_tiles_.data()[order_.data()[rank]];
    }
    emit_begin_.data()[num_splats_] = total;
    tile_.resize_discard(num_instances_);
    slot_.resize_discard(num_instances_);
    slot_splat_.resize_discard(num_instances_);
    sorted_slot_.resize_discard(num_instances_);
    for_each_n(executor, num_splats_,
               EmitInstances{grid_.columns, order_.data(), emit_begin_.data(), slot_begin_.data(), splats_.data(),
                             tile_.data(), slot_.data(), slot_splat_.data()});
    group_by_key(executor, tile_.data(), slot_.data(), num_instances_, sorted_slot_.data(), tile_begin_, grid_.count(),
                 scratch_);
  }

  TileGrid grid_;
  int num_splats_ = 0, num_instances_ = 0;
  Buffer<float, Backend> projected_;
  Buffer<Splat, Backend> splats_;
  Buffer<std::uint32_t, Backend> depth_key_, tile_;
  Buffer<std::int32_t, Backend> visible_, gaussian_, num_tiles_, slot_begin_, emit_begin_, order_;
  Buffer<std::int32_t, Backend> slot_, slot_splat_, sorted_slot_;
  std::vector<std::int32_t> tile_begin_, scratch_;
};

}  // namespace langgs
