// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

#include "langgs/optimize/masked_images.hpp"
#include "langgs/optimize/ssim_window.hpp"

/// @file L1 and 1 - SSIM (Wang et al. 2004) of two colour images, with the gradient (A.11.2, A.11.3, A.11.7).
///
/// Both terms are functions of the sum u = x + y and the difference v = x - y of rendered x and target y:
///   4 mx my         = mu^2 - mv^2        4 cov(x, y)         = var u - var v
///   2 (mx^2 + my^2) = mu^2 + mv^2        2 (var x + var y)   = var u + var v
/// so that a window's moments are means and squares of two images, without products between them.

namespace langgs {
namespace detail {

inline constexpr float kSsimC1 = 1e-4f, kSsimC2 = 9e-4f;  // (0.01 L)^2 and (0.03 L)^2 for a dynamic range L = 1

/// The part of an image plane that a block owns; blocks are numbered by plane, then by strip.
struct ColourStrip {
  static constexpr int kRows = 160;
  int plane;
  int row, column;  ///< of its first pixel
  int rows, columns;

  LANGGS_INLINE ColourStrip(const MaskedImages& images, int block) {
    const int across = (images.width + kSsimColumns - 1) / kSsimColumns;
    plane = block / count(images);
    const int strip = block - plane * count(images);
    row = strip / across * kRows, column = strip % across * kSsimColumns;
    rows = images.height - row < kRows ? images.height - row : kRows;
    columns = images.width - column < kSsimColumns ? images.width - column : kSsimColumns;
  }
  /// Strips of a plane.
  [[nodiscard]] LANGGS_INLINE static int count(const MaskedImages& images) {
    return ((images.width + kSsimColumns - 1) / kSsimColumns) * ((images.height + kRows - 1) / kRows);
  }
};

/// The colour loss and its gradient. sums[2 block] and sums[2 block + 1] are the strip's sums of SSIM and |x - y|.
///
/// Rows count from 0 at ten rows above the strip. In the step at row `top`, rows top .. top + 7 are read, windows are
/// complete for the rows from top - 5 on, and the gradient for those from top - 10 on.
struct ColourKernel {
  static constexpr int kThreads = 32 * kSsimStep;
  template <class Block>
  struct Shared {
    SsimRows<Block, kSsimReadColumns> u, v;
    SsimRing<Block> mean_u, mean_v, square_u, square_v;
    SsimRows<Block, kSsimWindows> by_mean, by_uu, by_vv;
    SsimRing<Block> filtered_by_mean, filtered_by_uu, filtered_by_vv;
    BlockSum<Block> ssim, l1;
  };
  MaskedImages images;
  float ssim_scale, l1_scale;
  float* gradient;
  float* sums;

  template <class Block>
  LANGGS_HD void operator()(Block& block, Shared<Block>& shared) const {
    using V = typename Block::template Varying<float>;
    const ColourStrip strip(images, block.index());
    typename Block::template PerThread<float> ssim, l1;
    block.warps([&](const auto& warp) {
      ssim.store(warp, V(0.f));
      l1.store(warp, V(0.f));
    });
    for (auto* rows : {&shared.by_mean, &shared.by_uu, &shared.by_vv}) rows->clear_tail(block);
    for (int top = 0; top < strip.rows + 4 * kSsimRadius; top += kSsimStep) {
      block.warps([&](const auto& warp) { read<V>(warp, strip, top + warp.index(), shared); });
      block.sync();
      block.warps([&](const auto& warp) { filter<V>(warp, top + warp.index(), shared); });
      block.sync();
      block.warps([&](const auto& warp) {
        const int row = top + warp.index() - kSsimRadius;
        if (row < kSsimRadius || row >= strip.rows + 3 * kSsimRadius) return;
        ssim.store(warp, ssim.load(warp) + differentiate<V>(warp, strip, row, shared));
      });
      block.sync();
      block.warps([&](const auto& warp) {
        const int row = top + warp.index() - kSsimRadius;
        if (row >= kSsimRadius) filter_derivatives<V>(warp, row, shared);
      });
      block.sync();
      block.warps([&](const auto& warp) {
        const int row = top + warp.index() - 2 * kSsimRadius;
        if (row < 2 * kSsimRadius || row >= strip.rows + 2 * kSsimRadius) return;
        l1.store(warp, l1.load(warp) + write<V>(warp, strip, row, shared));
      });
    }
    block.warps([&](const auto& warp) {
      shared.ssim.parts.set(warp.index(), warp.sum(ssim.load(warp)));
      shared.l1.parts.set(warp.index(), warp.sum(l1.load(warp)));
    });
    shared.ssim.write(block, sums + 2 * block.index());
    shared.l1.write(block, sums + 2 * block.index() + 1);
  }

 private:
  /// x + y and x - y of a row, from ten columns left of the strip on; zero where masked and outside of the image.
  template <class V, class Warp, class Shared>
  LANGGS_INLINE void read(const Warp& warp, const ColourStrip& strip, int row, Shared& shared) const {
    const int image_row = strip.row + row - 2 * kSsimRadius;
    const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(image_row) * images.width;
    const std::ptrdiff_t plane = static_cast<std::ptrdiff_t>(strip.plane) * images.num_pixels();
    for (int first = 0; first < kSsimReadColumns; first += 32) {
      V u(0.f), v(0.f);
      const int column = strip.column + first - 2 * kSsimRadius;
      if (image_row >= 0 && image_row < images.height && column < images.width) {
        const auto index = warp.lane_index() + column;
        auto valid = (index >= 0) & (index < images.width);
        if (images.depth) valid = valid & is_measured(load_row<V>(warp, images.depth, at, column));
        const V x = load_row<V>(warp, images.rendered + plane, at, column);
        const V y = load_row<V>(warp, images.target + plane, at, column);
        u = select(valid, x + y, 0.f), v = select(valid, x - y, 0.f);
      }
      shared.u.store(warp, first, u);
      shared.v.store(warp, first, v);
    }
  }

  /// image[row_begin + column] from a column on that may lie left of the image; asks for the next step's, too.
  template <class V, class Warp>
  [[nodiscard]] LANGGS_INLINE V load_row(const Warp& warp, const float* image, std::ptrdiff_t row_begin,
                                         int column) const {
    const float* row = image + row_begin;
    warp.prefetch(row + column + kSsimStep * images.width, 32 * sizeof(float));
    if (row_begin + column >= 0) return warp.load(row + column);  // left of a row lies the one above
    const auto index = warp.lane_index() + column;
    return warp.gather(row, index, index >= 0, 0.f);
  }

  /// Means and mean squares along a row.
  template <class V, class Warp, class Shared>
  LANGGS_INLINE static void filter(const Warp& warp, int row, Shared& shared) {
    for (int column = 0; column < kSsimWindows; column += 32) {
      V mean, square;
      shared.u.filter(warp, column, mean, square);
      shared.mean_u.store(warp, row, column, mean);
      shared.square_u.store(warp, row, column, square);
      shared.v.filter(warp, column, mean, square);
      shared.mean_v.store(warp, row, column, mean);
      shared.square_v.store(warp, row, column, square);
    }
  }

  /// SSIM of the windows around a row and its derivatives by E[x] / 2, E[u^2] and E[v^2]; returns SSIM in the strip.
  template <class V, class Warp, class Shared>
  [[nodiscard]] LANGGS_INLINE V differentiate(const Warp& warp, const ColourStrip& strip, int row,
                                              Shared& shared) const {
    const int image_row = strip.row + row - 2 * kSsimRadius;
    V sum(0.f);
    for (int first = 0; first < kSsimWindows; first += 32) {
      const V mu = shared.mean_u.template filter<V>(warp, row, first),
              mv = shared.mean_v.template filter<V>(warp, row, first);
      const V var_u = max(shared.square_u.template filter<V>(warp, row, first) - mu * mu, 0.f);
      const V var_v = max(shared.square_v.template filter<V>(warp, row, first) - mv * mv, 0.f);
      const V mu2 = mu * mu + 2 * kSsimC1;
      const V a = mu2 - mv * mv, b = var_u - var_v + 2 * kSsimC2;
      const V c = mu2 + mv * mv, d = var_u + var_v + 2 * kSsimC2;
      const V inverse = 1.f / (c * d);
      const V ssim = a * b * inverse, ssim_c = ssim * c;
      V by_mean = ((mu - mv) * (b - a)) * inverse;
      by_mean += (mu + mv) * (ssim * (c - d) * inverse);
      // Windows are centred in the image.
      const auto column = warp.lane_index() + (strip.column + first - kSsimRadius);
      const auto inside = (column >= 0) & (column < (image_row >= 0 && image_row < images.height ? images.width : 0));
      shared.by_mean.store(warp, first, select(inside, by_mean, 0.f));
      shared.by_uu.store(warp, first, select(inside, (a - ssim_c) * inverse, 0.f));
      shared.by_vv.store(warp, first, select(inside, -(a + ssim_c) * inverse, 0.f));
      const auto mine = (column >= strip.column) & (column < strip.column + strip.columns);
      if (row >= 2 * kSsimRadius && row < strip.rows + 2 * kSsimRadius) sum += select(mine, ssim, 0.f);
    }
    return sum;
  }

  /// The gradient of a window goes to all its pixels: the same filter once more.
  template <class V, class Warp, class Shared>
  LANGGS_INLINE static void filter_derivatives(const Warp& warp, int row, Shared& shared) {
    for (int column = 0; column < kSsimWindows; column += 32) {
      shared.filtered_by_mean.store(warp, row, column, shared.by_mean.template filter<V>(warp, column));
      shared.filtered_by_uu.store(warp, row, column, shared.by_uu.template filter<V>(warp, column));
      shared.filtered_by_vv.store(warp, row, column, shared.by_vv.template filter<V>(warp, column));
    }
  }

  /// Carries a row of derivatives to the rendered image, adds the gradient of L1 and writes; returns |x - y|.
  template <class V, class Warp, class Shared>
  [[nodiscard]] LANGGS_INLINE V write(const Warp& warp, const ColourStrip& strip, int row, const Shared& shared) const {
    const std::ptrdiff_t pixel =
        static_cast<std::ptrdiff_t>(strip.row + row - 2 * kSsimRadius) * images.width + strip.column;
    V sum(0.f);
    for (int done = 0; done < strip.columns; done += 32) {
      // The last 32 columns overlap those before them, and write the same there once more.
      const int first = strip.columns >= 32 && strip.columns - done < 32 ? strip.columns - 32 : done;
      const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(strip.plane) * images.num_pixels() + pixel + first;
      const V x = warp.load(images.rendered + at), y = warp.load(images.target + at);
      auto valid = warp.lane_index() < strip.columns - first;
      if (images.depth) valid = valid & is_measured(warp.load(images.depth + pixel + first));
      const V difference = select(valid, x - y, 0.f);
      V g = shared.filtered_by_mean.template filter<V>(warp, row, first);
      g += (x + y) * shared.filtered_by_uu.template filter<V>(warp, row, first);
      g += difference * shared.filtered_by_vv.template filter<V>(warp, row, first);
      g = select(valid, g * ssim_scale, 0.f) + l1_gradient(difference, l1_scale);
      if (strip.columns >= 32)
        warp.store(gradient + at, g);
      else
        warp.template store_rect<32>(gradient + at, 0, strip.columns, 1, g);
      sum += select(warp.lane_index() >= done - first, abs(difference), 0.f);
    }
    return sum;
  }
};

}  // namespace detail

/// The colour terms of L_geo: (1 - ssim_weight) L1 + ssim_weight (1 - SSIM), as the backbone and 3DGS have it. (The
/// paper's equation repeats the L1 term for SSIM, which would leave lambda_1 without effect.)
/// Masked pixels are zero in both images and get no gradient, but their windows count. Both means are over all planes
/// and pixels, as in the backbone: dividing by the number of measured pixels instead would give those of a frame with
/// little depth more weight than others'.
template <class Backend = Host>
class ColourLoss {
 public:
  struct Terms {
    double l1, dssim;  ///< mean |x - y| and 1 - mean SSIM
  };

  /// Writes the gradient by `rendered` to `gradient` [planes, height, width]; `terms` are known later.
  void start(const Executor<Backend>& executor, const MaskedImages& images, float ssim_weight, float* gradient) {
    validate(images);
    count_ = static_cast<double>(images.num_pixels()) * images.planes;
    const auto ssim_scale = static_cast<float>(-2 * ssim_weight / count_);
    const auto l1_scale = static_cast<float>((1 - static_cast<double>(ssim_weight)) / count_);
    const int num_blocks = detail::ColourStrip::count(images) * images.planes;
    sums_.resize_discard(executor, 2 * static_cast<std::size_t>(num_blocks));
    launch(executor, num_blocks, detail::ColourKernel{images, ssim_scale, l1_scale, gradient, sums_.data()});
    read_sums_.start(executor, sums_.data(), sums_.size());
  }
  /// The terms of the last `start`, before their weights; waits for them.
  [[nodiscard]] Terms terms() const {
    const float* const sums = read_sums_.values();
    double ssim = 0, l1 = 0;
    for (std::size_t i = 0; i < read_sums_.size(); i += 2) {
      ssim += static_cast<double>(sums[i]);
      l1 += static_cast<double>(sums[i + 1]);
    }
    return {l1 / count_, 1 - ssim / count_};
  }

 private:
  double count_ = 0;
  Buffer<float, Backend> sums_;
  Readback<float, Backend> read_sums_;
};

}  // namespace langgs
