// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <vector>

#include "langgs/core/error.hpp"
#include "langgs/core/image.hpp"
#include "langgs/core/rng.hpp"
#include "langgs/frame/feature_map.hpp"
#include "langgs/frame/rgbd_frame.hpp"
#include "langgs/host/worker_pool.hpp"

/// @file Dense features from the image alone, for any RGB-D sequence and without a network.

namespace langgs {

struct TextureFeatureSettings {
  int stride = 8;          ///< image pixels per feature pixel, in [1, 256]
  std::uint64_t seed = 1;  ///< of the random projection: features of one seed can be compared
};

namespace detail {

/// Statistics of an image at several scales. Per cell and scale: mean of three opponent colours, their spread, the
/// strength of the gradient, and how it is spread over eight directions.
class TextureStatistics {
 public:
  static constexpr int kDirections = 8;
  static constexpr int kPerScale = 3 + 3 + 1 + kDirections;
  /// Radii of the windows, in cells; small windows tell things apart, large ones say what surrounds them.
  static constexpr std::array<int, 4> kRadii{0, 1, 3, 6};
  static constexpr int kSize = kPerScale * static_cast<int>(kRadii.size());

  TextureStatistics(const Image<std::uint8_t>& colour, int stride)
      : width_((colour.width() + stride - 1) / stride), height_((colour.height() + stride - 1) / stride) {
    gather(colour, stride);
  }

  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }

  /// Descriptors [height, width, kSize], roughly centred and of comparable scale.
  [[nodiscard]] std::vector<float> descriptors() const {
    std::vector<float> result(static_cast<std::size_t>(width_) * height_ * kSize);
    for (std::size_t scale = 0; scale < kRadii.size(); ++scale) {
      const std::vector<float> sums = blurred(kRadii[scale]);
      for (std::size_t cell = 0; cell < static_cast<std::size_t>(width_) * height_; ++cell) {
        describe(sums.data() + cell * kChannels, result.data() + cell * kSize + scale * kPerScale);
      }
    }
    return result;
  }

 private:
  static constexpr int kChannels = 3 + 3 + kDirections;  // means, squares, gradient by direction

  /// Light, red-green and blue-yellow of a pixel, each within [0, 1].
  static std::array<float, 3> opponents(const std::uint8_t* rgb) {
    const float r = rgb[0] / 255.f, g = rgb[1] / 255.f, b = rgb[2] / 255.f;
    return {(r + g + b) / 3, 0.5f + 0.5f * (r - g), 0.5f + 0.5f * (b - 0.5f * (r + g))};
  }

  /// Means over the cells of the image.
  void gather(const Image<std::uint8_t>& colour, int stride) {
    const int w = colour.width(), h = colour.height();
    sums_.assign(static_cast<std::size_t>(width_) * height_ * kChannels, 0.f);
    const auto light = [&](int x, int y) {
      const std::uint8_t* p = &colour(std::clamp(x, 0, w - 1), std::clamp(y, 0, h - 1));
      return static_cast<float>(p[0] + p[1] + p[2]) / 765.f;
    };
    for (int y = 0; y < h; ++y) {
      for (int x = 0; x < w; ++x) {
        float* sums = sums_.data() + (static_cast<std::size_t>(y / stride) * width_ + x / stride) * kChannels;
        const std::array<float, 3> value = opponents(&colour(x, y));
        for (int c = 0; c < 3; ++c) {
          sums[c] += value[c];
          sums[3 + c] += value[c] * value[c];
        }
        const float gx = light(x + 1, y) - light(x - 1, y), gy = light(x, y + 1) - light(x, y - 1);
        const float strength = std::sqrt(gx * gx + gy * gy);
        if (strength < 1e-6f) continue;
        // Shared between the two nearest directions, so that a small turn makes a small difference.
        const float turn = (std::atan2(gy, gx) / (2 * std::numbers::pi_v<float>)+1) * kDirections;
        const int first = static_cast<int>(turn);
        const float share = turn - static_cast<float>(first);
        sums[6 + first % kDirections] += strength * (1 - share);
        sums[6 + (first + 1) % kDirections] += strength * share;
      }
    }
    for (int cy = 0; cy < height_; ++cy) {
      for (int cx = 0; cx < width_; ++cx) {
        const int count = std::min(stride, w - cx * stride) * std::min(stride, h - cy * stride);
        float* sums = sums_.data() + (static_cast<std::size_t>(cy) * width_ + cx) * kChannels;
        for (int c = 0; c < kChannels; ++c) sums[c] /= static_cast<float>(count);
      }
    }
  }

  /// The cells' means under a binomial window two boxes wide, clamped at the border.
  [[nodiscard]] std::vector<float> blurred(int radius) const {
    std::vector<float> cells = sums_;
    for (int pass = 0; radius > 0 && pass < 2; ++pass) {
      for (int y = 0; y < height_; ++y) box(cells, static_cast<std::size_t>(y) * width_, 1, width_, radius);
      for (int x = 0; x < width_; ++x) box(cells, x, width_, height_, radius);
    }
    return cells;
  }

  /// Running mean along one row or column of cells.
  void box(std::vector<float>& cells, std::size_t first, int step, int count, int radius) const {
    std::vector<float> line(static_cast<std::size_t>(count) * kChannels);
    const auto cell = [&](int i) { return cells.data() + (first + static_cast<std::size_t>(i) * step) * kChannels; };
    for (int i = 0; i < count; ++i)
      std::copy_n(cell(i), kChannels, line.data() + static_cast<std::size_t>(i) * kChannels);
    const auto source = [&](int i) {
      return line.data() + static_cast<std::size_t>(std::clamp(i, 0, count - 1)) * kChannels;
    };
    std::array<double, kChannels> sum{};
    for (int i = -radius; i <= radius; ++i) {
      for (int c = 0; c < kChannels; ++c) sum[c] += source(i)[c];
    }
    for (int i = 0; i < count; ++i) {
      for (int c = 0; c < kChannels; ++c) cell(i)[c] = static_cast<float>(sum[c] / (2 * radius + 1));
      for (int c = 0; c < kChannels; ++c) sum[c] += source(i + radius + 1)[c] - source(i - radius)[c];
    }
  }

  static void describe(const float* sums, float* out) {
    // Weights bring the parts to comparable spread; colour differences matter more than those of light, which shadows
    // and exposure change.
    constexpr float kLight = 2.f, kColour = 6.f, kSpread = 2.f, kEdges = 0.35f, kDirection = 0.5f;
    for (int c = 0; c < 3; ++c) {
      out[c] = (c == 0 ? kLight : kColour) * (sums[c] - 0.5f);
      out[3 + c] = kSpread * std::sqrt(std::max(0.f, sums[3 + c] - sums[c] * sums[c]) + 1e-4f);
    }
    float strength = 0;
    for (int d = 0; d < kDirections; ++d) strength += sums[6 + d];
    out[6] = kEdges * std::log((strength + 0.005f) / 0.05f);
    for (int d = 0; d < kDirections; ++d) {
      out[7 + d] = kDirection * (sums[6 + d] - strength / kDirections) / (strength + 0.05f);
    }
  }

  int width_, height_;
  std::vector<float> sums_;  // [height, width, kChannels]
};

}  // namespace detail

/// A FeatureSource: multi-scale colour and gradient statistics under a fixed random projection, unit length, at a
/// stride of the image. Neighbouring views of a surface give similar features. The pool may be null.
template <int FeatDim>
class TextureFeatures {
 public:
  explicit TextureFeatures(const TextureFeatureSettings& settings = {}, WorkerPool* pool = nullptr)
      : settings_(settings), pool_(pool) {
    LANGGS_EXPECTS(settings.stride >= 1 && settings.stride <= 256, "stride is ", settings.stride,
                   "; it must be in [1, 256]");
    projection_.resize(static_cast<std::size_t>(detail::TextureStatistics::kSize) * FeatDim);
    const CounterRng rng{settings.seed, 0x74657874};
    for (std::size_t i = 0; i < projection_.size(); ++i) projection_[i] = static_cast<float>(rng.normal(i));
  }

  /// Map of ceil(H / stride) x ceil(W / stride) pixels; empty for a frame without colour.
  [[nodiscard]] FeatureMap<FeatDim> operator()(const RgbdFrame& frame) const {
    if (frame.colour.empty()) return {};
    LANGGS_EXPECTS(frame.colour.channels() == 3, "colour image has ", frame.colour.channels(),
                   " channels; three are needed (RGB)");
    const detail::TextureStatistics statistics(frame.colour, settings_.stride);
    const std::vector<float> descriptors = statistics.descriptors();
    FeatureMap<FeatDim> map(statistics.width(), statistics.height());
    const auto project_row = [&](int y) {
      std::vector<float> feature(FeatDim);
      for (int x = 0; x < map.width(); ++x) {
        std::fill(feature.begin(), feature.end(), 0.f);
        const float* in =
            descriptors.data() + (static_cast<std::size_t>(y) * map.width() + x) * detail::TextureStatistics::kSize;
        for (int i = 0; i < detail::TextureStatistics::kSize; ++i) {
          const float* row = projection_.data() + static_cast<std::size_t>(i) * FeatDim;
          for (int c = 0; c < FeatDim; ++c) feature[c] += in[i] * row[c];
        }
        map.set_pixel(x, y, feature.data());
      }
    };
    if (pool_) {
      pool_->run(map.height(), project_row);
    } else {
      for (int y = 0; y < map.height(); ++y) project_row(y);
    }
    return map;
  }

 private:
  TextureFeatureSettings settings_;
  WorkerPool* pool_;
  std::vector<float> projection_;  // [kSize, FeatDim]
};

static_assert(FeatureSource<TextureFeatures<8>, 8>);

}  // namespace langgs
