// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "langgs/core/camera.hpp"
#include "langgs/core/error.hpp"
#include "langgs/core/image.hpp"

/// @file Removal of lens distortion: everything behind it may believe in the pinhole camera.

namespace langgs {

/// Radial-tangential lens distortion (Brown 1966, Conrady 1919) on normalised coordinates (X/Z, Y/Z).
struct Distortion {
  double k1 = 0, k2 = 0;  ///< radial
  double p1 = 0, p2 = 0;  ///< tangential
  double k3 = 0;          ///< radial

  friend bool operator==(const Distortion&, const Distortion&) = default;

  [[nodiscard]] bool is_zero() const { return *this == Distortion{}; }

  /// Where a point at normalised coordinates `p` appears, in normalised coordinates.
  [[nodiscard]] Eigen::Vector2d distort(const Eigen::Vector2d& p) const {
    const double x = p.x(), y = p.y(), r2 = p.squaredNorm();
    const double radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3));
    return {x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x), y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y};
  }
};

/// Resamples the images of a distorted camera as a pinhole camera of the same intrinsics would have seen them.
/// Pixels that lie outside the distorted image become 0: black, and without depth.
class UndistortMap {
 public:
  UndistortMap(const Camera& camera, const Distortion& distortion) : camera_(camera) {
    validate(camera);
    for (const double c : {distortion.k1, distortion.k2, distortion.p1, distortion.p2, distortion.k3})
      LANGGS_EXPECTS(std::isfinite(c), "a distortion coefficient is ", c, "; give k1 k2 p1 p2 k3 as finite numbers");
    source_.reserve(static_cast<std::size_t>(camera.num_pixels()));
    for (int v = 0; v < camera.height; ++v) {
      for (int u = 0; u < camera.width; ++u) {
        const Eigen::Vector2d p = distortion.distort(camera.back_project(u, v, 1).head<2>());
        const Source s{static_cast<float>(camera.fx * p.x() + camera.cx),
                       static_cast<float>(camera.fy * p.y() + camera.cy)};
        // Written so that an overflow to NaN counts as outside.
        const bool inside = s.x > -0.5f && static_cast<double>(s.x) < camera.width - 0.5 && s.y > -0.5f &&
                            static_cast<double>(s.y) < camera.height - 0.5;
        source_.push_back(inside ? s : kOutside);
      }
    }
  }

  /// Bilinear, for colours: [H, W, C] to [H, W, C].
  [[nodiscard]] Image<std::uint8_t> smooth(const Image<std::uint8_t>& image) const {
    expect_size(image.width(), image.height());
    const int channels = image.channels();
    Image<std::uint8_t> result(image.width(), image.height(), channels);
    for_each_inside([&](int u, int v, const Source& s) {
      const float x = std::fmin(std::fmax(s.x, 0.f), static_cast<float>(image.width() - 1));
      const float y = std::fmin(std::fmax(s.y, 0.f), static_cast<float>(image.height() - 1));
      const int x0 = static_cast<int>(x), y0 = static_cast<int>(y);
      const int x1 = x0 + 1 < image.width() ? x0 + 1 : x0, y1 = y0 + 1 < image.height() ? y0 + 1 : y0;
      const float ax = x - static_cast<float>(x0), ay = y - static_cast<float>(y0);
      for (int c = 0; c < channels; ++c) {
        const float top = (1 - ax) * image(x0, y0, c) + ax * image(x1, y0, c);
        const float bottom = (1 - ax) * image(x0, y1, c) + ax * image(x1, y1, c);
        result(u, v, c) = static_cast<std::uint8_t>((1 - ay) * top + ay * bottom + 0.5f);
      }
    });
    return result;
  }

  /// Nearest neighbour, for what must not be mixed: depths, labels.
  template <class T>
  [[nodiscard]] Image<T> nearest(const Image<T>& image) const {
    expect_size(image.width(), image.height());
    Image<T> result(image.width(), image.height(), image.channels());
    for_each_inside([&](int u, int v, const Source& s) {
      // The sum may round up to the next integer.
      const int x = std::min(static_cast<int>(s.x + 0.5f), image.width() - 1);
      const int y = std::min(static_cast<int>(s.y + 0.5f), image.height() - 1);
      for (int c = 0; c < image.channels(); ++c) result(u, v, c) = image(x, y, c);
    });
    return result;
  }

 private:
  struct Source {
    float x, y;
  };
  static constexpr Source kOutside{-1, -1};

  void expect_size(int width, int height) const {
    LANGGS_EXPECTS(width == camera_.width && height == camera_.height, "image is ", width, "x", height,
                   " but the undistortion is for ", camera_.width, "x", camera_.height, "; they must be the same size");
  }
  template <class F>
  void for_each_inside(F&& f) const {
    for (int v = 0; v < camera_.height; ++v)
      for (int u = 0; u < camera_.width; ++u) {
        const Source& source = source_[static_cast<std::size_t>(v) * camera_.width + u];
        if (source.x > -1) f(u, v, source);
      }
  }

  Camera camera_;
  std::vector<Source> source_;  // [H, W] where each pixel comes from; kOutside: nowhere
};

}  // namespace langgs
