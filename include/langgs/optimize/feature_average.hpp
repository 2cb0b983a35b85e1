// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstdint>

#include "langgs/core/error.hpp"
#include "langgs/core/half.hpp"
#include "langgs/device/launch.hpp"
#include "langgs/map/feature_storage.hpp"
#include "langgs/map/gaussian_map.hpp"
#include "langgs/optimize/feature_hits.hpp"
#include "langgs/render/feature_channels.hpp"

namespace langgs {

namespace detail {

/// One touched Gaussian a warp: the weighted mean of its teachers moves its feature. Nothing is rendered.
template <int FeatDim, class Scalar>
struct AverageUpdate {
  using Channels = FeatureChannels<FeatDim>;
  static constexpr int kThreads = 128;
  static constexpr int kWarps = kThreads / 32;
  static constexpr int kAhead = 2;  ///< teachers that are under way while one is added
  template <class Block>
  struct Shared {};

  FeatureHitsView hits;
  const Half* teacher;  ///< [num_pixels, FeatDim]
  Scalar* features;     ///< [N, FeatDim]
  float* confidence;    ///< [N]
  float prior, window;

  template <class Block>
  LANGGS_HD void operator()(Block& block, Shared<Block>&) const {
    using F = VaryingOf<float, Block>;
    block.warps([&](const auto& warp) {
      const int n = block.index() * kWarps + warp.index();
      if (n >= hits.num_touched.get()) return;
      const int g = hits.touched[n].gaussian, begin = hits.touched[n].begin, end = hits.touched[n].end;
      hits.prefetch(warp, n, features, FeatDim);
      float weight = 0;
      for (int h = begin; h < end; ++h) weight += hits.hits[h].weight;
      const float known = min(max(confidence[g], prior), window), share = 1.f / (known + weight);
      Scalar* const feature = Channels::row(features, g);
      for (int c = 0; c < FeatDim; c += Channels::kBlock) {
        typename Channels::template Values<F> sum;
        sum.add(warp, known, feature, c);
        for (int h = begin; h < end; ++h) {
          if (h + kAhead < end)
            warp.prefetch(Channels::row(teacher, hits.hits[h + kAhead].pixel) + c, Channels::bytes(teacher, c));
          sum.add(warp, hits.hits[h].weight, Channels::row(teacher, hits.hits[h].pixel), c);
        }
        LANGGS_UNROLL for (int v = 0; v < Channels::kVectors; ++v)
            warp.store_channels(feature + c + 32 * v, Channels::count(c, v), sum.vector[v] * share);
      }
      warp.store_uniform(confidence + g, known + weight);
    });
  }
};

}  // namespace detail

/// Features without moments and without rendering: each Gaussian keeps the weighted mean of the teachers that Top-K has
/// assigned to it,
///   f <- (c f + sum_p w'_p F*_p) / (c + sum_p w'_p),   c <- c + sum_p w'_p,
/// the sums being over the pixels p of a view that have it among their Top-K (w' of paper Eq. 3) and c the confidence
/// so far, counted in pixels. The weights are constants and features are smooth, so this is nearly the closed form of
/// what the gradient steps of paper section 3.4 approach; docs/benchmarks.md compares the two.
template <class T = Half>
struct FeatureAverage {
  using Scalar = T;
  template <int FeatDim, class Backend>
  struct State {
    Rows<float, Backend> confidence;  ///< c [pixels]
    template <class F>
    void for_each_array(F&& f) {
      f(confidence);
    }
  };
  template <int FeatDim, class Backend>
  struct Scratch {
    [[nodiscard]] std::size_t bytes() const { return 0; }
  };

  float prior = 1;    ///< confidence of the feature that a Gaussian is inserted with [pixels]
  float window = 64;  ///< most confidence that counts: what is older fades [pixels]

  void check() const {
    LANGGS_EXPECTS(prior >= 0 && prior <= window && window > 0 && window <= 1e9f, "prior and window are ", prior,
                   " and ", window, "; they must satisfy 0 <= prior <= window <= 1e9 and 0 < window");
  }

  /// `hits` are those of the pixels of `teacher` [num_pixels, FeatDim], in the backend's memory.
  template <int FeatDim, class Backend, class Storage>
  void step(const Executor<Backend>& executor, GaussianMap<FeatDim, Backend, Storage>& map, const ContributionView&,
            const FeatureHitsView& hits, const Half* teacher, Scratch<FeatDim, Backend>&) const {
    using Update = detail::AverageUpdate<FeatDim, typename Storage::Scalar>;
    launch(executor, (hits.num_touched.most + Update::kWarps - 1) / Update::kWarps,
           Update{hits, teacher, map.features().data(), map.feature_state.confidence.data(), prior, window});
  }
};

}  // namespace langgs
