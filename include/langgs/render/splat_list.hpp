// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <cstring>

#include "langgs/device/algorithm.hpp"
#include "langgs/device/buffer.hpp"
#include "langgs/device/counted_lists.hpp"
#include "langgs/device/key_value.hpp"
#include "langgs/device/launch.hpp"
#include "langgs/render/projection.hpp"
#include "langgs/render/tile_cover.hpp"
#include "langgs/render/tiles.hpp"

namespace langgs {

/// What `ProjectGaussians` writes for each Gaussian of the map, one plane each: the members of Splat but the colour.
enum ProjectedPlane : int {
  kPixelX,
  kPixelY,
  kHalfXX,
  kXY,
  kHalfYY,
  kLogOpacity,
  kDepth,
  kHalfWidth,
  kHalfHeight,
  kNumProjected
};

/// The outline that lies in the planes.
template <class Lanes>
[[nodiscard]] LANGGS_INLINE SplatOutline<VaryingOf<float, Lanes>> load_outline(const Lanes& lanes,
                                                                               const float* projected,
                                                                               std::ptrdiff_t stride) {
  const auto at = [&](ProjectedPlane plane) { return lanes.load(projected + plane * stride); };
  return {at(kPixelX), at(kPixelY),     at(kHalfXX),    at(kXY),
          at(kHalfYY), at(kLogOpacity), at(kHalfWidth), at(kHalfHeight)};
}

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
    put(kHalfXX, 0.5f * kLog256 * p.conic[0]);
    put(kXY, kLog256 * p.conic[1]);
    put(kHalfYY, 0.5f * kLog256 * p.conic[2]);
    put(kLogOpacity, kLog256 * log(p.opacity));
    put(kDepth, p.t[2]);
    put(kHalfWidth, half_width);
    put(kHalfHeight, half_height);
    using Int = VaryingOf<std::int32_t, Lanes>;
    lanes.store(visible, select(visible_mask, Int(1), Int(0)));
  }
};

/// Counts the tiles that each Gaussian reaches.
struct CountTiles {
  TileGrid grid;
  const float* projected;
  std::ptrdiff_t stride;
  const std::int32_t* visible;  ///< [N]
  std::int32_t* num_tiles;      ///< [N]

  template <class Lanes>
  LANGGS_HD void operator()(const Lanes& lanes) const {
    using Int = VaryingOf<std::int32_t, Lanes>;
    Int total(0);
    const auto wanted = (lanes.load(visible) != 0) & lanes.active();
    if (lanes.any(wanted)) {
      const TileCover<Lanes> cover(lanes, load_outline(lanes, projected, stride), grid, wanted);
      for (int k = 0; k < lanes.max(cover.num_columns()); ++k) total += cover.column(k).num_tiles;
    }
    lanes.store(num_tiles, total);
  }
};

/// Packs the visible Gaussians as splats, with their depth keys and slots.
struct PackSplats {
  PlanesView map;
  const float* projected;
  std::ptrdiff_t stride;
  const std::int32_t* visible;   ///< [N]
  const std::int32_t* splat_of;  ///< [N]
  const std::int32_t* slot_of;   ///< [N] first slot of each Gaussian
  Splat* splats;                 ///< [V]
  std::int32_t* gaussian;        ///< [V]
  std::int32_t* slot_begin;      ///< [V]
  std::uint32_t* depth_key;      ///< [V]
  std::int32_t* order;           ///< [V]
  ListSize num_splats;           ///< V, or 0 where there is no room for them

  template <class Lanes>
  LANGGS_HD void operator()(const Lanes& lanes) const {
    if (num_splats.get() == 0) return;
    const auto wanted = (lanes.load(visible) != 0) & lanes.active();
    if (!lanes.any(wanted)) return;
    const auto at = [&](ProjectedPlane plane) { return lanes.values(lanes.load(projected + plane * stride)); };
    const auto colour = [&](Plane plane) { return lanes.values(lanes.load(map.plane(plane))); };
    const auto x = at(kPixelX), y = at(kPixelY), half_xx = at(kHalfXX), xy = at(kXY), half_yy = at(kHalfYY);
    const auto log_opacity = at(kLogOpacity), depth = at(kDepth), half_width = at(kHalfWidth),
               half_height = at(kHalfHeight);
    const auto red = colour(kRed), green = colour(kGreen), blue = colour(kBlue);
    const auto index = lanes.values(lanes.index()), splat = lanes.values(lanes.load(splat_of)),
               slot = lanes.values(lanes.load(slot_of));
    lanes.each(wanted, [&](int l) LANGGS_INLINE_LAMBDA {
      const int c = splat[l];
      splats[c] = {x[l],   y[l],     half_xx[l], xy[l],    half_yy[l],    log_opacity[l],
                   red[l], green[l], blue[l],    depth[l], half_width[l], half_height[l]};
      gaussian[c] = index[l];
      slot_begin[c] = slot[l];
      order[c] = c;
      // Positive floats order as their bits.
      const float z = depth[l];
      std::memcpy(&depth_key[c], &z, sizeof(float));
    });
  }
};

/// Writes the (tile, slot) pairs of each splat. Splats are read as they lie in memory, and write to the places that
/// they have from near to far: a store to anywhere is cheap, a load from anywhere is not.
struct EmitInstances {
  TileGrid grid;
  const float* projected;
  std::ptrdiff_t stride;
  const std::int32_t* visible;     ///< [N]
  const std::int32_t* splat_of;    ///< [N]
  const std::int32_t* slot_of;     ///< [N]
  const std::int32_t* emit_begin;  ///< [V] by splat: places of its pairs, in order of depth
  KeyValue* tile_slot;             ///< [I]
  Instance* instance;              ///< [I] by slot
  ListSize num_instances;          ///< I, or 0 where there is no room for them

  template <class Lanes>
  LANGGS_HD void operator()(const Lanes& lanes) const {
    if (num_instances.get() == 0) return;
    using Int = VaryingOf<std::int32_t, Lanes>;
    const auto wanted = (lanes.load(visible) != 0) & lanes.active();
    if (!lanes.any(wanted)) return;
    const auto splat = lanes.load(splat_of);
    const auto c = lanes.values(splat);
    Int place = lanes.gather(emit_begin, splat), next_slot = lanes.load(slot_of);
    lanes.prefetch(tile_slot, place);
    const TileCover<Lanes> cover(lanes, load_outline(lanes, projected, stride), grid, wanted);
    for (int k = 0; k < lanes.max(cover.num_columns()); ++k) {
      const TileColumn<Int> column = cover.column(k);
      const Int tile_column = cover.tile_column(k);
      for (int r = 0; r < lanes.max(column.num_tiles); ++r) {
        const auto reached = column.num_tiles > r;
        const Int row = column.first_tile_row + r;
        const auto e = lanes.values(place), s = lanes.values(next_slot),
                   t = lanes.values(row * grid.columns + tile_column), first = lanes.values(column.first_warp_of(row)),
                   last = lanes.values(column.last_warp_of(row));
        lanes.each(reached, [&](int l) LANGGS_INLINE_LAMBDA {
          tile_slot[e[l]] = {static_cast<std::uint32_t>(t[l]), s[l]};
          instance[s[l]] = {c[l], static_cast<std::int16_t>(first[l]), static_cast<std::int16_t>(last[l])};
        });
        const Int one = select(reached, Int(1), Int(0));
        place += one;
        next_slot += one;
      }
    }
  }
};

/// Writes what follows the last slot.
struct EndSlots {
  std::int32_t* slot_begin;
  ListSize num_splats, num_instances;
  LANGGS_HD void operator()(int) const { slot_begin[num_splats.get()] = num_instances.get(); }
};

/// Brings a view to the backend's memory, as an argument of a kernel: nothing waits, and nothing must be kept.
struct PutView {
  View view;
  View* to;
  LANGGS_HD void operator()(int) const { *to = view; }
};

/// The visible Gaussians of a view as splats, and the tiles that each of them touches, sorted by depth in each tile.
/// Owns its buffers and reuses them from view to view.
///
/// How long the lists are is only known once all Gaussians were projected. `build` waits for it. Who would rather go on
/// says `count` and `fill`, and asks `fits` when the device has had the time: if the answer is no, the lists were left
/// empty, and `fill` has the room when it is said again.
template <class Backend>
class SplatList {
 public:
  void build(const Executor<Backend>& executor, const PlanesView& map, const View& view) {
    count(executor, map, view);
    (void)fits();  // and now they do
    fill(executor, map);
  }

  /// Projects every Gaussian and counts the tiles that it reaches.
  void count(const Executor<Backend>& executor, const PlanesView& map, const View& view) {
    grid_ = TileGrid(view.camera);
    const int n = map.size;
    view_.resize_discard(executor, 1);
    projected_.resize_discard(executor, static_cast<std::size_t>(kNumProjected) * map.stride);
    for (auto* buffer : {&visible_, &num_tiles_}) buffer->resize_discard(executor, n);
    for (auto* buffer : {&splat_of_, &slot_of_}) buffer->resize_discard(executor, n + 1);
    for_each_n(executor, 1, PutView{view, view_.data()});
    for_each_lanes(executor, n, ProjectGaussians{map, view, projected_.data(), map.stride, visible_.data()});
    for_each_lanes(executor, n, CountTiles{grid_, projected_.data(), map.stride, visible_.data(), num_tiles_.data()});
    lists_.scan(executor, {{visible_.data(), splat_of_.data()}, {num_tiles_.data(), slot_of_.data()}}, n);
  }
  /// Whether the lists since the last `count` had room; waits for it. Where not, from now on they have.
  [[nodiscard]] bool fits() { return lists_.fits(); }
  /// Writes the lists of the last `count`, which was given the same map; waits for nothing.
  void fill(const Executor<Backend>& executor, const PlanesView& map) {
    lists_.begin(executor);
    pack(executor, map);
    sort_into_tiles(executor, map);
  }

  [[nodiscard]] const TileGrid& grid() const { return grid_; }
  [[nodiscard]] ListSize splats_size() const { return lists_[0]; }
  [[nodiscard]] ListSize instances_size() const { return lists_[1]; }
  /// Exact after `build` and `fits`, until then what there is room for.
  [[nodiscard]] int num_splats() const { return lists_[0].most; }
  [[nodiscard]] int num_instances() const { return lists_[1].most; }
  /// The view, in the backend's memory.
  [[nodiscard]] const View* view() const { return view_.data(); }
  /// [V] Gaussian of each splat, ascending.
  [[nodiscard]] const std::int32_t* gaussian() const { return gaussian_.data(); }
  /// [V + 1] slots of splat c are slot_begin()[c] .. slot_begin()[c + 1].
  [[nodiscard]] const std::int32_t* slot_begin() const { return slot_begin_.data(); }
  [[nodiscard]] InstanceView instances() const {
    return {tile_begin_.data(), sorted_slot_.data(), instance_.data(), splats_.data(), gaussian_.data()};
  }

 private:
  void pack(const Executor<Backend>& executor, const PlanesView& map) {
    const std::size_t most = num_splats();
    for (auto* buffer : {&gaussian_, &order_, &emit_begin_}) buffer->resize_discard(executor, most);
    splats_.resize_discard(executor, most);
    depth_key_.resize_discard(executor, most);
    slot_begin_.resize_discard(executor, most + 1);
    for_each_lanes(executor, map.size,
                   PackSplats{map, projected_.data(), map.stride, visible_.data(), splat_of_.data(), slot_of_.data(),
                              splats_.data(), gaussian_.data(), slot_begin_.data(), depth_key_.data(), order_.data(),
                              splats_size()});
    for_each_n(executor, 1, EndSlots{slot_begin_.data(), splats_size(), instances_size()});
  }

  void sort_into_tiles(const Executor<Backend>& executor, const PlanesView& map) {
    sort_by_key(executor, depth_key_.data(), order_.data(), splats_size(), scratch_);
    scan_in_order(executor, order_.data(), slot_begin_.data(), emit_begin_.data(), splats_size());
    const std::size_t most = num_instances();
    tile_slot_.resize_discard(executor, most);
    sorted_slot_.resize_discard(executor, most);
    instance_.resize_discard(executor, most);
    for_each_lanes(
        executor, map.size,
        EmitInstances{grid_, projected_.data(), map.stride, visible_.data(), splat_of_.data(), slot_of_.data(),
                      emit_begin_.data(), tile_slot_.data(), instance_.data(), instances_size()});
    group_by_key(executor, tile_slot_.data(), instances_size(), sorted_slot_.data(), tile_begin_, grid_.count(),
                 scratch_);
  }

  TileGrid grid_;
  CountedLists<Backend, 2> lists_;  ///< splats, instances
  Buffer<View, Backend> view_;
  Buffer<float, Backend> projected_;
  Buffer<Splat, Backend> splats_;
  Buffer<std::uint32_t, Backend> depth_key_;
  Buffer<KeyValue, Backend> tile_slot_;
  Buffer<std::int32_t, Backend> visible_, num_tiles_, splat_of_, slot_of_, gaussian_, slot_begin_, emit_begin_, order_;
  Buffer<std::int32_t, Backend> sorted_slot_, tile_begin_;
  Buffer<Instance, Backend> instance_;
  SortScratch<Backend> scratch_;
};

}  // namespace langgs
