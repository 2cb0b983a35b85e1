// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "langgs/render/topk_rasterizer.hpp"
#include "reference/central_difference.hpp"
#include "render/render_scene.hpp"

using namespace langgs;
using test::random_scene;
using test::RenderScene;
using test::SceneRanges;

namespace {

/// L = <a, colour> + <b, depth> with random a and b, which are 0 at pixels where a perturbation could cross one of the
/// rasteriser's thresholds.
class RandomLoss {
 public:
  RandomLoss(const RenderScene& scene, std::uint64_t seed) : scene_(scene.naive()) {
    const reference::NaiveRenderer oracle(scene_);
    const int n = scene.camera.num_pixels();
    colour_.assign(3 * n, 0.f);
    depth_.assign(n, 0.f);
    for (int i = 0; i < n; ++i) {
      const reference::NaivePixel pixel = oracle.pixel(i % scene.camera.width, i / scene.camera.width);
      decisions_.push_back(pixel.decisions);
      if (pixel.margin < 3e-3) continue;
      ++num_pixels_;
      for (int c = 0; c < 3; ++c) colour_[c * n + i] = static_cast<float>(CounterRng{seed, 0}.normal(4 * i + c));
      depth_[i] = static_cast<float>(CounterRng{seed, 1}.normal(i));
    }
  }

  /// The oracle's loss. Sets `crossed` where a pixel that counts met another decision than in the unperturbed scene.
  [[nodiscard]] double operator()() {
    const reference::NaiveRenderer oracle(scene_);
    const int n = scene_.camera.num_pixels();
    double loss = 0;
    for (int i = 0; i < n; ++i) {
      if (depth_[i] == 0.f) continue;
      oracle.pixel(i % scene_.camera.width, i / scene_.camera.width, pixel_);
      crossed = crossed || pixel_.decisions != decisions_[i];
      for (int c = 0; c < 3; ++c) loss += static_cast<double>(colour_[c * n + i]) * pixel_.colour[c];
      loss += static_cast<double>(depth_[i]) * pixel_.depth;
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

  [[nodiscard]] RenderGradient upstream() const { return {colour_.data(), depth_.data()}; }
  [[nodiscard]] reference::NaiveScene& scene() { return scene_; }
  [[nodiscard]] int num_pixels() const { return num_pixels_; }
  bool crossed = false;

 private:
  reference::NaiveScene scene_;
  std::vector<float> colour_, depth_;
  std::vector<std::uint64_t> decisions_;
  reference::NaivePixel pixel_;
  int num_pixels_ = 0;
};

struct KernelGradient {
  std::vector<std::array<double, kNumPlanes>> gaussians;  ///< zero for those that are not visible
  Twist pose;
};

KernelGradient kernel_gradient(const RenderScene& scene, const RenderGradient& upstream) {
  const Executor<Host> executor;
  const GaussianMap<1> map = scene.map();
  TopKRasterizer<1> rasterizer;
  rasterizer.render(executor, map.geometry(), scene.view(), false);
  MapGradient<Host> gradient;
  rasterizer.backward(executor, map.geometry(), scene.view(), upstream, gradient);
  KernelGradient result{std::vector<std::array<double, kNumPlanes>>(scene.gaussians.size()), gradient.pose()};
  for (int c = 0; c < gradient.size(); ++c)
    for (int p = 0; p < kNumPlanes; ++p)
      result.gaussians[gradient.gaussian()[c]][p] = static_cast<double>(gradient.planes().plane(p)[c]);
  return result;
}

/// Differences and reference values of one group of parameters.
struct Group {
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

double& parameter(reference::NaiveGaussian& g, int plane) {
  if (plane < kLogScaleX) return g.mean[plane - kMeanX];
  if (plane < kRotationW) return g.log_scale[plane - kLogScaleX];
  if (plane < kOpacityLogit) return g.rotation[plane - kRotationW];
  return plane == kOpacityLogit ? g.opacity_logit : g.colour[plane - kRed];
}

void check_gradients(const RenderScene& scene, const std::string& name, double tolerance = 1e-4) {
  RandomLoss loss(scene, 77);
  const KernelGradient kernel = kernel_gradient(scene, loss.upstream());
  REQUIRE(loss.num_pixels() > scene.camera.num_pixels() / 3);

  Group groups[] = {{"means"}, {"log-scales"}, {"rotations"}, {"opacities"}, {"colours"}};
  const auto group_of = [&](int plane) -> Group& {
    return groups[plane < kLogScaleX ? 0 : plane < kRotationW ? 1 : plane < kOpacityLogit ? 2 : plane < kRed ? 3 : 4];
  };
  // About twelve Gaussians are enough; all of them are in the image and in the pose's gradient.
  for (std::size_t i = 0; i < scene.gaussians.size(); i += 1 + scene.gaussians.size() / 12)
    for (int plane = 0; plane < kNumPlanes; ++plane)
      group_of(plane).add(kernel.gaussians[i][plane], loss.slope(parameter(loss.scene().gaussians[i], plane)));
  for (const Group& group : groups) group.check(name, tolerance);

  Group pose{"pose"};
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
  pose.check(name, tolerance);
}

}  // namespace

TEST_CASE("gradients equal central differences: centres on and around the image, principal point off centre") {
  check_gradients(random_scene(37, 21, 25, {}, 1), "plain");
}

TEST_CASE("gradients equal central differences: images of one tile or less") {
  check_gradients(random_scene(16, 16, 12, {}, 2), "16x16");
  check_gradients(random_scene(5, 3, 8, {}, 3), "5x3");
}

TEST_CASE("gradients equal central differences: more Gaussians than a batch, early stops") {
  SceneRanges r;
  r.thinnest = 1;
  r.thickest = 4;
  r.border = 0;
  check_gradients(random_scene(17, 9, 90, r, 4), "many");
}

TEST_CASE("gradients equal central differences: close to the near plane") {
  SceneRanges r;
  r.near = 0.055;
  r.far = 0.2;
  check_gradients(random_scene(33, 20, 20, r, 5), "near plane");
}

TEST_CASE("gradients equal central differences: rays bounded at the frustum's margin") {
  SceneRanges r;
  r.border = 0.8;
  r.thinnest = 4;
  r.thickest = 25;
  r.greatest_opacity = 0.6;
  const RenderScene scene = random_scene(30, 20, 25, r, 6);
  int bounded = 0;
  const reference::NaiveRenderer oracle(scene.naive());
  for (const reference::NaiveSplat& s : oracle.splats()) bounded += s.ray_bounded ? 1 : 0;
  REQUIRE(bounded >= 5);
  check_gradients(scene, "bounded rays");
}

TEST_CASE("gradients equal central differences: clamped alphas") {
  SceneRanges r;
  r.least_opacity = 0.98;
  r.greatest_opacity = 0.9995;
  r.thinnest = 2;
  r.thickest = 10;
  check_gradients(random_scene(37, 21, 20, r, 7), "clamped alpha");
}

TEST_CASE("gradients equal central differences: needles and discs") {
  SceneRanges r;
  r.thinnest = 0.02;
  r.thickest = 15;
  check_gradients(random_scene(37, 21, 25, r, 8), "needles", 1e-3);
}

TEST_CASE("a zero upstream gradient and an image without Gaussians give zero gradients") {
  const RenderScene scene = random_scene(20, 20, 10, {}, 9);
  const std::vector<float> zero(3 * 400, 0.f);
  const KernelGradient none = kernel_gradient(scene, {zero.data(), zero.data()});
  for (const auto& g : none.gaussians)
    for (const double v : g) CHECK(v == 0);
  CHECK(none.pose == Twist::Zero());

  const std::vector<float> one(3 * 400, 1.f);
  const KernelGradient empty = kernel_gradient(test::empty_scene(20, 20), {one.data(), one.data()});
  CHECK(empty.pose == Twist::Zero());
}
