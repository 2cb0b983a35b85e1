// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <string>
#include <vector>

#include "langgs/render/topk_rasterizer.hpp"
#include "render/gradient_check.hpp"
#include "render/render_scene.hpp"

using namespace langgs;
using test::KernelGradient;
using test::random_scene;
using test::RenderScene;
using test::SceneRanges;

namespace {

/// L = <a, colour> + <b, depth> with random a and b.
class RandomLoss : public test::OracleLoss {
 public:
  RandomLoss(const RenderScene& scene, std::uint64_t seed) : OracleLoss(scene) {
    const int n = scene.camera.num_pixels();
    colour_.assign(3 * n, 0.f);
    depth_.assign(n, 0.f);
    for (int i = 0; i < n; ++i) {
      if (!counts(i)) continue;
      for (int c = 0; c < 3; ++c) colour_[c * n + i] = static_cast<float>(CounterRng{seed, 0}.normal(4 * i + c));
      depth_[i] = static_cast<float>(CounterRng{seed, 1}.normal(i));
    }
    term = [this, n](int i, const reference::NaivePixel& pixel) {
      double loss = static_cast<double>(depth_[i]) * pixel.depth;
      for (int c = 0; c < 3; ++c) loss += static_cast<double>(colour_[c * n + i]) * pixel.colour[c];
      return loss;
    };
  }
  [[nodiscard]] RenderGradient upstream() const { return {colour_.data(), depth_.data()}; }

 private:
  std::vector<float> colour_, depth_;
};

KernelGradient kernel_gradient(const RenderScene& scene, const RenderGradient& upstream) {
  const Executor<Host> executor;
  const GaussianMap<1> map = scene.map();
  TopKRasterizer<1> rasterizer;
  rasterizer.render(executor, map.geometry(), scene.view(), false);
  MapGradient<Host> gradient;
  rasterizer.backward(executor, map.geometry(), scene.view(), upstream, gradient);
  return {gradient, scene.gaussians.size()};
}

void check_gradients(const RenderScene& scene, const std::string& name, double tolerance = 1e-4) {
  RandomLoss loss(scene, 77);
  REQUIRE(loss.num_pixels() > scene.camera.num_pixels() / 3);
  test::check_gradients(kernel_gradient(scene, loss.upstream()), loss, name, tolerance);
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
