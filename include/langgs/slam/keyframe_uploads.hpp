// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>

#include "langgs/device/upload_cache.hpp"
#include "langgs/map/keyframe.hpp"

namespace langgs {

/// Images and teachers of keyframes as kernels see them; for work that is put on the executor before the next call.
template <int FeatDim, class Backend>
class KeyframeUploads {
 public:
  explicit KeyframeUploads(std::size_t byte_budget) : cache_(byte_budget) {}

  /// Colour [H, W, 3] and depth [H, W] of keyframe i.
  [[nodiscard]] std::pair<const std::uint8_t*, const float*> images(const Executor<Backend>& executor, int i,
                                                                    const Keyframe<FeatDim>& keyframe) {
    return cache_(executor, 2 * std::int64_t{i}, colour(keyframe), depth(keyframe));
  }
  /// Features [h, w, FeatDim] and where there are any [h, w] of keyframe i, which has some.
  [[nodiscard]] std::pair<const Half*, const std::uint8_t*> teacher(const Executor<Backend>& executor, int i,
                                                                    const Keyframe<FeatDim>& keyframe) {
    return cache_(executor, 2 * std::int64_t{i} + 1, features(keyframe), present(keyframe));
  }
  /// Begins to upload what the next visit of keyframe i will ask for.
  void prefetch(const Executor<Backend>& executor, int i, const Keyframe<FeatDim>& keyframe, bool with_teacher) {
    cache_.prefetch(executor, 2 * std::int64_t{i}, colour(keyframe), depth(keyframe));
    if (with_teacher && !keyframe.features.empty())
      cache_.prefetch(executor, 2 * std::int64_t{i} + 1, features(keyframe), present(keyframe));
  }
  [[nodiscard]] std::size_t bytes() const { return cache_.bytes(); }

 private:
  static std::span<const std::uint8_t> colour(const Keyframe<FeatDim>& k) { return {k.colour.data(), k.colour.size()}; }
  static std::span<const float> depth(const Keyframe<FeatDim>& k) { return {k.depth.data(), k.depth.size()}; }
  static std::span<const Half> features(const Keyframe<FeatDim>& k) {
    return {k.features.pixel(0, 0), num_pixels(k) * FeatDim};
  }
  static std::span<const std::uint8_t> present(const Keyframe<FeatDim>& k) {
    return {k.features.present(), num_pixels(k)};
  }
  static std::size_t num_pixels(const Keyframe<FeatDim>& k) {
    return static_cast<std::size_t>(k.features.width()) * k.features.height();
  }

  UploadCache<Backend> cache_;
};

}  // namespace langgs
