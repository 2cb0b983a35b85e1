// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "langgs/render/topk_rasterizer.hpp"
#include "render/render_scene.hpp"

using namespace langgs;

namespace {

/// Every output of a render and its backward pass, as bytes to compare.
template <class Backend>
std::vector<float> everything(const Executor<Backend>& executor, const test::RenderScene& scene) {
  constexpr int kK = 3;
  const GaussianMap<1> map = scene.map();
  const int n = scene.camera.num_pixels();
  std::vector<float> upstream(4 * n), result;
  for (int i = 0; i < 4 * n; ++i) upstream[i] = static_cast<float>(CounterRng{9, 9}.normal(i));
  TopKRasterizer<kK, Backend> rasterizer;
  rasterizer.render(executor, map.geometry(), scene.view());
  MapGradient<Backend> gradient;
  rasterizer.backward(executor, map.geometry(), {upstream.data(), upstream.data() + 3 * n}, gradient);

  const auto append = [&](const auto* values, int count) {
    for (int i = 0; i < count; ++i) result.push_back(static_cast<float>(values[i]));
  };
  append(rasterizer.rendered().colour, 5 * n);
  append(rasterizer.topk_weight(), kK * n);
  append(rasterizer.topk_id(), kK * n);
  append(rasterizer.statistics().max_weight, rasterizer.splats().num_splats());
  append(rasterizer.statistics().topk_count, rasterizer.splats().num_splats());
  append(gradient.gaussian(), gradient.size());
  for (int p = 0; p < kNumPlanes; ++p) append(gradient.planes().plane(p), gradient.size());
  append(gradient.pose().data(), 6);
  return result;
}

test::RenderScene scene() {
  test::SceneRanges r;
  r.near = 0.04;
  r.greatest_opacity = 0.999;
  r.thickest = 8;
  return test::random_scene(40, 37, 600, r, 3);
}

}  // namespace

TEST_CASE("one, two and three threads give the same bits, run after run") {
  const std::vector<float> one = everything(Executor<Host>(1), scene());
  CHECK(one == everything(Executor<Host>(1), scene()));
  CHECK(one == everything(Executor<Host>(2), scene()));
  CHECK(one == everything(Executor<Host>(3), scene()));
}

TEST_CASE("the order of blocks, warps and threads changes no bit, and no sync is missing") {
  Executor<CheckedHost> checked(2);
  const std::vector<float> ascending = everything(checked, scene());
  checked.order = ExecutionOrder::descending;
  CHECK(ascending == everything(checked, scene()));
  checked.order = ExecutionOrder::shuffled;
  for (checked.seed = 1; checked.seed <= 3; ++checked.seed) CHECK(ascending == everything(checked, scene()));

  // Another instantiation of the same source: a compiler may fuse other multiplications and additions in it.
  const std::vector<float> host = everything(Executor<Host>(1), scene());
  REQUIRE(host.size() == ascending.size());
  double worst = 0;
  for (std::size_t i = 0; i < host.size(); ++i) {
    const double a = static_cast<double>(host[i]), b = static_cast<double>(ascending[i]);
    worst = std::max(worst, std::abs(a - b) / std::max(1.0, std::abs(a)));
  }
  INFO("largest difference, relative to 1 or the value: ", worst);
  CHECK(worst < 1e-3);
}
