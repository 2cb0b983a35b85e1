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

/// Adam on the geometry of the Gaussians that a view has seen; the others keep their values and moments.
template <class Backend>
class SelectiveAdam {
 public:
  explicit SelectiveAdam(const LearningRates& rates = {}) : rates_(rates) {}

  template <int FeatDim>
  void step(const Executor<Backend>& executor, GaussianMap<FeatDim, Backend>& map,
            const MapGradient<Backend>& gradient) const {
    Update update{map.geometry(),
                  map.first_moment.geometry.view(),
                  map.second_moment.geometry.view(),
                  gradient.planes(),
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
    for_each_lanes(executor, gradient.size(), update);
  }

 private:
  struct Update {
    PlanesView parameters, first, second, gradient;
    const std::int32_t* gaussian;
    AdamRule rule;
    float rate[kNumPlanes];

    template <class Lanes>
    LANGGS_HD void operator()(const Lanes& lanes) const {
      const auto who = lanes.load(gaussian);
      for (int plane = 0; plane < kNumPlanes; ++plane) {
        auto m = lanes.gather(first.plane(plane), who);
        auto v = lanes.gather(second.plane(plane), who);
        const auto step = rule.direction(lanes.load(gradient.plane(plane)), m, v);
        const auto value = lanes.gather(parameters.plane(plane), who) - rate[plane] * step;
        lanes.scatter(first.plane(plane), who, m);
        lanes.scatter(second.plane(plane), who, v);
        lanes.scatter(parameters.plane(plane), who, value);
      }
    }
  };

  LearningRates rates_;
};

}  // namespace langgs
