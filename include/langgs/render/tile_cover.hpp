// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "langgs/core/config.hpp"
#include "langgs/device/block.hpp"
#include "langgs/device/math.hpp"
#include "langgs/render/tiles.hpp"

/// @file Which tiles, and which of their warps, a splat reaches, lane by lane.

namespace langgs {

/// The ellipse of a splat and the box around it (per lane), named as in Splat.
template <class F>
struct SplatOutline {
  F x, y, half_xx, xy, half_yy, log_opacity, half_width, half_height;
};

/// One column of tiles: the warps that the ellipse reaches in it, and the tiles that they lie in (per lane).
template <class Int>
struct TileColumn {
  Int first_tile_row, num_tiles;  ///< no tiles where nothing is reached
  Int first_warp, last_warp;      ///< counted from the top of the image

  /// The warps within the tile of a row; every tile of the column has at least one.
  LANGGS_INLINE Int first_warp_of(const Int& tile_row) const { return max(first_warp - kWarps * tile_row, 0); }
  LANGGS_INLINE Int last_warp_of(const Int& tile_row) const { return min(last_warp - kWarps * tile_row, kWarps - 1); }

 private:
  static constexpr int kWarps = TileGrid::kSize / TileGrid::kRowsPerWarp;
};

/// The tiles that the ellipses of some splats reach. Exact where it can be; where an ellipse leaves its column of tiles
/// through a corner of its box, or a number is rounded, never too few.
template <class Lanes>
class TileCover {
  using F = VaryingOf<float, Lanes>;
  using Int = VaryingOf<std::int32_t, Lanes>;
  using Mask = typename Lanes::Mask;

 public:
  LANGGS_INLINE TileCover(const Lanes& lanes, const SplatOutline<F>& s, const TileGrid& grid, const Mask& wanted)
      : lanes_(lanes), x_(s.x), y_(s.y) {
    range(s.x, s.half_width, grid.width, first_column_, last_column_);
    range(s.y, s.half_height, grid.height, first_row_, last_row_);
    first_tile_column_ = lanes.truncate(first_column_ * (1.f / TileGrid::kSize));
    const Int beyond = lanes.truncate(last_column_ * (1.f / TileGrid::kSize)) + 1;
    const auto some = wanted & (first_column_ <= last_column_) & (first_row_ <= last_row_);
    num_columns_ = select(some, beyond - first_tile_column_, Int(0));
    // q(u, v) = half_xx u^2 + xy u v + half_yy v^2 <= level, solved for v; u = half_width touches the ellipse.
    slope_ = -0.5f * s.xy / s.half_yy;
    highest_at_ = -0.5f * s.xy / s.half_xx * s.half_height;
    span_ = sqrt(1.001f * (s.log_opacity - Footprint<float>::kMinLog) / s.half_yy);
    inverse_width_ = 1.f / s.half_width;
  }
  /// Of tiles; 0 for a splat between two pixel centres and for one that is not wanted.
  [[nodiscard]] LANGGS_INLINE const Int& num_columns() const { return num_columns_; }
  /// Of the whole grid: where the k-th column of a splat lies.
  [[nodiscard]] LANGGS_INLINE Int tile_column(int k) const { return first_tile_column_ + k; }

  [[nodiscard]] LANGGS_INLINE TileColumn<Int> column(int k) const {
    const F left_edge = to_float(tile_column(k)) * static_cast<float>(TileGrid::kSize);
    const F left = max(left_edge, first_column_) - x_;
    const F right = min(left_edge + static_cast<float>(TileGrid::kSize - 1), last_column_) - x_;
    const F first_row = ceil_or_less(min(max(y_ + edge(left, right, -1.f), first_row_), kMostPixels));
    const F last_row = floor_or_more(max(min(y_ + edge(left, right, 1.f), last_row_), -1.f));
    TileColumn<Int> result;
    result.first_warp = lanes_.truncate(first_row * (1.f / TileGrid::kRowsPerWarp));
    result.last_warp = lanes_.truncate(last_row * (1.f / TileGrid::kRowsPerWarp));
    result.first_tile_row = lanes_.truncate(first_row * (1.f / TileGrid::kSize));
    const Int beyond = lanes_.truncate(last_row * (1.f / TileGrid::kSize)) + 1;
    result.num_tiles = select((num_columns_ > k) & (first_row <= last_row), beyond - result.first_tile_row, Int(0));
    return result;
  }

 private:
  static constexpr float kMostPixels = 65535.f;

  /// floor(v) for v in [-1, 65535], at most one more: what is rounded away makes a box larger, never smaller.
  [[nodiscard]] LANGGS_INLINE F floor_or_more(const F& v) const { return to_float(lanes_.truncate(v + 1.f)) - 1.f; }
  /// ceil(v) for v in [-1, 65535], at most one less.
  [[nodiscard]] LANGGS_INLINE F ceil_or_less(const F& v) const {
    return 65536.f - to_float(lanes_.truncate(65536.f - v));
  }
  /// The pixels whose centres lie in [centre - half, centre + half], as whole numbers.
  LANGGS_INLINE void range(const F& centre, const F& half, int size, F& first, F& last) const {
    const float limit = static_cast<float>(size - 1);
    first = ceil_or_less(min(max(centre - half, 0.f), limit));
    last = floor_or_more(max(min(centre + half, limit), 0.f));
  }
  /// The extreme v of the side (1: largest, -1: smallest) for u in [left, right].
  [[nodiscard]] LANGGS_INLINE F edge(const F& left, const F& right, float side) const {
    const F u = min(max(side * highest_at_, left), right), share = u * inverse_width_;
    return slope_ * u + side * span_ * sqrt(max(1.f - share * share, 0.f));
  }

  const Lanes& lanes_;
  F x_, y_;
  F first_column_, last_column_, first_row_, last_row_;  // [px], inclusive
  Int first_tile_column_, num_columns_;
  F slope_, highest_at_, span_, inverse_width_;
};

}  // namespace langgs
