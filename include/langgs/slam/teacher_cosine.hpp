// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "langgs/core/half.hpp"
#include "langgs/device/copy.hpp"
#include "langgs/render/contributions.hpp"
#include "langgs/render/feature_compositor.hpp"

namespace langgs {

namespace detail {

/// Sums over the channels of each pixel: F . F*, F . F, F* . F*.
template <int FeatDim>
struct CosineSums {
  const Half* teacher;  ///< [num_pixels, FeatDim]
  float* sums;          ///< [num_pixels, 3]

  template <class Warp, class Values>
  LANGGS_INLINE void operator()(const Warp& warp, int p, int c, const Values& rendered) const {
    using Channels = FeatureChannels<FeatDim>;
    auto product = rendered.vector[0] * 0.f, own = product, other = product;
    LANGGS_UNROLL for (int v = 0; v < Channels::kVectors; ++v) {
      const auto target = warp.load_channels(Channels::row(teacher, p) + c + 32 * v, Channels::count(c, v));
      product += rendered.vector[v] * target;
      own += rendered.vector[v] * rendered.vector[v];
      other += target * target;
    }
    const float all[3] = {warp.sum(product), warp.sum(own), warp.sum(other)};
    for (int k = 0; k < 3; ++k) warp.store_uniform(sums + 3 * p + k, (c == 0 ? 0.f : sums[3 * p + k]) + all[k]);
  }
};

}  // namespace detail

/// How near rendered features come to their teachers: the mean over pixels of cos(F, F*).
struct TeacherCosine {
  double sum = 0;
  std::int64_t pixels = 0;

  [[nodiscard]] double mean() const { return pixels > 0 ? sum / static_cast<double>(pixels) : 0; }

  /// Adds the pixels of one teacher [num_pixels, FeatDim], in the backend's memory, that have contributions;
  /// `contributions` must leave out what it has no feature for.
  template <int FeatDim, class Backend, class Scalar>
  void add(const Executor<Backend>& executor, const ContributionView& contributions, const Scalar* features,
           const Half* teacher) {
    const std::size_t n = contributions.num_pixels();
    std::vector<float> sums(3 * n);
    compute_to_host(executor, sums.data(), sums.size(), [&](float* to) {
      stream_features<FeatDim>(executor, contributions, features, detail::CosineSums<FeatDim>{teacher, to});
    });
    Download<std::int32_t, Backend> download;
    const std::int32_t* const begin = download(executor, contributions.begin, n + 1);
    for (std::size_t p = 0; p < n; ++p) {
      if (begin[p] == begin[p + 1]) continue;
      const double own = static_cast<double>(sums[3 * p + 1]), other = static_cast<double>(sums[3 * p + 2]);
      if (own > 0 && other > 0) sum += static_cast<double>(sums[3 * p]) / std::sqrt(own * other);
      ++pixels;
    }
  }
};

}  // namespace langgs
