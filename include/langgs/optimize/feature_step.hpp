// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "langgs/core/half.hpp"
#include "langgs/device/algorithm.hpp"
#include "langgs/device/buffer.hpp"
#include "langgs/device/launch.hpp"
#include "langgs/frame/feature_map.hpp"
#include "langgs/map/gaussian_map.hpp"
#include "langgs/optimize/adam.hpp"
#include "langgs/render/contributions.hpp"

/// @file L1 loss on rendered features and its Adam step (paper Eq. L_feat), without a feature image and without
/// atomics.
///
/// The gradient of an L1 loss is a sign, so one bit per pixel and channel is all that the backward pass needs. The list
/// of (pixel, Gaussian, weight) is turned around once, and each Gaussian then gathers its own gradient.

namespace langgs {

/// Renders the feature of each sample, compares it with the teacher and keeps the signs of the difference.
template <int FeatDim>
struct FeatureSigns {
  static constexpr int kThreads = 128;
  static constexpr int kWarps = kThreads / 32;
  static constexpr int kWords = (FeatDim + 31) / 32;
  template <class Block>
  struct Shared {};

  ContributionView contributions;
  const float* features;  ///< [N, FeatDim]
  const Half* teacher;    ///< [num_pixels, FeatDim]; all zeros where there is no teacher
  std::uint32_t* signs;   ///< [num_pixels, kWords]; bit set where rendered > teacher
  float* loss;            ///< [num_pixels] sum over channels of |F - F*|, or -1 where the pixel teaches nothing

  template <class Block>
  LANGGS_HD void operator()(Block& block, Shared<Block>&) const {
    using F = VaryingOf<float, Block>;
    block.warps([&](const auto& warp) {
      const int p = block.index() * kWarps + warp.index();
      if (p >= contributions.num_pixels) return;
      const int begin = contributions.begin[p], end = contributions.begin[p + 1];
      F difference_sum(0.f), teacher_sum(0.f);
      for (int c = 0; c < FeatDim; c += 32) {
        F sum(0.f);
        for (int i = begin; i < end; ++i)
          sum += contributions.weight[i] *
                 warp.load(features + static_cast<std::ptrdiff_t>(contributions.gaussian[i]) * FeatDim + c);
        const F target = warp.load_channels(teacher + static_cast<std::ptrdiff_t>(p) * FeatDim + c, FeatDim - c);
        const auto inside = warp.lane_index() < FeatDim - c;
        const F difference = select(inside, sum - target, F(0.f));
        difference_sum += abs(difference);
        teacher_sum += abs(target);
        signs[static_cast<std::ptrdiff_t>(p) * kWords + c / 32] = warp.ballot(difference > 0.f);
      }
      const bool teaches = begin < end && warp.sum(teacher_sum) > 0.f;
      loss[p] = teaches ? warp.sum(difference_sum) : -1.f;
    });
  }
};

/// Gathers dL/df of one Gaussian a warp and applies Adam to its row.
template <int FeatDim>
struct FeatureUpdate {
  static constexpr int kThreads = 128;
  static constexpr int kWarps = kThreads / 32;
  static constexpr int kWords = (FeatDim + 31) / 32;
  template <class Block>
  struct Shared {};

  int num_gaussians;
  const std::int32_t* touched;    ///< [num_gaussians]
  const std::int32_t* hit_begin;  ///< [N + 1] into hits, by Gaussian
  const std::int32_t* hits;       ///< contribution indices, grouped by Gaussian
  const std::int32_t* hit_pixel;  ///< [size] pixel of each contribution
  const float* weight;            ///< [size]
  const std::uint32_t* signs;
  const float* loss;
  float scale, rate;
  AdamRule rule;
  float *features, *first, *second;  ///< [N, FeatDim]

  template <class Block>
  LANGGS_HD void operator()(Block& block, Shared<Block>&) const {
    using F = VaryingOf<float, Block>;
    block.warps([&](const auto& warp) {
      const int n = block.index() * kWarps + warp.index();
      if (n >= num_gaussians) return;
      const int g = touched[n];
      // Momentum must not move a Gaussian that no pixel with a teacher has seen.
      bool is_taught = false;
      for (int h = hit_begin[g]; h < hit_begin[g + 1] && !is_taught; ++h) is_taught = loss[hit_pixel[hits[h]]] >= 0;
      if (!is_taught) return;
      const std::ptrdiff_t row = static_cast<std::ptrdiff_t>(g) * FeatDim;
      for (int c = 0; c < FeatDim; c += 32) {
        F gradient(0.f);
        for (int h = hit_begin[g]; h < hit_begin[g + 1]; ++h) {
          const int p = hit_pixel[hits[h]];
          if (loss[p] < 0) continue;
          const float w = weight[hits[h]];
          gradient += select(warp.unballot(signs[static_cast<std::ptrdiff_t>(p) * kWords + c / 32]), F(w), F(-w));
        }
        // Never beyond the row: the next one belongs to another warp.
        const auto take = [&](const float* base) {
          return warp.template load_rect<32>(base + row + c, 0, FeatDim - c, 1, 0.f);
        };
        F m = take(first), v = take(second);
        const F step = rule.direction(gradient * scale, m, v);
        const auto put = [&](float* base, const F& value) {
          warp.template store_rect<32>(base + row + c, 0, FeatDim - c, 1, value);
        };
        put(features, take(features) - rate * step);
        put(first, m);
        put(second, v);
      }
    });
  }
};

/// One supervised step of the feature field against a keyframe's feature map. Weights are constants: the feature loss
/// does not move geometry (the fields are decoupled, paper section 3.4).
template <int FeatDim, class Backend>
class FeatureStep {
 public:
  explicit FeatureStep(const LearningRates& rates = {}) : rates_(rates) {}

  /// Returns L_feat = mean |F - F*| over the pixels that teach and all channels; 0 where none does.
  /// `contributions` must have one pixel for each pixel of `teacher`.
  double step(const Executor<Backend>& executor, GaussianMap<FeatDim, Backend>& map,
              const ContributionView& contributions, const FeatureMap<FeatDim>& teacher) {
    LANGGS_EXPECTS(contributions.num_pixels == teacher.width() * teacher.height(), "the contributions are for ",
                   contributions.num_pixels, " pixels, the teacher has ", teacher.width(), "x", teacher.height());
    using Signs = FeatureSigns<FeatDim>;
    using Update = FeatureUpdate<FeatDim>;
    const int pixels = contributions.num_pixels;
    signs_.resize_discard(static_cast<std::size_t>(pixels) * Signs::kWords);
    loss_.resize_discard(pixels);
    launch(executor, (pixels + Signs::kWarps - 1) / Signs::kWarps,
           Signs{contributions, map.features().data(), teacher.pixel(0, 0), signs_.data(), loss_.data()});
    double sum = 0;
    int teaching = 0;
    for (int p = 0; p < pixels; ++p)
      if (loss_.data()[p] >= 0) {
        sum += static_cast<double>(loss_.data()[p]);
        ++teaching;
      }
    if (teaching == 0) return 0;

    group_by_gaussian(executor, contributions, map.size());
    const float scale = 1.f / (static_cast<float>(teaching) * FeatDim);
    launch(executor, (num_touched_ + Update::kWarps - 1) / Update::kWarps,
           Update{num_touched_,
                  touched_.data(),
                  hit_begin_.data(),
                  hits_.data(),
                  hit_pixel_.data(),
                  contributions.weight,
                  signs_.data(),
                  loss_.data(),
                  scale,
                  rates_.feature,
                  {rates_.beta1, rates_.beta2, rates_.epsilon},
                  map.features().data(),
                  map.first_moment.feature.data(),
                  map.second_moment.feature.data()});
    return sum / (static_cast<double>(teaching) * FeatDim);
  }

 private:
  /// The pixels of each contribution, and the contributions of each Gaussian.
  void group_by_gaussian(const Executor<Backend>& executor, const ContributionView& contributions, int num_gaussians) {
    hit_pixel_.resize_discard(contributions.size);
    key_.resize_discard(contributions.size);
    hits_.resize_discard(contributions.size);
    index_.resize_discard(contributions.size);
    flag_.resize_discard(num_gaussians);
    touched_.resize_discard(num_gaussians + 1);
    for_each_n(executor, contributions.num_pixels, [&](int p) {
      for (int i = contributions.begin[p]; i < contributions.begin[p + 1]; ++i) {
        hit_pixel_.data()[i] = p;
        index_.data()[i] = i;
        key_.data()[i] = static_cast<std::uint32_t>(contributions.gaussian[i]);
      }
    });
    group_by_key(executor, key_.data(), index_.data(), contributions.size, hits_.data(), hit_begin_, num_gaussians,
                 scratch_);
    for_each_n(executor, num_gaussians, [&](int g) { flag_.data()[g] = hit_begin_[g + 1] > hit_begin_[g] ? 1 : 0; });
    num_touched_ = select_flagged(executor, flag_.data(), touched_.data(), num_gaussians);
  }

  LearningRates rates_;
  int num_touched_ = 0;
  Buffer<std::uint32_t, Backend> signs_, key_;
  Buffer<float, Backend> loss_;
  Buffer<std::int32_t, Backend> hit_pixel_, hits_, index_, flag_, touched_;
  std::vector<std::int32_t> hit_begin_, scratch_;
};

}  // namespace langgs
