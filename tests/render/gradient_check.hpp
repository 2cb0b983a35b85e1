// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "langgs/device/copy.hpp"
#include "langgs/render/map_gradient.hpp"
#include "reference/central_difference.hpp"
#include "render/render_scene.hpp"
#include "support/backend.hpp"

/// @file Gradients of the kernels against central differences of the oracle.

namespace langgs::test {

/// A sum over the oracle's pixels, without those where a perturbation could cross one of the rasteriser's thresholds.
class OracleLoss {
 public:
  /// What pixel i of the image adds. May set `crossed`, where it has decisions of its own.
  using Term = std::function<double(int i, const reference::NaivePixel& pixel)>;

  explicit OracleLoss(const RenderScene& scene) : scene_(scene.naive()) {
    const reference::NaiveRenderer oracle(scene_);
    for (int i = 0; i < scene.camera.num_pixels(); ++i) {
      const reference::NaivePixel pixel = oracle.pixel(i % scene.camera.width, i / scene.camera.width);
      decisions_.push_back(pixel.decisions);
      counts_.push_back(pixel.margin >= 3e-3);
      num_pixels_ += counts_.back() ? 1 : 0;
    }
  }

  /// The oracle's loss. Sets `crossed` where a pixel that counts met another decision than in the unperturbed scene.
  [[nodiscard]] double operator()() {
    const reference::NaiveRenderer oracle(scene_);
    double loss = 0;
    for (int i = 0; i < scene_.camera.num_pixels(); ++i) {
      if (!counts_[i]) continue;
      oracle.pixel(i % scene_.camera.width, i / scene_.camera.width, pixel_);
      crossed = crossed || pixel_.decisions != decisions_[i];
      loss += term(i, pixel_);
    }
    return loss;
  }
  /// dL/d(variable), with a smaller step where a threshold is crossed.
  [[nodiscard]] double slope(double& variable) {
    double step = 2e-5;
    for (int attempt = 0; attempt < 4; ++attempt, step /= 8) {
      crossed = false;
      const double result = reference::central_difference(*this, variable, step);
      if (!crossed) return result;
    }
    FAIL("no step avoids the thresholds");
    return 0;
  }

  [[nodiscard]] reference::NaiveScene& scene() { return scene_; }
  /// Whether pixel i is part of the loss, and how many are.
  [[nodiscard]] bool counts(int i) const { return counts_[i]; }
  [[nodiscard]] int num_pixels() const { return num_pixels_; }
  Term term;
  bool crossed = false;

 private:
  reference::NaiveScene scene_;
  std::vector<std::uint64_t> decisions_;
  std::vector<bool> counts_;
  reference::NaivePixel pixel_;
  int num_pixels_ = 0;
};

struct KernelGradient {
  template <class Backend>
  KernelGradient(const Executor<Backend>& executor, const MapGradient<Backend>& gradient, std::size_t num_gaussians)
      : gaussians(num_gaussians), pose(gradient.pose()) {
    std::vector<std::int32_t> gaussian(gradient.size());
    std::vector<float> plane(gradient.size());
    copy_to_host(executor, gradient.gaussian(), gaussian.size(), gaussian.data());
    for (int p = 0; p < kNumPlanes; ++p) {
      copy_to_host(executor, gradient.planes().plane(p), plane.size(), plane.data());
      for (std::size_t c = 0; c < plane.size(); ++c) gaussians[gaussian[c]][p] = static_cast<double>(plane[c]);
    }
  }
  std::vector<std::array<double, kNumPlanes>> gaussians;  ///< zero for those that are not visible
  Twist pose;
};

/// Differences and reference values of one group of parameters.
struct GradientGroup {
  std::string name;
  double error2 = 0, value2 = 0;
  int count = 0;

  void add(double kernel, double expected) {
    error2 += (kernel - expected) * (kernel - expected);
    value2 += expected * expected;
    ++count;
  }
  [[nodiscard]] double relative() const { return std::sqrt(error2 / value2); }
  void check(const std::string& scene, double tolerance) const {
    INFO(scene, ", ", name, ": rms relative error ", relative(), " of ", count, " values, rms ",
         std::sqrt(value2 / count));
    CHECK(value2 > 0);
    CHECK(relative() < tolerance);
  }
};

inline double& parameter(reference::NaiveGaussian& g, int plane) {
  if (plane < kLogScaleX) return g.mean[plane - kMeanX];
  if (plane < kRotationW) return g.log_scale[plane - kLogScaleX];
  if (plane < kOpacityLogit) return g.rotation[plane - kRotationW];
  return plane == kOpacityLogit ? g.opacity_logit : g.colour[plane - kRed];
}

/// Compares the planes [0, num_planes) of about twelve Gaussians, which is enough, and the pose. Fewer on a slow
/// backend: the oracle takes the time.
inline void check_gradients(const KernelGradient& kernel, OracleLoss& loss, const std::string& name,
                            double tolerance = 1e-4, int num_planes = kNumPlanes) {
  std::vector<GradientGroup> groups{{"means"}, {"log-scales"}, {"rotations"}, {"opacities"}};
  if (num_planes > kRed) groups.push_back({"colours"});
  const auto group_of = [&](int plane) -> GradientGroup& {
    return groups[plane < kLogScaleX ? 0 : plane < kRotationW ? 1 : plane < kOpacityLogit ? 2 : plane < kRed ? 3 : 4];
  };
  const std::size_t size = kernel.gaussians.size();
  for (std::size_t i = 0; i < size; i += 1 + size / (kIsSlow ? 5 : 12))
    for (int plane = 0; plane < num_planes; ++plane)
      group_of(plane).add(kernel.gaussians[i][plane], loss.slope(parameter(loss.scene().gaussians[i], plane)));
  for (const GradientGroup& group : groups) group.check(name, tolerance);

  GradientGroup pose{"pose"};
  const Pose T_camera_world = loss.scene().T_camera_world;
  for (int a = 0; a < 6; ++a) {
    double amount = 0;
    const auto perturbed = [&] {
      Twist tau = Twist::Zero();
      tau[a] = amount;
      loss.scene().T_camera_world = se3_exp(tau) * T_camera_world;
      return loss();
    };
    double step = 1e-6, slope = 0;
    for (int attempt = 0; attempt < 4; ++attempt, step /= 4) {
      loss.crossed = false;
      slope = reference::central_difference(perturbed, amount, step);
      if (!loss.crossed) break;
    }
    REQUIRE(!loss.crossed);
    pose.add(kernel.pose[a], slope);
  }
  loss.scene().T_camera_world = T_camera_world;
  pose.check(name, tolerance);
}

}  // namespace langgs::test
