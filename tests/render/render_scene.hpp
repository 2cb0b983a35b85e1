// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <cstdint>
#include <vector>

#include "langgs/core/rng.hpp"
#include "langgs/map/gaussian_map.hpp"
#include "langgs/render/view.hpp"
#include "reference/naive_renderer.hpp"

/// @file Random scenes for the rasteriser's tests, as a map and as the oracle's scene with exactly the same values.

namespace langgs::test {

struct RenderScene {
  Camera camera;
  Pose T_world_camera = Pose::Identity();
  std::vector<Gaussian<1>> gaussians;

  [[nodiscard]] View view() const { return View(camera, T_world_camera); }
  [[nodiscard]] GaussianMap<1> map() const {
    GaussianMap<1> result;
    result.append(gaussians, 0, 0);
    return result;
  }
  [[nodiscard]] reference::NaiveScene naive() const {
    reference::NaiveScene scene{camera, T_world_camera.inverse(), {}};
    for (const Gaussian<1>& g : gaussians)
      scene.gaussians.push_back({g.mean.cast<double>(), g.log_scale.cast<double>(), g.rotation.cast<double>(),
                                 static_cast<double>(g.opacity_logit), g.colour.cast<double>(),
                                 Eigen::VectorXd::Constant(1, static_cast<double>(g.feature[0]))});
    return scene;
  }
};

/// Ranges from which the Gaussians of a scene are drawn; log-uniform where both ends are positive scales.
struct SceneRanges {
  double near = 0.4, far = 4;            ///< depth [m]
  double border = 0.3;                   ///< centres lie up to this share of the image outside of it
  double thinnest = 0.3, thickest = 12;  ///< standard deviations on the image [px]
  double least_opacity = 0.02, greatest_opacity = 0.97;
};

[[nodiscard]] inline double between(double low, double high, double u) { return low + (high - low) * u; }
[[nodiscard]] inline double log_between(double low, double high, double u) { return low * std::pow(high / low, u); }

/// A camera off centre, with fx != fy, looking from somewhere.
[[nodiscard]] inline RenderScene empty_scene(int width, int height) {
  RenderScene scene;
  const float w = static_cast<float>(width), h = static_cast<float>(height);
  scene.camera = {1.1f * w + 5, 1.2f * w + 5, 0.41f * w, 0.63f * h, width, height};
  Twist pose;
  pose << 0.3, -0.2, 0.5, 0.4, -0.7, 0.3;
  scene.T_world_camera = se3_exp(pose);
  return scene;
}

[[nodiscard]] inline RenderScene random_scene(int width, int height, int count, const SceneRanges& r,
                                              std::uint64_t seed) {
  RenderScene scene = empty_scene(width, height);
  for (int i = 0; i < count; ++i) {
    const CounterRng rng{seed, static_cast<std::uint64_t>(i)};
    const double u = between(-r.border, 1 + r.border, rng.uniform(0)) * width;
    const double v = between(-r.border, 1 + r.border, rng.uniform(1)) * height;
    const double z = log_between(r.near, r.far, rng.uniform(2));
    Gaussian<1> g;
    g.mean = (scene.T_world_camera * scene.camera.back_project(u, v, z)).cast<float>();
    for (int a = 0; a < 3; ++a) {
      const double pixels = log_between(r.thinnest, r.thickest, rng.uniform(3 + a));
      g.log_scale[a] = static_cast<float>(std::log(pixels * z / static_cast<double>(scene.camera.fx)));
      g.colour[a] = static_cast<float>(rng.uniform(6 + a));
    }
    for (int a = 0; a < 4; ++a) g.rotation[a] = static_cast<float>(1.7 * rng.normal(10 + a));
    const double o = between(r.least_opacity, r.greatest_opacity, rng.uniform(40));
    g.opacity_logit = static_cast<float>(std::log(o / (1 - o)));
    g.feature[0] = static_cast<float>(rng.normal(30));
    scene.gaussians.push_back(g);
  }
  return scene;
}

}  // namespace langgs::test
