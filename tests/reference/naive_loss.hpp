// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <vector>

/// @file The image losses in double precision, straight from their definitions: a 2-D window per pixel, no separation.

namespace langgs::reference {

/// Planar images of shape [planes, height, width]; mask [height, width], 0 where left out.
struct NaiveImages {
  int width = 0, height = 0, planes = 1;
  std::vector<double> rendered, target, mask;

  [[nodiscard]] double at(const std::vector<double>& image, int p, int x, int y) const {
    if (x < 0 || y < 0 || x >= width || y >= height || mask[y * width + x] == 0) return 0;
    return image[(p * height + y) * width + x];
  }
};

[[nodiscard]] inline double naive_l1(const NaiveImages& images) {
  double sum = 0;
  for (int p = 0; p < images.planes; ++p)
    for (int y = 0; y < images.height; ++y)
      for (int x = 0; x < images.width; ++x)
        sum += std::abs(images.at(images.rendered, p, x, y) - images.at(images.target, p, x, y));
  return sum / (static_cast<double>(images.planes) * images.width * images.height);
}

/// 1 - SSIM: 11x11 Gaussian window of sigma 1.5, zero padding, biased moments, dynamic range 1.
[[nodiscard]] inline double naive_dssim(const NaiveImages& images) {
  constexpr double kC1 = 0.01 * 0.01, kC2 = 0.03 * 0.03;
  double norm = 0, window[11][11];
  for (int i = -5; i <= 5; ++i)
    for (int j = -5; j <= 5; ++j) norm += window[i + 5][j + 5] = std::exp(-(i * i + j * j) / (2 * 1.5 * 1.5));
  double sum = 0;
  for (int p = 0; p < images.planes; ++p)
    for (int y = 0; y < images.height; ++y)
      for (int x = 0; x < images.width; ++x) {
        double ma = 0, mb = 0, aa = 0, bb = 0, ab = 0;
        for (int i = -5; i <= 5; ++i)
          for (int j = -5; j <= 5; ++j) {
            const double w = window[i + 5][j + 5] / norm;
            const double a = images.at(images.rendered, p, x + j, y + i), b = images.at(images.target, p, x + j, y + i);
            ma += w * a, mb += w * b, aa += w * a * a, bb += w * b * b, ab += w * a * b;
          }
        const double va = aa - ma * ma, vb = bb - mb * mb, cov = ab - ma * mb;
        sum += (2 * ma * mb + kC1) * (2 * cov + kC2) / ((ma * ma + mb * mb + kC1) * (va + vb + kC2));
      }
  return 1 - sum / (static_cast<double>(images.planes) * images.width * images.height);
}

}  // namespace langgs::reference
