// SPDX-License-Identifier: Apache-2.0
#include "langgs/render/weight_gradient.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
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

/// A render with its records, and the backward pass with random gradients on them.
template <int K, class Backend = Host>
struct WeightedRender {
  WeightedRender(const Executor<Backend>& an_executor, const RenderScene& a_scene)
      : executor(an_executor),
        scene(a_scene),
        map(a_scene.map()),
        upstream(static_cast<std::size_t>(4) * a_scene.camera.num_pixels(), 0.f),
        on_weights(static_cast<std::size_t>(K) * a_scene.camera.num_pixels()) {
    rasterizer.render(executor, map.geometry(), scene.view());
    for (std::size_t i = 0; i < on_weights.size(); ++i)
      on_weights[i] = static_cast<float>(CounterRng{31, 0}.normal(static_cast<std::uint64_t>(i)));
  }
  [[nodiscard]] RenderGradient on_planes() const {
    return {upstream.data(), upstream.data() + 3 * static_cast<std::ptrdiff_t>(scene.camera.num_pixels())};
  }
  [[nodiscard]] TopKWeightGradient<K> policy() const {
    return {rasterizer.topk_id(), rasterizer.topk_weight(), on_weights.data()};
  }
  template <class WeightGradient>
  [[nodiscard]] KernelGradient backward(const WeightGradient& weight_gradient) {
    rasterizer.backward(executor, map.geometry(), on_planes(), gradient, weight_gradient);
    return {executor, gradient, scene.gaussians.size()};
  }

  const Executor<Backend>& executor;
  const RenderScene& scene;
  GaussianMap<1> map;
  TopKRasterizer<K, Backend> rasterizer;
  MapGradient<Backend> gradient;
  std::vector<float> upstream;    ///< [4, H, W] on colour and depth
  std::vector<float> on_weights;  ///< [K, H, W]
};

/// L = sum over pixels and records of a w with random a: the oracle asks for the weights of the recorded Gaussians,
/// whether they remain the K largest or not. With `with_colour` also <b, colour>.
template <int K>
void check_weight_gradients(const RenderScene& scene, const std::string& name, bool with_colour = false) {
  const Executor<Host> executor;
  WeightedRender<K> r(executor, scene);
  test::OracleLoss loss(scene);
  REQUIRE(loss.num_pixels() > scene.camera.num_pixels() / 3);
  const int n = scene.camera.num_pixels();
  int unrecorded = 0;
  for (int i = 0; i < n; ++i) {
    for (int k = 0; k < K && !loss.counts(i); ++k) r.on_weights[k * n + i] = 0;
    for (int c = 0; c < 3 && with_colour && loss.counts(i); ++c)
      r.upstream[c * n + i] = static_cast<float>(CounterRng{32, 0}.normal(4 * i + c));
  }
  const std::int32_t* id = r.rasterizer.topk_id();
  loss.term = [&](int i, const reference::NaivePixel& pixel) {
    double sum = 0;
    for (int c = 0; c < 3; ++c) sum += static_cast<double>(r.upstream[c * n + i]) * pixel.colour[c];
    for (const reference::NaiveHit& hit : pixel.hits) {
      bool is_recorded = false;
      for (int k = 0; k < K; ++k)
        if (id[k * n + i] == hit.gaussian) {
          sum += static_cast<double>(r.on_weights[k * n + i]) * hit.weight;
          is_recorded = true;
        }
      unrecorded += is_recorded ? 0 : 1;
    }
    return sum;
  };
  const KernelGradient kernel = r.backward(r.policy());
  test::check_gradients(kernel, loss, name, 1e-4, with_colour ? kNumPlanes : kRed);
  if (K < 16) CHECK(unrecorded > 0);
  for (const auto& g : kernel.gaussians)
    for (int c = 0; c < 3 && !with_colour; ++c) REQUIRE(g[kRed + c] == 0);
}

template <class Backend>
std::vector<double> all_gradients(const Executor<Backend>& executor) {
  SceneRanges r;
  r.near = 0.04;
  r.greatest_opacity = 0.999;
  r.thickest = 8;
  const RenderScene scene = random_scene(40, 37, 600, r, 3);
  WeightedRender<3, Backend> render(executor, scene);
  std::fill(render.upstream.begin(), render.upstream.end(), 0.25f);
  const KernelGradient gradient = render.backward(render.policy());
  std::vector<double> result(gradient.pose.data(), gradient.pose.data() + 6);
  for (const auto& g : gradient.gaussians) result.insert(result.end(), g.begin(), g.end());
  return result;
}

}  // namespace

TEST_CASE("weight gradients equal central differences: partial tiles, colour at the same time") {
  check_weight_gradients<3>(random_scene(37, 21, 25, {}, 1), "plain");
  check_weight_gradients<3>(random_scene(37, 21, 25, {}, 1), "with colour", true);
  check_weight_gradients<2>(random_scene(5, 3, 8, {}, 3), "5x3");
}

TEST_CASE("weight gradients equal central differences: any K") {
  SceneRanges r;
  r.border = 0;
  const RenderScene scene = random_scene(20, 18, 40, r, 12);
  check_weight_gradients<1>(scene, "K = 1");
  check_weight_gradients<10>(scene, "K = 10");
  check_weight_gradients<16>(scene, "K = 16");
}

TEST_CASE("weight gradients equal central differences: more Gaussians than a batch, early stops") {
  SceneRanges r;
  r.thinnest = 1;
  r.thickest = 4;
  r.border = 0;
  check_weight_gradients<3>(random_scene(17, 9, 90, r, 4), "many");
}

TEST_CASE("weight gradients equal central differences: clamped alphas") {
  SceneRanges r;
  r.least_opacity = 0.98;
  r.greatest_opacity = 0.9995;
  r.thinnest = 2;
  r.thickest = 10;
  check_weight_gradients<3>(random_scene(37, 21, 20, r, 7), "clamped alpha");
}

TEST_CASE("no weight gradient is the default, and a gradient of zeros adds nothing") {
  const Executor<Host> executor;
  const RenderScene scene = random_scene(40, 37, 200, {}, 8);
  WeightedRender<3> r(executor, scene);
  for (std::size_t i = 0; i < r.upstream.size(); ++i)
    r.upstream[i] = static_cast<float>(CounterRng{33, 0}.normal(static_cast<std::uint64_t>(i)));
  r.rasterizer.backward(executor, r.map.geometry(), r.on_planes(), r.gradient);
  const KernelGradient standard(executor, r.gradient, scene.gaussians.size());
  const KernelGradient none = r.backward(NoWeightGradient{});
  CHECK(standard.gaussians == none.gaussians);
  CHECK(standard.pose == none.pose);

  std::fill(r.on_weights.begin(), r.on_weights.end(), 0.f);
  const KernelGradient zero = r.backward(r.policy());
  test::GradientGroup same{"zeros"};
  for (std::size_t i = 0; i < scene.gaussians.size(); ++i)
    for (int p = 0; p < kNumPlanes; ++p) same.add(zero.gaussians[i][p], none.gaussians[i][p]);
  same.check("zeros", 1e-6);  // not the same bits: a compiler may fuse other multiplications and additions
}

TEST_CASE("weight gradients are the same bits for any number of threads and any order, and no sync is missing") {
  const std::vector<double> one = all_gradients(Executor<Host>(1));
  CHECK(one == all_gradients(Executor<Host>(2)));
  CHECK(one == all_gradients(Executor<Host>(3)));

  Executor<CheckedHost> checked(2);
  const std::vector<double> ascending = all_gradients(checked);
  checked.order = ExecutionOrder::descending;
  CHECK(ascending == all_gradients(checked));
  checked.order = ExecutionOrder::shuffled;
  for (checked.seed = 1; checked.seed <= 3; ++checked.seed) CHECK(ascending == all_gradients(checked));
  REQUIRE(ascending.size() == one.size());
  double worst = 0;
  for (std::size_t i = 0; i < one.size(); ++i)
    worst = std::max(worst, std::abs(one[i] - ascending[i]) / std::max(1.0, std::abs(one[i])));
  CHECK(worst < 1e-3);
}
