// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <vector>

#include "langgs/optimize/adam.hpp"
#include "langgs/optimize/feature_adam.hpp"
#include "langgs/optimize/feature_average.hpp"
#include "langgs/optimize/feature_step.hpp"
#include "langgs/optimize/geometric_loss.hpp"
#include "langgs/render/topk_rasterizer.hpp"
#include "render/render_scene.hpp"
#include "support/allocations.hpp"

using namespace langgs;

TEST_CASE("the counter of allocations counts") {
  const long before = test::num_allocations();
  void* const some = ::operator new(1000);  // a compiler may leave out a new-expression, but not this call
  ::operator delete(some);
  const Buffer<float, Host> buffer(100);
  CHECK(buffer.size() == 100);
  CHECK(test::num_allocations() == before + 2);
}

TEST_CASE("rendering, its loss, the backward pass and Adam allocate nothing once they have seen the views") {
  constexpr int kViews = 3;
  for (const int threads : {1, 3}) {
    CAPTURE(threads);
    const Executor<Host> executor(threads);
    // Enough Gaussians for a sort on all threads.
    const test::RenderScene scene = test::random_scene(160, 120, 12000, {}, 5);
    GaussianMap<1> map = scene.map();
    const int n = scene.camera.num_pixels();
    Buffer<float, Host> target(4 * n), upstream(4 * n);
    target.fill(0.5f);
    std::vector<View> views;
    for (int v = 0; v < kViews; ++v) {
      Twist motion;
      motion << 0.1 * v, 0, 0, 0, 0.05 * v, 0;
      views.emplace_back(scene.camera, scene.T_world_camera * se3_exp(motion));
    }
    TopKRasterizer<3> rasterizer;
    GeometricLoss<Host> loss;
    MapGradient<Host> gradient;
    LearningRates still;  // the map stays the same, and so do the sizes that the buffers need
    still.mean = still.log_scale = still.rotation = still.opacity_logit = still.colour = 0;
    const SelectiveAdam<Host> adam(still);
    const auto round = [&] {
      for (const View& view : views)
        for (const bool record_topk : {false, true}) {
          rasterizer.render(executor, map.geometry(), view, record_topk);
          loss.evaluate(
              executor,
              {rasterizer.rendered().colour, rasterizer.rendered().depth, view.camera.width, view.camera.height},
              {target.data(), target.data() + 3 * n, view.camera.width, view.camera.height},
              {upstream.data(), upstream.data() + 3 * n});
          rasterizer.backward(executor, map.geometry(), {upstream.data(), upstream.data() + 3 * n}, gradient);
          adam.step(executor, map, gradient);
        }
    };
    round();
    round();
    const long before = test::num_allocations();
    round();
    round();
    const long allocations = test::num_allocations() - before;
    CHECK(gradient.size() > 4096);
    CHECK(allocations == 0);
  }
}

TEST_CASE_TEMPLATE("a feature step allocates nothing once it has seen the views", Optimizer, FeatureAverage<>,
                   FeatureAdam<>) {
  constexpr int kDim = 40;
  for (const int threads : {1, 3}) {
    CAPTURE(threads);
    const Executor<Host> executor(threads);
    const test::RenderScene scene = test::random_scene(160, 120, 3000, {}, 5);
    const GaussianMap<1> geometry = scene.map();
    GaussianMap<kDim, Host, Optimizer> map;
    map.append(std::vector<Gaussian<kDim>>(3000), 0, 0);
    FeatureMap<kDim> teacher(80, 60);
    const std::vector<float> one(kDim, 1.f);
    for (int p = 0; p < 80 * 60; ++p) teacher.set_pixel(p % 80, p / 80, one.data());
    TopKRasterizer<3> rasterizer;
    rasterizer.render(executor, geometry.geometry(), scene.view());
    Contributions<Host> contributions;
    FeatureStep<kDim, Optimizer> step;
    const auto round = [&] {
      contributions.from_topk(executor, rasterizer, {80, 60, scene.camera}, teacher.present());
      step.step(executor, {}, map, contributions.view(), teacher);
    };
    round();
    const long before = test::num_allocations();
    round();
    round();
    CHECK(test::num_allocations() == before);
    CHECK(contributions.view().size.most > 1000);
  }
}
