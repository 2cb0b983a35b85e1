// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "langgs/core/error.hpp"
#include "langgs/core/half.hpp"
#include "langgs/frame/rgbd_frame.hpp"

namespace langgs {

/// A dense language feature map [height, width, D] in half precision at its own resolution.
/// Every pixel holds a unit vector, or all zeros where the encoder gave nothing (such pixels are never learnt from).
template <int FeatDim>
class FeatureMap {
 public:
  static_assert(FeatDim >= 1 && FeatDim <= 4096, "FeatDim must be in [1, 4096]; LSeg and CLIP ViT-B/32 use 512");
  static constexpr int kDim = FeatDim;

  FeatureMap() = default;
  FeatureMap(int width, int height) : width_(width), height_(height) {
    LANGGS_EXPECTS(width > 0 && height > 0, "feature map is ", width, "x", height, "; sides must be positive");
    data_.resize(static_cast<std::size_t>(width) * height * FeatDim);
    present_.resize(static_cast<std::size_t>(width) * height);
  }

  [[nodiscard]] bool empty() const { return data_.empty(); }
  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }
  [[nodiscard]] std::size_t bytes() const { return data_.size() * sizeof(Half) + present_.size(); }

  /// Feature of pixel (x, y): FeatDim contiguous values.
  [[nodiscard]] const Half* pixel(int x, int y) const { return data_.data() + offset(x, y); }

  /// [height, width]: not 0 where a pixel has a feature.
  [[nodiscard]] const std::uint8_t* present() const { return present_.data(); }

  /// Stores `feature` (FeatDim floats) L2-normalised; a vector that is zero or not finite is stored as zeros.
  void set_pixel(int x, int y, const float* feature) {
    double norm2 = 0;
    for (int c = 0; c < FeatDim; ++c) norm2 += static_cast<double>(feature[c]) * feature[c];
    const bool usable = std::isfinite(norm2) && norm2 > 0;
    const double scale = usable ? 1 / std::sqrt(norm2) : 0;  // double: finite for subnormal features too
    present_[static_cast<std::size_t>(y) * width_ + x] = usable ? 1 : 0;
    Half* out = data_.data() + offset(x, y);
    for (int c = 0; c < FeatDim; ++c) out[c] = Half(usable ? static_cast<float>(feature[c] * scale) : 0.f);
  }

  /// Bilinear sample at pixel (u, v) of a colour image of the given size, L2-normalised into `out` (FeatDim floats).
  /// Half-pixel rule: both images cover the same rectangle. Writes zeros where no neighbour has a feature.
  void sample(double u, double v, const Camera& image, float* out) const {
    const double x = std::clamp((u + 0.5) * width_ / image.width - 0.5, 0.0, width_ - 1.0);
    const double y = std::clamp((v + 0.5) * height_ / image.height - 0.5, 0.0, height_ - 1.0);
    const int x0 = static_cast<int>(x), y0 = static_cast<int>(y);
    const int x1 = std::min(x0 + 1, width_ - 1), y1 = std::min(y0 + 1, height_ - 1);
    const float ax = static_cast<float>(x - x0), ay = static_cast<float>(y - y0);
    const Half *f00 = pixel(x0, y0), *f10 = pixel(x1, y0), *f01 = pixel(x0, y1), *f11 = pixel(x1, y1);
    double norm2 = 0;
    for (int c = 0; c < FeatDim; ++c) {
      const float top = (1 - ax) * float(f00[c]) + ax * float(f10[c]);
      const float bottom = (1 - ax) * float(f01[c]) + ax * float(f11[c]);
      out[c] = (1 - ay) * top + ay * bottom;
      norm2 += static_cast<double>(out[c]) * out[c];
    }
    const float scale = norm2 > 0 ? static_cast<float>(1 / std::sqrt(norm2)) : 0.f;
    for (int c = 0; c < FeatDim; ++c) out[c] *= scale;
  }

 private:
  [[nodiscard]] std::size_t offset(int x, int y) const { return (static_cast<std::size_t>(y) * width_ + x) * FeatDim; }

  int width_ = 0, height_ = 0;
  std::vector<Half> data_;
  std::vector<std::uint8_t> present_;
};

/// Where feature maps come from: an image encoder, files, labels. Called for keyframes only.
/// An empty map means "no features for this frame".
template <class S, int FeatDim>
concept FeatureSource = requires(S source, const RgbdFrame& frame) {
  { source(frame) } -> std::same_as<FeatureMap<FeatDim>>;
};

/// Null object: a map of geometry and colour alone.
struct NoFeatures {
  FeatureMap<1> operator()(const RgbdFrame&) const { return {}; }
};

}  // namespace langgs
