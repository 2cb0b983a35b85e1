// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <utility>
#include <vector>

#include "langgs/core/error.hpp"
#include "langgs/core/image.hpp"
#include "langgs/core/rng.hpp"
#include "langgs/frame/feature_map.hpp"
#include "langgs/frame/rgbd_frame.hpp"

/// @file Feature maps made from label images: what a good encoder would say about a frame whose labels are known.

namespace langgs {

struct LabelFeatureSettings {
  int stride = 4;          ///< image pixels per feature pixel, in [1, 256]
  int blur = 4;            ///< image pixels by which a feature looks past its own cell, in [0, 256]
  double noise = 0;        ///< expected length of the noise added to the unit features, in [0, 10]
  std::uint64_t seed = 1;  ///< of the noise
};

namespace detail {

inline void validate(const LabelFeatureSettings& s) {
  LANGGS_EXPECTS(s.stride >= 1 && s.stride <= 256, "stride is ", s.stride, "; it must be in [1, 256]");
  LANGGS_EXPECTS(s.blur >= 0 && s.blur <= 256, "blur is ", s.blur, " pixels; it must be in [0, 256]");
  LANGGS_EXPECTS(s.noise >= 0 && s.noise <= 10, "feature noise is ", s.noise, "; it must be in [0, 10]");
}

/// Adds noise of expected squared length noise^2. A sum of four uniforms is normal enough here and costs one word each.
template <int FeatDim>
void add_feature_noise(float* feature, double noise, const CounterRng& rng, std::uint64_t pixel) {
  // Four 16-bit uniforms have variance 4 (2^32 - 1) / 12 around 4 (2^16 - 1) / 2.
  const float scale = static_cast<float>(noise / std::sqrt(static_cast<double>(FeatDim) * 4 * 0xFFFFFFFFull / 12.0));
  for (int c = 0; c < FeatDim; ++c) {
    const std::uint64_t w = mix64(rng.seed ^ (pixel * FeatDim + static_cast<std::uint64_t>(c)));
    const auto sum = static_cast<int>((w & 0xFFFF) + (w >> 16 & 0xFFFF) + (w >> 32 & 0xFFFF) + (w >> 48));
    feature[c] += scale * static_cast<float>(sum - 131070);
  }
}

}  // namespace detail

/// The feature map of a label image [H, W]: ceil(H / stride) x ceil(W / stride) pixels, each the normalised mean of the
/// class vectors over a window of stride + 2 blur image pixels, so that features mix across object borders.
/// `class_vectors` is [num_labels, FeatDim], row-major; rows of zeros contribute nothing, and a window of nothing else
/// gives a pixel of zeros. Throws if a label has no row or a vector is not finite.
template <int FeatDim>
[[nodiscard]] FeatureMap<FeatDim> feature_map_from_labels(const Image<std::uint16_t>& labels,
                                                          const std::vector<float>& class_vectors,
                                                          const LabelFeatureSettings& settings = {}) {
  detail::validate(settings);
  LANGGS_EXPECTS(!labels.empty() && labels.channels() == 1, "label image is [", labels.height(), ", ", labels.width(),
                 ", ", labels.channels(), "]; it must not be empty and must have one channel");
  LANGGS_EXPECTS(!class_vectors.empty() && class_vectors.size() % FeatDim == 0, "class vectors have ",
                 class_vectors.size(), " values; a multiple of the feature dimension ", FeatDim, " is needed");
  LANGGS_EXPECTS(std::all_of(class_vectors.begin(), class_vectors.end(), [](float v) { return std::isfinite(v); }),
                 "class vectors hold a value that is not finite; check the file they come from");
  const int num_labels = static_cast<int>(class_vectors.size() / FeatDim);
  const int highest = *std::max_element(labels.data(), labels.data() + labels.size());
  LANGGS_EXPECTS(highest < num_labels, "label ", highest, " has no class vector; there are ", num_labels,
                 " rows, for labels 0 to ", num_labels - 1);

  FeatureMap<FeatDim> map((labels.width() + settings.stride - 1) / settings.stride,
                          (labels.height() + settings.stride - 1) / settings.stride);
  const CounterRng noise{mix64(settings.seed), 0};
  std::vector<int> counts(num_labels, 0);
  std::vector<int> present;
  std::vector<float> feature(FeatDim);
  // The image pixels [first, last) whose labels feature pixel i of n sees, both images covering the same rectangle.
  const auto window = [&](int i, int n, int size) {
    const int first = static_cast<int>(static_cast<std::int64_t>(i) * size / n);
    const int last = static_cast<int>((static_cast<std::int64_t>(i + 1) * size + n - 1) / n);
    return std::pair{std::max(0, first - settings.blur), std::min(size, last + settings.blur)};
  };
  for (int fy = 0; fy < map.height(); ++fy) {
    const auto rows = window(fy, map.height(), labels.height());
    for (int fx = 0; fx < map.width(); ++fx) {
      const auto columns = window(fx, map.width(), labels.width());
      present.clear();
      for (int y = rows.first; y < rows.second; ++y) {
        for (int x = columns.first; x < columns.second; ++x) {
          const int label = labels(x, y);
          if (counts[label]++ == 0) present.push_back(label);
        }
      }
      std::sort(present.begin(), present.end());
      std::fill(feature.begin(), feature.end(), 0.f);
      float total = 0;
      for (const int label : present) {
        const float* vector = class_vectors.data() + static_cast<std::size_t>(label) * FeatDim;
        const auto weight = static_cast<float>(std::exchange(counts[label], 0));
        const bool known = std::any_of(vector, vector + FeatDim, [](float v) { return v != 0; });
        if (!known) continue;
        total += weight;
        for (int c = 0; c < FeatDim; ++c) feature[c] += weight * vector[c];
      }
      if (total > 0) {
        for (float& v : feature) v /= total;
        const std::uint64_t pixel = static_cast<std::uint64_t>(fy) * map.width() + fx;
        if (settings.noise > 0) detail::add_feature_noise<FeatDim>(feature.data(), settings.noise, noise, pixel);
      }
      map.set_pixel(fx, fy, feature.data());
    }
  }
  return map;
}

/// A FeatureSource for frames whose label image can be had: `labels_of(frame)` gives it, an empty one means that there
/// are no features for this frame. Each frame gets noise of its own.
template <int FeatDim>
struct LabelFeatures {
  std::function<Image<std::uint16_t>(const RgbdFrame&)> labels_of;
  std::vector<float> class_vectors;  ///< [num_labels, FeatDim]
  LabelFeatureSettings settings = {};

  [[nodiscard]] FeatureMap<FeatDim> operator()(const RgbdFrame& frame) const {
    LANGGS_EXPECTS(static_cast<bool>(labels_of), "LabelFeatures has no labels_of; set it to a function of the frame");
    const Image<std::uint16_t> labels = labels_of(frame);
    if (labels.empty()) return {};
    LabelFeatureSettings of_frame = settings;
    of_frame.seed = mix64(settings.seed ^ std::bit_cast<std::uint64_t>(frame.timestamp));
    return feature_map_from_labels<FeatDim>(labels, class_vectors, of_frame);
  }
};

static_assert(FeatureSource<LabelFeatures<3>, 3>);

}  // namespace langgs
