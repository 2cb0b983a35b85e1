// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

#include "langgs/core/error.hpp"
#include "langgs/core/half.hpp"
#include "langgs/device/buffer.hpp"
#include "langgs/device/launch.hpp"
#include "langgs/map/feature_storage.hpp"
#include "langgs/map/gaussian_map.hpp"
#include "langgs/optimize/adam.hpp"
#include "langgs/optimize/feature_hits.hpp"
#include "langgs/render/feature_compositor.hpp"

namespace langgs {

namespace detail {

/// Keeps the signs of rendered minus teacher, one bit for each channel of a pixel: all that the gradient of an L1 loss
/// needs.
template <int FeatDim>
struct FeatureSigns {
  static constexpr int kWords = (FeatDim + 31) / 32;

  const Half* teacher;   ///< [num_pixels, FeatDim]
  std::uint32_t* signs;  ///< [num_pixels, kWords]; bit set where rendered > teacher

  template <class Warp, class Values>
  LANGGS_INLINE void operator()(const Warp& warp, int p, int c, const Values& rendered) const {
    using Channels = FeatureChannels<FeatDim>;
    LANGGS_UNROLL for (int v = 0; v < Channels::kVectors; ++v) {
      const int count = Channels::count(c, v);
      if (count <= 0) continue;
      const auto target = warp.load_channels(Channels::row(teacher, p) + c + 32 * v, count);
      warp.store_uniform(signs + static_cast<std::ptrdiff_t>(p) * kWords + c / 32 + v,
                         warp.ballot(rendered.vector[v] > target));
    }
  }
};

/// Gathers dL/df of one Gaussian a warp from signs and weights and applies Adam to its row.
template <int FeatDim, class Scalar>
struct AdamFeatureUpdate {
  using Channels = FeatureChannels<FeatDim>;
  static constexpr int kThreads = 128;
  static constexpr int kWarps = kThreads / 32;
  static constexpr int kWords = FeatureSigns<FeatDim>::kWords;
  template <class Block>
  struct Shared {};

  FeatureHitsView hits;
  const std::uint32_t* signs;
  float scale, rate;
  AdamRule rule;
  Scalar* features;       ///< [N, FeatDim]
  float *first, *second;  ///< [N, FeatDim]

  template <class Block>
  LANGGS_HD void operator()(Block& block, Shared<Block>&) const {
    using F = VaryingOf<float, Block>;
    block.warps([&](const auto& warp) {
      const int n = block.index() * kWarps + warp.index();
      if (n >= hits.num_touched.get()) return;
      const TouchedGaussian touched = hits.touched[n];  // clang 14 captures no structured bindings
      const std::int32_t g = touched.gaussian, begin = touched.begin, end = touched.end;
      hits.prefetch(warp, n, features, FeatDim);
      for (int c = 0; c < FeatDim; c += Channels::kBlock) {
        typename Channels::template Values<F> gradient;
        for (int h = begin; h < end; ++h) {
          const float w = hits.hits[h].weight;
          const std::uint32_t* const word = signs + static_cast<std::ptrdiff_t>(hits.hits[h].pixel) * kWords + c / 32;
          LANGGS_UNROLL for (int v = 0; v < Channels::kVectors; ++v) if (Channels::count(c, v) > 0)
              gradient.vector[v] += select(warp.unballot(word[v]), F(w), F(-w));
        }
        LANGGS_UNROLL for (int v = 0; v < Channels::kVectors; ++v) {
          const int count = Channels::count(c, v), at = c + 32 * v;
          if (count <= 0) continue;
          const auto row = [&](auto* base) { return Channels::row(base, g) + at; };
          F m = warp.load_channels(row(first), count), s = warp.load_channels(row(second), count);
          const F step = rule.direction(gradient.vector[v] * scale, m, s);
          warp.store_channels(row(features), count, warp.load_channels(row(features), count) - rate * step);
          warp.store_channels(row(first), count, m);
          warp.store_channels(row(second), count, s);
        }
      }
    });
  }
};

}  // namespace detail

/// Adam on L_feat = mean |F - F*| over the pixels and channels of the teacher (paper section 3.4), without a feature
/// image, a gradient buffer or atomics. What the paper has, and the reference that FeatureAverage is measured against.
template <class T = float>
struct FeatureAdam {
  using Scalar = T;
  template <int FeatDim, class Backend>
  struct State {
    Rows<float, Backend> first{FeatDim}, second{FeatDim};  ///< moments
    template <class F>
    void for_each_array(F&& f) {
      f(first);
      f(second);
    }
  };
  template <int FeatDim, class Backend>
  struct Scratch {
    Buffer<std::uint32_t, Backend> signs;
    [[nodiscard]] std::size_t bytes() const { return signs.bytes(); }
  };

  float rate = 1e-3f;  ///< length of a step in each channel, nearly
  float beta1 = 0.9f, beta2 = 0.999f, epsilon = 1e-15f;

  void check() const {
    LANGGS_EXPECTS(rate >= 0 && rate <= 1e3f, "feature learning rate is ", rate, "; it must be in [0, 1000]");
    LANGGS_EXPECTS(beta1 >= 0 && beta1 < 1 && beta2 >= 0 && beta2 < 1 && epsilon > 0, "Adam settings are ", beta1, ", ",
                   beta2, ", ", epsilon, "; betas must be in [0, 1), epsilon positive");
  }

  /// `contributions` and `hits` are those of the pixels of `teacher` [num_pixels, FeatDim], in the backend's memory.
  template <int FeatDim, class Backend, class Storage>
  void step(const Executor<Backend>& executor, GaussianMap<FeatDim, Backend, Storage>& map,
            const ContributionView& contributions, const FeatureHitsView& hits, const Half* teacher,
            Scratch<FeatDim, Backend>& scratch) const {
    using Signs = detail::FeatureSigns<FeatDim>;
    using Update = detail::AdamFeatureUpdate<FeatDim, typename Storage::Scalar>;
    scratch.signs.resize_discard(executor, static_cast<std::size_t>(contributions.num_pixels()) * Signs::kWords);
    stream_features<FeatDim>(executor, contributions, map.features().data(), Signs{teacher, scratch.signs.data()});
    const float scale = 1.f / (static_cast<float>(contributions.num_pixels()) * FeatDim);
    launch(executor, (hits.num_touched.most + Update::kWarps - 1) / Update::kWarps,
           Update{hits,
                  scratch.signs.data(),
                  scale,
                  rate,
                  {beta1, beta2, epsilon},
                  map.features().data(),
                  map.feature_state.first.data(),
                  map.feature_state.second.data()});
  }
};

}  // namespace langgs
