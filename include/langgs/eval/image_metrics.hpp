// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <optional>
#include <vector>

#include "langgs/core/error.hpp"
#include "langgs/core/image.hpp"

/// @file Image quality. Colours are clamped to [0, 1] first; a value that is NaN counts as 0.

namespace langgs {

namespace detail {

[[nodiscard]] inline float unit_clamped(float value) { return value > 0 ? (value < 1 ? value : 1.f) : 0.f; }

inline void expect_same_shape(const Image<float>& a, const Image<float>& b) {
  LANGGS_EXPECTS(!a.empty() && a.width() == b.width() && a.height() == b.height() && a.channels() == b.channels(),
                 "images are [", a.height(), ", ", a.width(), ", ", a.channels(), "] and [", b.height(), ", ",
                 b.width(), ", ", b.channels(), "]; they must have one shape and not be empty");
}

[[nodiscard]] inline bool is_valid_depth(float depth) { return depth > 0 && std::isfinite(depth); }

[[nodiscard]] inline double psnr_of_mse(double mse) {
  constexpr double kSmallestMse = 1e-10;  // 100 dB: identical images get a number that can be averaged and written down
  return -10 * std::log10(mse > kSmallestMse ? mse : kSmallestMse);
}

/// The 11 taps of a Gaussian with sigma 1.5, sum 1.
[[nodiscard]] inline std::array<float, 11> ssim_taps() {
  std::array<double, 11> weight{};
  double sum = 0;
  for (int i = 0; i < 11; ++i) sum += weight[i] = std::exp(-(i - 5) * (i - 5) / (2 * 1.5 * 1.5));
  std::array<float, 11> taps{};
  for (int i = 0; i < 11; ++i) taps[i] = static_cast<float>(weight[i] / sum);
  return taps;
}

}  // namespace detail

/// Protocol `psnr_all`: PSNR [dB] over all pixels and channels of two [H, W, C] images in [0, 1]; at most 100.
[[nodiscard]] inline double psnr_all(const Image<float>& rendered, const Image<float>& measured) {
  detail::expect_same_shape(rendered, measured);
  double sum = 0;
  for (std::size_t i = 0; i < rendered.size(); ++i) {
    const double d = double{detail::unit_clamped(rendered.data()[i])} - detail::unit_clamped(measured.data()[i]);
    sum += d * d;
  }
  return detail::psnr_of_mse(sum / static_cast<double>(rendered.size()));
}

/// Protocol `psnr_valid_depth`: PSNR [dB] over the pixels whose measured `depth` [H, W] is positive, averaged over just
/// these (counting the others as perfect would inflate it); at most 100. Nothing if no pixel has a depth.
[[nodiscard]] inline std::optional<double> psnr_valid_depth(const Image<float>& rendered, const Image<float>& measured,
                                                            const Image<float>& depth) {
  detail::expect_same_shape(rendered, measured);
  LANGGS_EXPECTS(depth.width() == rendered.width() && depth.height() == rendered.height() && depth.channels() == 1,
                 "depth is [", depth.height(), ", ", depth.width(), ", ", depth.channels(), "] but the images are [",
                 rendered.height(), ", ", rendered.width(), ", ", rendered.channels(), "]; they must match");
  const int channels = rendered.channels();
  double sum = 0;
  std::size_t count = 0;
  for (std::size_t pixel = 0; pixel < depth.size(); ++pixel) {
    if (!detail::is_valid_depth(depth.data()[pixel])) continue;
    for (int c = 0; c < channels; ++c) {
      const std::size_t i = pixel * channels + c;
      const double d = double{detail::unit_clamped(rendered.data()[i])} - detail::unit_clamped(measured.data()[i]);
      sum += d * d;
    }
    count += channels;
  }
  if (count == 0) return std::nullopt;
  return detail::psnr_of_mse(sum / static_cast<double>(count));
}

/// Mean |rendered - measured| [m] over the pixels of two [H, W] depth images that were measured (> 0 and finite).
/// A rendered depth that is not finite counts as 0. Nothing if no pixel was measured.
[[nodiscard]] inline std::optional<double> depth_l1(const Image<float>& rendered, const Image<float>& measured) {
  detail::expect_same_shape(rendered, measured);
  double sum = 0;
  std::size_t count = 0;
  for (std::size_t i = 0; i < measured.size(); ++i) {
    if (!detail::is_valid_depth(measured.data()[i])) continue;
    const float value = rendered.data()[i];
    sum += std::abs((std::isfinite(value) ? double{value} : 0.0) - measured.data()[i]);
    ++count;
  }
  if (count == 0) return std::nullopt;
  return sum / static_cast<double>(count);
}

/// Protocol `ssim_11_gauss`: structural similarity (Wang et al. 2004) of two [H, W, C] images in [0, 1] with an 11x11
/// Gaussian window (sigma 1.5), zero padding, C1 = 0.01^2, C2 = 0.03^2; mean over pixels and channels.
[[nodiscard]] inline double ssim_11_gauss(const Image<float>& rendered, const Image<float>& measured) {
  detail::expect_same_shape(rendered, measured);
  constexpr int kRadius = 5, kTaps = 11;
  constexpr float kC1 = 1e-4f, kC2 = 9e-4f;
  const std::array<float, kTaps> g = detail::ssim_taps();
  const int channels = rendered.channels();
  const std::size_t length = static_cast<std::size_t>(rendered.width()) * channels;
  const std::size_t border = static_cast<std::size_t>(kRadius) * channels;

  // Channels stay interleaved: the neighbour in x is `channels` values away, and every loop runs over a whole row.
  std::vector<float> x(length + 2 * border), y(length + 2 * border), product(length + 2 * border), ssim(length);
  // Rows filtered in x, kept for the eleven rows that the filter in y spans: means of x, y, xx, yy, xy.
  using Moments = std::array<std::vector<float>, 5>;
  std::array<Moments, kTaps> ring;
  for (Moments& row : ring) row.fill(std::vector<float>(length));
  Moments mean;
  mean.fill(std::vector<float>(length));

  const auto filter_in_x = [&](const float* source, float* out) {
    for (std::size_t i = 0; i < length; ++i) {
      const float* s = source + i;
      float sum = g[kRadius] * s[border];
      for (int k = 0; k < kRadius; ++k) sum += g[k] * (s[k * channels] + s[(kTaps - 1 - k) * channels]);
      out[i] = sum;
    }
  };
  const auto filter_product_in_x = [&](const std::vector<float>& a, const std::vector<float>& b, float* out) {
    for (std::size_t i = 0; i < product.size(); ++i) product[i] = a[i] * b[i];
    filter_in_x(product.data(), out);
  };

  double total = 0;
  for (int row = 0; row < rendered.height() + kRadius; ++row) {
    Moments& slot = ring[row % kTaps];
    if (row < rendered.height()) {
      const std::size_t offset = static_cast<std::size_t>(row) * length;
      for (std::size_t i = 0; i < length; ++i) {
        x[border + i] = detail::unit_clamped(rendered.data()[offset + i]);
        y[border + i] = detail::unit_clamped(measured.data()[offset + i]);
      }
      filter_in_x(x.data(), slot[0].data());
      filter_in_x(y.data(), slot[1].data());
      filter_product_in_x(x, x, slot[2].data());
      filter_product_in_x(y, y, slot[3].data());
      filter_product_in_x(x, y, slot[4].data());
    } else {
      for (std::vector<float>& moment : slot) moment.assign(length, 0.f);
    }
    const int centre = row - kRadius;
    if (centre < 0) continue;
    for (int m = 0; m < 5; ++m) {
      std::array<const float*, kTaps> rows;  // the rows before the first one are slots that still hold zeros
      for (int k = 0; k < kTaps; ++k) rows[k] = ring[(centre + k - kRadius + kTaps) % kTaps][m].data();
      float* out = mean[m].data();
      for (std::size_t i = 0; i < length; ++i) {
        float sum = g[kRadius] * rows[kRadius][i];
        for (int k = 0; k < kRadius; ++k) sum += g[k] * (rows[k][i] + rows[kTaps - 1 - k][i]);
        out[i] = sum;
      }
    }
    for (std::size_t i = 0; i < length; ++i) {
      const float mx = mean[0][i], my = mean[1][i];
      const float vx = mean[2][i] - mx * mx, vy = mean[3][i] - my * my, vxy = mean[4][i] - mx * my;
      ssim[i] = (2 * mx * my + kC1) * (2 * vxy + kC2) / ((mx * mx + my * my + kC1) * (vx + vy + kC2));
    }
    for (const float value : ssim) total += value;
  }
  return total / static_cast<double>(rendered.size());
}

}  // namespace langgs
