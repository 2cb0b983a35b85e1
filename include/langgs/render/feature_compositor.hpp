// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

#include "langgs/device/launch.hpp"
#include "langgs/render/contributions.hpp"

namespace langgs {

/// F(p) = sum_i w_i f_i (paper Eq. 4), one warp a pixel, 32 channels at a time. Any FeatDim.
template <int FeatDim>
struct CompositeFeatures {
  static constexpr int kThreads = 128;
  static constexpr int kWarps = kThreads / 32;
  template <class Block>
  struct Shared {};

  ContributionView contributions;
  const float* features;  ///< [N, FeatDim]
  float* out;             ///< [num_pixels, FeatDim]

  template <class Block>
  LANGGS_HD void operator()(Block& block, Shared<Block>&) const {
    using F = VaryingOf<float, Block>;
    block.warps([&](const auto& warp) {
      const int p = block.index() * kWarps + warp.index();
      if (p >= contributions.num_pixels) return;
      for (int c = 0; c < FeatDim; c += 32) {
        F sum(0.f);
        for (int i = contributions.begin[p]; i < contributions.begin[p + 1]; ++i) {
          const std::ptrdiff_t row = static_cast<std::ptrdiff_t>(contributions.gaussian[i]) * FeatDim;
          sum += contributions.weight[i] * warp.load(features + row + c);
        }
        warp.template store_rect<32>(out + static_cast<std::ptrdiff_t>(p) * FeatDim + c, 0, FeatDim - c, 1, sum);
      }
    });
  }
};

/// Renders features [num_pixels, FeatDim] from per-Gaussian features [N, FeatDim], which must be a padded Buffer.
template <int FeatDim, class Backend>
void composite_features(const Executor<Backend>& executor, const ContributionView& contributions, const float* features,
                        float* out) {
  using Kernel = CompositeFeatures<FeatDim>;
  launch(executor, (contributions.num_pixels + Kernel::kWarps - 1) / Kernel::kWarps,
         Kernel{contributions, features, out});
}

}  // namespace langgs
