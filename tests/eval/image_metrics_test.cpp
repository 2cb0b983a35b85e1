// SPDX-License-Identifier: Apache-2.0
#include "langgs/eval/image_metrics.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>

using namespace langgs;

namespace {

/// Deterministic noise on a gradient, in [0, 1].
Image<float> noisy(int width, int height, int channels, std::uint32_t seed, float noise) {
  Image<float> image(width, height, channels);
  for (std::size_t i = 0; i < image.size(); ++i) {
    seed = seed * 1664525u + 1013904223u;
    const float gradient = static_cast<float>(i % 97) / 97.f;
    image.data()[i] = (1 - noise) * gradient + noise * static_cast<float>(seed >> 8) / 16777216.f;
  }
  return image;
}

/// SSIM by its definition: a 2D window around each pixel, zeros outside, in double.
double naive_ssim(const Image<float>& a, const Image<float>& b) {
  double window[11][11], norm = 0, total = 0;
  for (int j = 0; j < 11; ++j)
    for (int i = 0; i < 11; ++i)
      norm += window[j][i] = std::exp(-((i - 5) * (i - 5) + (j - 5) * (j - 5)) / (2 * 1.5 * 1.5));
  for (int c = 0; c < a.channels(); ++c)
    for (int y = 0; y < a.height(); ++y)
      for (int x = 0; x < a.width(); ++x) {
        double ma = 0, mb = 0, aa = 0, bb = 0, ab = 0;
        for (int j = 0; j < 11; ++j)
          for (int i = 0; i < 11; ++i) {
            const int u = x + i - 5, v = y + j - 5;
            if (u < 0 || v < 0 || u >= a.width() || v >= a.height()) continue;
            const double w = window[j][i] / norm, p = a(u, v, c), q = b(u, v, c);
            ma += w * p;
            mb += w * q;
            aa += w * p * p;
            bb += w * q * q;
            ab += w * p * q;
          }
        total += (2 * ma * mb + 1e-4) * (2 * (ab - ma * mb) + 9e-4) /
                 ((ma * ma + mb * mb + 1e-4) * (aa - ma * ma + bb - mb * mb + 9e-4));
      }
  return total / static_cast<double>(a.size());
}

const float kNan = std::numeric_limits<float>::quiet_NaN();
const float kInf = std::numeric_limits<float>::infinity();

}  // namespace

TEST_CASE("psnr_all: known errors") {
  const Image<float> grey(8, 4, 3, 0.5f), lighter(8, 4, 3, 0.6f), black(8, 4, 3, 0.f), white(8, 4, 3, 1.f);
  CHECK(psnr_all(grey, lighter) == doctest::Approx(20.0).epsilon(1e-5));
  CHECK(psnr_all(black, white) == doctest::Approx(0.0));
  CHECK(psnr_all(grey, grey) == 100.0);
  // Values outside [0, 1] are clamped first; NaN counts as black.
  CHECK(psnr_all(Image<float>(8, 4, 3, 7.f), white) == 100.0);
  CHECK(psnr_all(Image<float>(8, 4, 3, kNan), black) == 100.0);
  CHECK(psnr_all(Image<float>(8, 4, 3, -kInf), black) == 100.0);
  CHECK_THROWS_AS((void)psnr_all(grey, Image<float>(4, 8, 3)), InvalidArgument);
  CHECK_THROWS_AS((void)psnr_all(Image<float>(), Image<float>()), InvalidArgument);
}

TEST_CASE("psnr_valid_depth: only pixels with depth count, and the mean is over these alone") {
  Image<float> a(4, 1, 3, 0.5f), b(4, 1, 3, 0.5f), depth(4, 1, 1, 1.f);
  for (int c = 0; c < 3; ++c) {
    b(0, 0, c) = 0.6f;
    b(1, 0, c) = 1.0f;  // masked below
  }
  depth(1, 0) = 0;
  depth(2, 0) = kNan;
  depth(3, 0) = kInf;
  REQUIRE(psnr_valid_depth(a, b, depth).has_value());
  CHECK(*psnr_valid_depth(a, b, depth) == doctest::Approx(20.0).epsilon(1e-5));
  depth(3, 0) = 2;  // a second, perfect pixel halves the error
  CHECK(*psnr_valid_depth(a, b, depth) == doctest::Approx(20.0 + 10 * std::log10(2.0)).epsilon(1e-5));
  CHECK(*psnr_valid_depth(a, b, Image<float>(4, 1, 1, 1.f)) == doctest::Approx(psnr_all(a, b)));
  CHECK_FALSE(psnr_valid_depth(a, b, Image<float>(4, 1, 1, 0.f)).has_value());
  CHECK_THROWS_AS((void)psnr_valid_depth(a, b, Image<float>(1, 4)), InvalidArgument);
}

TEST_CASE("depth_l1: mean over measured pixels") {
  Image<float> rendered(3, 1), measured(3, 1);
  rendered(0, 0) = 1.5f, measured(0, 0) = 1.f;
  rendered(1, 0) = 9.f, measured(1, 0) = 0.f;
  rendered(2, 0) = kNan, measured(2, 0) = 2.f;
  CHECK(*depth_l1(rendered, measured) == doctest::Approx((0.5 + 2.0) / 2));
  CHECK_FALSE(depth_l1(rendered, Image<float>(3, 1)).has_value());
  CHECK_THROWS_AS((void)depth_l1(rendered, Image<float>(1, 3)), InvalidArgument);
}

TEST_CASE("ssim_11_gauss: taps") {
  const auto taps = detail::ssim_taps();
  const double published[] = {.00102838, .00759876, .03600077, .10936069, .21300554, .26601173};
  for (int i = 0; i < 6; ++i) {
    CHECK(taps[i] == doctest::Approx(published[i]).epsilon(1e-5));
    CHECK(taps[i] == taps[10 - i]);
  }
}

TEST_CASE("ssim_11_gauss: agrees with the two-dimensional window, borders included") {
  for (const auto& shape :
       {std::array{37, 23, 3}, std::array{1, 1, 1}, std::array{3, 40, 3}, std::array{11, 5, 2}, std::array{64, 2, 1}}) {
    CAPTURE(shape[0]);
    const Image<float> a = noisy(shape[0], shape[1], shape[2], 1, 0.3f);
    const Image<float> b = noisy(shape[0], shape[1], shape[2], 2, 0.5f);
    CHECK(ssim_11_gauss(a, b) == doctest::Approx(naive_ssim(a, b)).epsilon(1e-5));
  }
}

TEST_CASE("ssim_11_gauss: extremes") {
  const Image<float> a = noisy(40, 30, 3, 1, 0.3f);
  CHECK(ssim_11_gauss(a, a) == doctest::Approx(1.0).epsilon(1e-6));
  Image<float> inverse = a;
  for (std::size_t i = 0; i < a.size(); ++i) inverse.data()[i] = 1 - a.data()[i];
  CHECK(ssim_11_gauss(a, inverse) < 0);
  CHECK(ssim_11_gauss(a, inverse) == doctest::Approx(ssim_11_gauss(inverse, a)).epsilon(1e-9));  // fused or not
  CHECK(std::isfinite(ssim_11_gauss(Image<float>(9, 9, 3, kNan), Image<float>(9, 9, 3, kInf))));
  CHECK(ssim_11_gauss(Image<float>(9, 9, 3, 5.f), Image<float>(9, 9, 3, 1.f)) == doctest::Approx(1.0));
  CHECK_THROWS_AS((void)ssim_11_gauss(a, Image<float>(30, 40, 3)), InvalidArgument);
}
