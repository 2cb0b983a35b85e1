// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "langgs/core/rng.hpp"
#include "langgs/map/keyframe.hpp"

namespace langgs {

/// The keyframes of a run in order of arrival, within a budget of bytes.
///
/// What no longer fits leaves in an order that depends on visits alone: first feature maps, whose content the map has
/// learnt, then images; each time those of the keyframe that was visited most often, the oldest of equals. The newest
/// keyframe keeps all it has, and poses always stay. A keyframe without images is not optimised any more.
template <int FeatDim>
class KeyframeStore {
 public:
  explicit KeyframeStore(std::size_t byte_budget) : byte_budget_(byte_budget) {}

  void add(Keyframe<FeatDim> keyframe) {
    bytes_ += keyframe.bytes();
    trainable_.push_back(size());
    keyframes_.push_back(std::move(keyframe));
    while (bytes_ > byte_budget_ && (release_features() || release_images())) {
    }
  }

  [[nodiscard]] int size() const { return static_cast<int>(keyframes_.size()); }
  [[nodiscard]] bool empty() const { return keyframes_.empty(); }
  [[nodiscard]] Keyframe<FeatDim>& operator[](int i) { return keyframes_[i]; }
  [[nodiscard]] const std::vector<Keyframe<FeatDim>>& all() const { return keyframes_; }
  /// Which keyframe mapping visits next, of those that have images: one never visited, the oldest first; without any,
  /// one chosen uniformly by `iteration`. There must be a keyframe.
  [[nodiscard]] int next(const CounterRng& choice, std::uint64_t iteration) const {
    for (const std::int32_t i : trainable_)
      if (keyframes_[i].visits == 0) return i;
    return trainable_[choice.below(iteration, static_cast<std::uint32_t>(trainable_.size()))];
  }
  /// Indices of the keyframes that have images, ascending.
  [[nodiscard]] const std::vector<std::int32_t>& trainable() const { return trainable_; }
  [[nodiscard]] std::size_t bytes() const { return bytes_; }
  [[nodiscard]] std::size_t feature_bytes() const {
    std::size_t sum = 0;
    for (const Keyframe<FeatDim>& k : keyframes_) sum += k.features.bytes();
    return sum;
  }

 private:
  /// The most visited of the keyframes before the newest for which `has` holds; -1 without any.
  template <class Has>
  [[nodiscard]] int most_visited(const Has& has) const {
    int best = -1;
    for (int i = 0; i + 1 < size(); ++i)
      if (has(keyframes_[i]) && (best < 0 || keyframes_[i].visits > keyframes_[best].visits)) best = i;
    return best;
  }
  bool release_features() {
    const int i = most_visited([](const Keyframe<FeatDim>& k) { return !k.features.empty(); });
    if (i < 0) return false;
    bytes_ -= keyframes_[i].features.bytes();
    keyframes_[i].features = {};
    return true;
  }
  bool release_images() {
    const int i = most_visited([](const Keyframe<FeatDim>& k) { return k.has_images(); });
    if (i < 0) return false;
    bytes_ -= keyframes_[i].bytes();
    keyframes_[i].colour = {};
    keyframes_[i].depth = {};
    std::erase(trainable_, i);
    return true;
  }

  std::size_t byte_budget_, bytes_ = 0;
  std::vector<Keyframe<FeatDim>> keyframes_;
  std::vector<std::int32_t> trainable_;
};

}  // namespace langgs
