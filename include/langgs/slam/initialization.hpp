// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "langgs/core/camera.hpp"
#include "langgs/core/error.hpp"
#include "langgs/frame/feature_map.hpp"
#include "langgs/map/gaussian.hpp"
#include "langgs/track/source_cloud.hpp"

namespace langgs {

/// How a source point becomes a Gaussian of the map.
struct InitializationSettings {
  /// Opacity of a new Gaussian. The backbone's 0.1 relies on some hundred iterations per keyframe; a CPU has fewer.
  float opacity = 0.7f;
  /// Standard deviation along the surface relative to the spacing of the source grid at the point's depth.
  float spread = 0.6f;
  float thickness = 0.2f;  ///< standard deviation across the surface relative to along it
};

inline void validate(const InitializationSettings& s) {
  LANGGS_EXPECTS(s.opacity > 0 && s.opacity < 1, "initial opacity is ", s.opacity, "; it must be between 0 and 1");
  LANGGS_EXPECTS(s.spread >= 1e-3f && s.spread <= 1e3f && s.thickness >= 1e-3f && s.thickness <= 1e3f,
                 "initial spread and thickness are ", s.spread, " and ", s.thickness,
                 "; they must be in [0.001, 1000]");
}

/// New Gaussians from the chosen points of a source cloud (paper sections 3 and 3.3.2): geometric attributes from
/// tracking, feature sampled from the frame's feature map (zeros without one).
template <int FeatDim>
[[nodiscard]] std::vector<Gaussian<FeatDim>> make_gaussians(const SourceCloud& cloud,
                                                            const std::vector<std::int32_t>& chosen,
                                                            const RgbdFrame& frame, const Camera& camera,
                                                            const FeatureMap<FeatDim>& features,
                                                            const Pose& T_world_camera,
                                                            const InitializationSettings& settings, int stride) {
  std::vector<Gaussian<FeatDim>> result(chosen.size());
  const Eigen::Quaternionf q_world_camera(T_world_camera.linear().cast<float>());
  for (std::size_t n = 0; n < chosen.size(); ++n) {
    const int i = chosen[n];
    Gaussian<FeatDim>& g = result[n];
    const Eigen::Vector2i pixel = cloud.pixels[i];
    const float z = cloud.points[i].z();
    g.mean = (T_world_camera * cloud.points[i].cast<double>()).template cast<float>();
    const Eigen::Vector4f& q = cloud.rotations[i];
    const Eigen::Quaternionf q_world = (q_world_camera * Eigen::Quaternionf(q[0], q[1], q[2], q[3])).normalized();
    g.rotation = {q_world.w(), q_world.x(), q_world.y(), q_world.z()};
    const float along = settings.spread * static_cast<float>(stride) * z / camera.fx;
    g.log_scale.template head<2>().setConstant(std::log(along));
    g.log_scale[2] = std::log(along * settings.thickness);
    g.opacity_logit = std::log(settings.opacity / (1 - settings.opacity));
    for (int c = 0; c < 3; ++c) g.colour[c] = static_cast<float>(frame.colour(pixel.x(), pixel.y(), c)) / 255.f;
    if (!features.empty()) features.sample(pixel.x(), pixel.y(), camera, g.feature.data());
  }
  return result;
}

}  // namespace langgs
