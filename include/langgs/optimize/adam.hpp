// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "langgs/core/config.hpp"
#include "langgs/device/block.hpp"
#include "langgs/device/launch.hpp"
#include "langgs/device/math.hpp"
#include "langgs/map/gaussian_map.hpp"
#include "langgs/optimize/learning_rates.hpp"
#include "langgs/render/map_gradient.hpp"

namespace langgs {

/// One Adam update (Kingma & Ba 2015) without bias correction, so that a row that is seldom seen needs no step counter.
/// A fresh row's first step is then about 3 learning rates long.
struct AdamRule {
  float beta1, beta2, epsilon;

  /// Updates the moments and returns the step to subtract, before the learning rate.
  template <class V>
  [[nodiscard]] LANGGS_INLINE V direction(const V& gradient, V& first, V& second) const {
    first = beta1 * first + (1.f - beta1) * gradient;
    second = beta2 * second + (1.f - beta2) * (gradient * gradient);
    return first / (sqrt(second) + epsilon);
  }
};

namespace detail {

/// Adam on the visible rows of all planes. A block has a piece of one plane: few streams of memory at a time, which
/// hardware prefetchers can follow.
struct AdamUpdate {
  static constexpr int kThreads = 256, kRows = 2048;  ///< of a block
  template <class Block>
  struct Shared {};
  PlanesView parameters, first_moment, second_moment, gradient;
  ListSize columns;  ///< of the gradient
  const std::int32_t* gaussian;
  AdamRule rule;
  float rate[kNumPlanes];

  [[nodiscard]] LANGGS_INLINE int blocks_per_plane() const { return (columns.most + kRows - 1) / kRows; }

  template <class Block>
  LANGGS_HD void operator()(Block& block, Shared<Block>&) const {
    using V = typename Block::template Varying<float>;
    const int plane = block.index() / blocks_per_plane();
    const int begin = (block.index() - plane * blocks_per_plane()) * kRows;
    const int size = columns.get();
    float *const parameter = parameters.plane(plane), *const first = first_moment.plane(plane),
                 *const second = second_moment.plane(plane);
    block.warps([&](const auto& warp) {
      for (int i = 0; i < kRows / Block::kWarps; i += 32) {
        const int column = begin + warp.index() * (kRows / Block::kWarps) + i, left = size - column;
        if (left <= 0) break;
        const V g = warp.load(gradient.plane(plane) + column);
        const auto who = warp.load(gaussian + column);
        // Gaussians that were inserted together are often seen together.
        const int row = gaussian[column];
        if (left >= 32 && warp.all(who == warp.lane_index() + row)) {
          V m = warp.load(first + row), v = warp.load(second + row);
          warp.store(parameter + row, warp.load(parameter + row) - rate[plane] * rule.direction(g, m, v));
          warp.store(first + row, m);
          warp.store(second + row, v);
        } else {
          const auto wanted = warp.lane_index() < left;
          V m = warp.gather(first, who, wanted, 0.f), v = warp.gather(second, who, wanted, 0.f);
          const V before = warp.gather(parameter, who, wanted, 0.f);
          warp.scatter(parameter, who, wanted, before - rate[plane] * rule.direction(g, m, v));
          warp.scatter(first, who, wanted, m);
          warp.scatter(second, who, wanted, v);
        }
      }
    });
  }
};

}  // namespace detail

/// What SelectiveAdam works on: [14, N] each.
struct AdamPlanes {
  PlanesView parameters, first_moment, second_moment;
};

/// Adam on the geometry of the Gaussians that a view has seen; the others keep their values and moments.
template <class Backend>
class SelectiveAdam {
 public:
  explicit SelectiveAdam(const LearningRates& rates = {}) : rates_(rates) {}

  template <class Map>
  void step(const Executor<Backend>& executor, Map& map, const MapGradient<Backend>& gradient) const {
    step(executor, {map.geometry(), map.first_moment.view(), map.second_moment.view()}, gradient);
  }

  void step(const Executor<Backend>& executor, const AdamPlanes& planes, const MapGradient<Backend>& gradient) const {
    detail::AdamUpdate update{planes.parameters,
                              planes.first_moment,
                              planes.second_moment,
                              gradient.planes(),
                              gradient.columns(),
                              gradient.gaussian(),
                              {rates_.beta1, rates_.beta2, rates_.epsilon},
                              {}};
    for (int a = 0; a < 3; ++a) {
      update.rate[kMeanX + a] = rates_.mean;
      update.rate[kLogScaleX + a] = rates_.log_scale;
      update.rate[kRed + a] = rates_.colour;
    }
    for (int a = 0; a < 4; ++a) update.rate[kRotationW + a] = rates_.rotation;
    update.rate[kOpacityLogit] = rates_.opacity_logit;
    launch(executor, kNumPlanes * update.blocks_per_plane(), update);
  }

 private:
  LearningRates rates_;
};

}  // namespace langgs
