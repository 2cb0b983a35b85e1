// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>

#include "langgs/core/config.hpp"
#include "langgs/core/error.hpp"
#include "langgs/device/buffer.hpp"
#include "langgs/device/launch.hpp"

namespace langgs {

/// What an image loss compares: planar float images of shape [planes, height, width].
/// Every array is read up to 32 elements past its end, which a Buffer allows.
struct MaskedImages {
  const float* rendered = nullptr;
  const float* target = nullptr;
  const float* depth = nullptr;  ///< [height, width] metres: pixels without valid depth are left out; null: none are
  int width = 0, height = 0, planes = 1;

  [[nodiscard]] LANGGS_HD int num_pixels() const { return width * height; }
};

/// Throws InvalidArgument unless there is something to compare.
inline void validate(const MaskedImages& images) {
  LANGGS_EXPECTS(images.width > 0 && images.height > 0 && images.width <= 16384 && images.height <= 16384,
                 "loss images are ", images.width, "x", images.height, "; each side must be in [1, 16384]");
  LANGGS_EXPECTS(images.planes >= 1 && images.planes <= 4, "loss images have ", images.planes,
                 " planes; colour has 3, depth 1");
  LANGGS_EXPECTS(images.rendered && images.target, "a loss image is null; pass both the rendered and the target image");
}

namespace detail {

/// Farther readings are sensor errors [m]; also excludes infinity.
inline constexpr float kMaxTargetDepth = 1e4f;

/// Mask of pixels whose target depth was measured; 0, negative, NaN and infinite are not.
template <class V>
[[nodiscard]] LANGGS_INLINE auto is_measured(const V& depth) {
  return (depth > 0.f) & (depth < kMaxTargetDepth);
}

/// Adds groups of 8 pixels that lie `stride` apart, so that the loads are consecutive.
struct SumGroups {
  const float* values;
  float* sums;
  int stride;

  template <class Lanes>
  LANGGS_HD void operator()(const Lanes& lanes) const {
    auto sum = lanes.load(values);
    for (int i = 1; i < 8; ++i) sum += lanes.load(values + static_cast<std::ptrdiff_t>(i) * stride);
    lanes.store(sums, sum);
  }
};

/// The sum over an image of per-pixel values. The order of additions depends on nothing but the size.
template <class Backend>
class ImageSum {
 public:
  void resize(int num_pixels) {
    stride_ = (num_pixels + 255) / 256 * 32;
    if (values_.size() == static_cast<std::size_t>(stride_) * 8 && num_pixels_ == num_pixels) return;
    num_pixels_ = num_pixels;
    values_.resize_discard(static_cast<std::size_t>(stride_) * 8);
    values_.fill(0.f);
    sums_.resize_discard(stride_);
  }
  /// [num_pixels]; write each of them before `total`.
  [[nodiscard]] float* values() { return values_.data(); }

  [[nodiscard]] double total(const Executor<Backend>& executor) {
    for_each_lanes(executor, stride_, SumGroups{values_.data(), sums_.data(), stride_});
    double sum = 0;
    for (int i = 0; i < stride_; ++i) sum += static_cast<double>(sums_.data()[i]);
    return sum;
  }

 private:
  Buffer<float, Backend> values_, sums_;
  int stride_ = 0, num_pixels_ = 0;
};

}  // namespace detail
}  // namespace langgs
