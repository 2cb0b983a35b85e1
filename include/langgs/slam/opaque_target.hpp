// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include "langgs/map/planes.hpp"
#include "langgs/slam/settings.hpp"

namespace langgs {

/// The Gaussians of `g`, in the host's memory, that are opaque enough to track against.
[[nodiscard]] inline std::shared_ptr<const GicpTarget> opaque_target(const PlanesView& g,
                                                                     const TrackingSettings& settings) {
  const float min_logit = std::log(settings.min_target_opacity / (1 - settings.min_target_opacity));
  std::vector<Eigen::Vector3f> means, scales;
  std::vector<Eigen::Vector4f> rotations;
  for (int i = 0; i < g.size; ++i) {
    if (!(g.plane(kOpacityLogit)[i] > min_logit)) continue;
    means.emplace_back(g.plane(kMeanX)[i], g.plane(kMeanY)[i], g.plane(kMeanZ)[i]);
    rotations.emplace_back(g.plane(kRotationW)[i], g.plane(kRotationX)[i], g.plane(kRotationY)[i],
                           g.plane(kRotationZ)[i]);
    scales.emplace_back(std::exp(g.plane(kLogScaleX)[i]), std::exp(g.plane(kLogScaleY)[i]),
                        std::exp(g.plane(kLogScaleZ)[i]));
  }
  return std::make_shared<const GicpTarget>(
      GicpTarget::from_gaussians(std::move(means), rotations, scales, settings.target_shape));
}

}  // namespace langgs
