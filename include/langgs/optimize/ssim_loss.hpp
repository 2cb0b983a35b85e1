// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

#include "langgs/optimize/masked_images.hpp"

/// @file 1 - SSIM (Wang et al. 2004) with its gradient: 11x11 Gaussian window, sigma 1.5, zero padding (A.11.3,
/// A.11.7).
///
/// The window is separable. A block owns a tile of 32 columns and 32 rows: it filters the tile and five rows above and
/// below along the rows into shared memory, syncs, and filters that along the columns. The first kernel makes the
/// derivatives of SSIM for the window's moments, the second filters those once more into the gradient. Images are
/// padded with zeros, five rows above and below and at least five columns between one row and the next, so that a
/// filter is the same eleven shifted loads everywhere: no borders, no branches.

namespace langgs {
namespace detail {

inline constexpr int kSsimRadius = 5;
inline constexpr float kSsimC1 = 1e-4f, kSsimC2 = 9e-4f;  // (0.01 L)^2 and (0.03 L)^2 for a dynamic range L = 1

/// Tap i = -5..5 of the normalised Gaussian exp(-i^2 / (2 * 1.5^2)).
[[nodiscard]] LANGGS_INLINE constexpr float ssim_tap(int i) {
  constexpr float kTaps[] = {2.6601172486e-01f, 2.1300553771e-01f, 1.0936068951e-01f,
                             3.6000772128e-02f, 7.5987581352e-03f, 1.0283800845e-03f};
  return kTaps[i < 0 ? -i : i];
}

/// Geometry of the padded planes. The pitch is a multiple of 32, so that 32 lanes never straddle two rows.
struct SsimLayout {
  int width, height, pitch;

  SsimLayout(int w, int h) : width(w), height(h), pitch((w + kSsimRadius + 31) / 32 * 32) {}
  [[nodiscard]] int size() const { return pitch * height; }  ///< without the margins above and below
  /// Zeros before the first image row, and behind the last one: the rows that windows reach, and what the taps left of
  /// the first and right of the last of these touch.
  [[nodiscard]] int margin() const { return pitch * kSsimRadius + 32; }
  [[nodiscard]] std::size_t plane_size() const { return static_cast<std::size_t>(size()) + 2 * margin(); }
  friend bool operator==(const SsimLayout&, const SsimLayout&) = default;

  /// The lanes at the same pixels of an unpadded [height, width] image; without any in the padding.
  template <class Lanes>
  [[nodiscard]] LANGGS_INLINE Lanes unpadded(const Lanes& lanes) const {
    const int row = lanes.first() / pitch, column = lanes.first() - row * pitch;
    const int count = width - column < lanes.count() ? width - column : lanes.count();
    return Lanes(row * width + column, count > 0 ? count : 0);
  }
  /// Mask of the lanes inside the image.
  template <class Lanes>
  [[nodiscard]] LANGGS_INLINE auto inside(const Lanes& lanes) const {
    return lanes.index() < lanes.first() / pitch * pitch + width;
  }
};

/// Copies both images into padded planes: x rendered, y target, zero where masked.
struct SsimPad {
  SsimLayout layout;
  const float* rendered;
  const float* target;
  const float* depth;
  float* x;
  float* y;

  template <class Lanes>
  LANGGS_HD void operator()(const Lanes& lanes) const {
    using V = typename Lanes::template Varying<float>;
    const Lanes pixels = layout.unpadded(lanes);
    if (pixels.count() == 0) return;  // zero since the allocation
    auto valid = layout.inside(lanes);
    if (depth) valid = valid & is_measured(pixels.load(depth));
    lanes.store(x, select(valid, pixels.load(rendered), V(0.f)));
    lanes.store(y, select(valid, pixels.load(target), V(0.f)));
  }
};

/// The tile of a block.
struct SsimTile {
  static constexpr int kRows = 32, kColumns = 32, kThreads = 256;
  static constexpr int kFilteredRows = kRows + 2 * kSsimRadius;
  int row, column;    ///< of its first pixel
  int rows, columns;  ///< inside the image

  LANGGS_INLINE SsimTile(const SsimLayout& layout, int block) {
    const int across = (layout.width + kColumns - 1) / kColumns;
    row = block / across * kRows, column = block % across * kColumns;
    rows = layout.height - row < kRows ? layout.height - row : kRows;
    columns = layout.width - column < kColumns ? layout.width - column : kColumns;
  }
  [[nodiscard]] static int count(const SsimLayout& layout) {
    return ((layout.width + kColumns - 1) / kColumns) * ((layout.height + kRows - 1) / kRows);
  }
  /// `v` in the lanes inside the image, 0 in the others.
  template <class Warp, class V>
  [[nodiscard]] LANGGS_INLINE V inside(const Warp& warp, const V& v) const {
    if (columns == kColumns) return v;
    return select(warp.lane_index() < columns, v, V(0.f));
  }
};

/// One row of a tile: 32 consecutive elements.
template <class Warp>
[[nodiscard]] LANGGS_INLINE auto ssim_load(const Warp& warp, const float* row) {
  return warp.template load_rect<SsimTile::kColumns>(row, 0, SsimTile::kColumns, 1, 0.f);
}

/// The eleven-tap filter along the columns of a tile that was filtered along its rows.
template <class Rows, class Warp>
[[nodiscard]] LANGGS_INLINE auto ssim_filter_columns(const Rows& rows, int row, const Warp& warp) {
  constexpr int kMiddle = kSsimRadius, kWidth = SsimTile::kColumns;
  auto sum = rows.load((row + kMiddle) * kWidth, warp) * ssim_tap(0);
  for (int i = 1; i <= kSsimRadius; ++i)
    sum +=
        (rows.load((row + kMiddle - i) * kWidth, warp) + rows.load((row + kMiddle + i) * kWidth, warp)) * ssim_tap(i);
  return sum;
}

/// Moments of x, y, x^2 + y^2 and xy in each window (SSIM needs the two variances only as their sum), from them SSIM
/// and its derivatives for mean, variance and covariance (A.11.7). sums[block] = the tile's sum of SSIM.
struct SsimDerivatives {
  static constexpr int kThreads = SsimTile::kThreads;
  template <class Block>
  struct Shared {
    static constexpr int kSize = SsimTile::kFilteredRows * SsimTile::kColumns;
    typename Block::template SharedArray<float, kSize> x, y, squares, products;
    typename Block::template SharedArray<float, Block::kWarps> sums;
  };
  SsimLayout layout;
  const float* x;
  const float* y;
  float* by_mean;
  float* by_variance;
  float* by_covariance;
  float* sums;

  template <class Block>
  LANGGS_HD void operator()(Block& block, Shared<Block>& shared) const {
    using V = typename Block::template Varying<float>;
    const SsimTile tile(layout, block.index());
    block.warps([&](const auto& warp) {
      for (int r = warp.index(); r < tile.rows + 2 * kSsimRadius; r += Block::kWarps) {
        const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(tile.row + r - kSsimRadius) * layout.pitch + tile.column;
        V mx(0.f), my(0.f), squares(0.f), products(0.f);
        for (int i = -kSsimRadius; i <= kSsimRadius; ++i) {
          const V a = ssim_load(warp, x + at + i), b = ssim_load(warp, y + at + i);
          const V wa = a * ssim_tap(i), wb = b * ssim_tap(i);
          mx += wa;
          my += wb;
          squares += wa * a + wb * b;
          products += wa * b;
        }
        shared.x.store(r * SsimTile::kColumns, mx, warp);
        shared.y.store(r * SsimTile::kColumns, my, warp);
        shared.squares.store(r * SsimTile::kColumns, squares, warp);
        shared.products.store(r * SsimTile::kColumns, products, warp);
      }
    });
    block.sync();
    block.warps([&](const auto& warp) {
      V sum(0.f);
      for (int r = warp.index(); r < tile.rows; r += Block::kWarps) {
        const V mx = ssim_filter_columns(shared.x, r, warp), my = ssim_filter_columns(shared.y, r, warp);
        const V mxmy = mx * my, mean_squares = mx * mx + my * my;
        const V a = mxmy * 2.f + kSsimC1, b = (ssim_filter_columns(shared.products, r, warp) - mxmy) * 2.f + kSsimC2;
        const V c = mean_squares + kSsimC1;
        const V d = max(ssim_filter_columns(shared.squares, r, warp) - mean_squares, 0.f) + kSsimC2;
        const V inverse = 1.f / (c * d);
        const V ssim = a * b * inverse;
        const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(tile.row + r) * layout.pitch + tile.column;
        const V mean_part = (my * (b - a) + mx * ssim * (c - d)) * inverse * 2.f;
        store(warp, by_mean + at, tile.inside(warp, mean_part));
        store(warp, by_variance + at, tile.inside(warp, -(ssim * c * inverse)));
        store(warp, by_covariance + at, tile.inside(warp, a * inverse * 2.f));
        sum += tile.inside(warp, ssim);
      }
      shared.sums.set(warp.index(), warp.sum(sum));
    });
    block.sync();
    block.threads([&](auto thread) {
      if (thread.index != 0) return;
      float sum = 0;
      for (int w = 0; w < Block::kWarps; ++w) sum += shared.sums[w];
      sums[block.index()] = sum;
    });
  }

 private:
  template <class Warp, class V>
  LANGGS_INLINE static void store(const Warp& warp, float* to, const V& v) {
    warp.template store_rect<SsimTile::kColumns>(to, 0, SsimTile::kColumns, 1, v);
  }
};

/// Filters the derivatives and applies the chain rule to the rendered image; adds to the gradient of unmasked pixels.
struct SsimGradient {
  static constexpr int kThreads = SsimTile::kThreads;
  template <class Block>
  struct Shared {
    static constexpr int kSize = SsimTile::kFilteredRows * SsimTile::kColumns;
    typename Block::template SharedArray<float, kSize> by_mean, by_variance, by_covariance;
  };
  SsimLayout layout;
  const float* x;
  const float* y;
  const float* by_mean;
  const float* by_variance;
  const float* by_covariance;
  const float* depth;
  float scale;
  float* gradient;

  template <class Block>
  LANGGS_HD void operator()(Block& block, Shared<Block>& shared) const {
    using V = typename Block::template Varying<float>;
    constexpr int kColumns = SsimTile::kColumns;
    const SsimTile tile(layout, block.index());
    block.warps([&](const auto& warp) {
      for (int r = warp.index(); r < tile.rows + 2 * kSsimRadius; r += Block::kWarps) {
        const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(tile.row + r - kSsimRadius) * layout.pitch + tile.column;
        shared.by_mean.store(r * kColumns, filter_row(warp, by_mean + at), warp);
        shared.by_variance.store(r * kColumns, filter_row(warp, by_variance + at), warp);
        shared.by_covariance.store(r * kColumns, filter_row(warp, by_covariance + at), warp);
      }
    });
    block.sync();
    block.warps([&](const auto& warp) {
      for (int r = warp.index(); r < tile.rows; r += Block::kWarps) {
        const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(tile.row + r) * layout.pitch + tile.column;
        const std::ptrdiff_t pixel = static_cast<std::ptrdiff_t>(tile.row + r) * layout.width + tile.column;
        V g = ssim_filter_columns(shared.by_mean, r, warp);
        g += ssim_load(warp, x + at) * 2.f * ssim_filter_columns(shared.by_variance, r, warp);
        g += ssim_load(warp, y + at) * ssim_filter_columns(shared.by_covariance, r, warp);
        if (depth) {
          const V measured = warp.template load_rect<kColumns>(depth + pixel, 0, tile.columns, 1, 0.f);
          g = select(is_measured(measured), g, V(0.f));
        }
        const V before = warp.template load_rect<kColumns>(gradient + pixel, 0, tile.columns, 1, 0.f);
        warp.template store_rect<kColumns>(gradient + pixel, 0, tile.columns, 1, before + g * scale);
      }
    });
  }

 private:
  template <class Warp>
  [[nodiscard]] LANGGS_INLINE static auto filter_row(const Warp& warp, const float* row) {
    auto sum = ssim_load(warp, row) * ssim_tap(0);
    for (int i = 1; i <= kSsimRadius; ++i) sum += (ssim_load(warp, row - i) + ssim_load(warp, row + i)) * ssim_tap(i);
    return sum;
  }
};

}  // namespace detail

/// 1 - SSIM, mean over all planes and pixels: the second term of L_geo as the backbone and 3DGS have it. (The paper's
/// equation repeats the L1 term there, which would leave lambda_1 without effect.) Masked pixels are zero in both
/// images; they get no gradient, but their windows count.
template <class Backend = Host>
class SsimLoss {
 public:
  /// Returns the loss; adds weight * d loss / d rendered to `gradient` [planes, height, width].
  double evaluate(const Executor<Backend>& executor, const MaskedImages& images, float weight, float* gradient) {
    validate(images);
    resize(detail::SsimLayout(images.width, images.height));
    const int n = images.num_pixels();
    const double count = static_cast<double>(n) * images.planes;
    const auto scale = static_cast<float>(-weight / count);
    const int num_tiles = detail::SsimTile::count(layout_);
    float *const x = plane(0), *const y = plane(1);
    float *const by_mean = plane(2), *const by_variance = plane(3), *const by_covariance = plane(4);
    double sum = 0;
    for (int p = 0; p < images.planes; ++p) {
      const std::ptrdiff_t offset = static_cast<std::ptrdiff_t>(p) * n;
      for_each_lanes(executor, layout_.size(),
                     detail::SsimPad{layout_, images.rendered + offset, images.target + offset, images.depth, x, y});
      launch(executor, num_tiles,
             detail::SsimDerivatives{layout_, x, y, by_mean, by_variance, by_covariance, sums_.data()});
      launch(executor, num_tiles,
             detail::SsimGradient{layout_, x, y, by_mean, by_variance, by_covariance, images.depth, scale,
                                  gradient + offset});
      for (int t = 0; t < num_tiles; ++t) sum += static_cast<double>(sums_.data()[t]);
    }
    return 1.0 - sum / count;
  }

 private:
  void resize(const detail::SsimLayout& layout) {
    if (layout == layout_) return;
    layout_ = layout;
    planes_.resize_discard(layout.plane_size() * kNumPlanes);
    planes_.fill(0.f);  // the margins stay zero: no kernel writes them
    sums_.resize_discard(detail::SsimTile::count(layout));
  }
  /// First image row of a padded plane.
  [[nodiscard]] float* plane(int i) { return planes_.data() + layout_.plane_size() * i + layout_.margin(); }

  static constexpr int kNumPlanes = 5;
  detail::SsimLayout layout_{0, 0};
  Buffer<float, Backend> planes_, sums_;
};

}  // namespace langgs
