// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

#include "langgs/device/launch.hpp"
#include "langgs/render/contributions.hpp"
#include "langgs/render/feature_channels.hpp"

namespace langgs {

/// F(p) = sum_i w_i f_i (paper Eq. 4) for any FeatDim: a warp composites a block of channels of its pixels before the
/// next block, so that the rows of a patch's Gaussians stay in a cache. What becomes of the image is the sink's
/// business: it is called as sink(warp, p, c, values) and may write the image or look at it and forget it.
template <int FeatDim, class Scalar, class Sink>
struct CompositeFeatures {
  using Channels = FeatureChannels<FeatDim>;
  static constexpr int kThreads = 128;
  static constexpr int kWarps = kThreads / 32;
  template <class Block>
  struct Shared {};

  ContributionView contributions;
  const Scalar* features;  ///< [N, FeatDim]
  Sink sink;

  template <class Block>
  LANGGS_HD void operator()(Block& block, Shared<Block>&) const {
    using F = VaryingOf<float, Block>;
    const FeaturePatches patches{contributions.width, contributions.height};
    block.warps([&](const auto& warp) {
      for (int c = 0; c < FeatDim; c += Channels::kBlock)
        patches.template for_each_pixel<kWarps>(block.index(), warp.index(), [&](int p) LANGGS_INLINE_LAMBDA {
          typename Channels::template Values<F> sum;
          for (int i = contributions.begin[p]; i < contributions.begin[p + 1]; ++i)
            sum.add(warp, contributions.contribution[i].weight, Channels::row(features, contributions.gaussian[i]), c);
          sink(warp, p, c, sum);
        });
    });
  }
};

/// Writes an image [height, width, FeatDim] of floats or halves.
template <int FeatDim, class T>
struct FeatureImageSink {
  T* image;

  template <class Warp, class Values>
  LANGGS_INLINE void operator()(const Warp& warp, int p, int c, const Values& values) const {
    using Channels = FeatureChannels<FeatDim>;
    LANGGS_UNROLL for (int v = 0; v < Channels::kVectors; ++v)
        warp.stream_channels(Channels::row(image, p) + c + 32 * v, Channels::count(c, v), values.vector[v]);
  }
};

/// Renders features and hands them to `sink`, see CompositeFeatures; `features` is [N, FeatDim], floats or halves.
template <int FeatDim, class Backend, class Scalar, class Sink>
void stream_features(const Executor<Backend>& executor, const ContributionView& contributions, const Scalar* features,
                     const Sink& sink) {
  launch(executor, FeaturePatches{contributions.width, contributions.height}.count(),
         CompositeFeatures<FeatDim, Scalar, Sink>{contributions, features, sink});
}

/// Renders an image of features [height, width, FeatDim], floats or halves.
template <int FeatDim, class Backend, class Scalar, class T>
void composite_features(const Executor<Backend>& executor, const ContributionView& contributions,
                        const Scalar* features, T* image) {
  stream_features<FeatDim>(executor, contributions, features, FeatureImageSink<FeatDim, T>{image});
}

}  // namespace langgs
