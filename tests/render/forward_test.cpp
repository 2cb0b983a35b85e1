// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "langgs/render/topk_rasterizer.hpp"
#include "render/render_scene.hpp"

using namespace langgs;
using test::random_scene;
using test::RenderScene;
using test::SceneRanges;

namespace {

/// Renders without recording (K = 0) and compares with the oracle, pixels at a threshold left out.
struct Comparison {
  double colour = 0, depth = 0, transmittance = 0;  ///< largest differences; relative to 1 or the value if larger
  double balance = 0;                               ///< largest |sum of the oracle's weights + T - 1|
  int compared = 0, skipped = 0, lit = 0;
};

Comparison compare(const RenderScene& scene) {
  const Executor<Host> executor;
  const GaussianMap<1> map = scene.map();
  TopKRasterizer<1> rasterizer;
  rasterizer.render(executor, map.geometry(), scene.view(), false);
  const RenderPlanes out = rasterizer.rendered();
  const reference::NaiveRenderer oracle(scene.naive());
  const int n = scene.camera.num_pixels();
  Comparison result;
  reference::NaivePixel expected;
  for (int i = 0; i < n; ++i) {
    oracle.pixel(i % scene.camera.width, i / scene.camera.width, expected);
    if (expected.margin < 1e-3) {
      ++result.skipped;
      continue;
    }
    ++result.compared;
    result.lit += expected.hits.empty() ? 0 : 1;
    for (int c = 0; c < 3; ++c)
      result.colour =
          std::max(result.colour, std::abs(static_cast<double>(out.colour[c * n + i]) - expected.colour[c]) /
                                      std::max(1.0, expected.colour[c]));
    result.depth = std::max(
        result.depth, std::abs(static_cast<double>(out.depth[i]) - expected.depth) / std::max(1.0, expected.depth));
    result.transmittance =
        std::max(result.transmittance, std::abs(static_cast<double>(out.transmittance[i]) - expected.transmittance));
    double sum = expected.transmittance;
    for (const reference::NaiveHit& hit : expected.hits) sum += hit.weight;
    result.balance = std::max(result.balance, std::abs(sum - 1));
  }
  return result;
}

void check_agreement(const RenderScene& scene, const std::string& name, double tolerance = 1e-5) {
  const Comparison c = compare(scene);
  INFO(name, ": colour ", c.colour, " depth ", c.depth, " transmittance ", c.transmittance, ", pixels ", c.compared,
       " lit ", c.lit, " skipped ", c.skipped);
  CHECK(c.compared > 0.5 * scene.camera.num_pixels());
  CHECK(c.lit > 0);
  CHECK(c.colour < tolerance);
  CHECK(c.depth < tolerance);
  CHECK(c.transmittance < tolerance);
  CHECK(c.balance < 1e-12);
}

}  // namespace

TEST_CASE("one Gaussian has its analytic profile") {
  RenderScene scene;
  scene.camera = {100, 80, 20, 12, 41, 33};
  Gaussian<1> g;
  g.mean = {0, 0, 2};
  g.log_scale = {std::log(0.1f), std::log(0.05f), -8};
  g.opacity_logit = 1.5f;
  g.colour = {0.25f, 0.5f, 1};
  scene.gaussians = {g};
  const GaussianMap<1> map = scene.map();
  TopKRasterizer<1> rasterizer;
  rasterizer.render(Executor<Host>(), map.geometry(), scene.view());
  const RenderPlanes out = rasterizer.rendered();

  const double opacity = 1 / (1 + std::exp(-1.5)), xx = 25 + 0.3, yy = 4 + 0.3;  // (100 * 0.1 / 2)^2, (80 * 0.05 / 2)^2
  const int n = scene.camera.num_pixels();
  for (int y = 0; y < 33; ++y)
    for (int x = 0; x < 41; ++x) {
      const int i = y * 41 + x;
      double alpha = opacity * std::exp(-0.5 * ((x - 20) * (x - 20) / xx + (y - 12) * (y - 12) / yy));
      if (alpha < 1 / 255.0) alpha = 0;
      CHECK(static_cast<double>(out.colour[i]) == doctest::Approx(0.25 * alpha).epsilon(2e-6));
      CHECK(static_cast<double>(out.colour[2 * n + i]) == doctest::Approx(alpha).epsilon(2e-6));
      CHECK(static_cast<double>(out.depth[i]) == doctest::Approx(2 * alpha).epsilon(2e-6));
      CHECK(static_cast<double>(out.transmittance[i]) == doctest::Approx(1 - alpha).epsilon(2e-6));
      CHECK(rasterizer.topk_id()[i] == (alpha > 0 ? 0 : -1));
      CHECK(static_cast<double>(rasterizer.topk_weight()[i]) == doctest::Approx(alpha).epsilon(2e-6));
    }
}

TEST_CASE("an opaque Gaussian is bounded at 0.99 and the second one stops the ray") {
  RenderScene scene;
  scene.camera = {10, 10, 1, 1, 3, 3};
  Gaussian<1> g;
  g.log_scale.setConstant(2);
  g.opacity_logit = 12;
  for (const float z : {1.f, 2.f, 3.f}) {
    g.mean = {0, 0, z};
    g.colour = {z == 1 ? 1.f : 0.f, z == 2 ? 1.f : 0.f, z == 3 ? 1.f : 0.f};
    scene.gaussians.push_back(g);
  }
  const GaussianMap<1> map = scene.map();
  TopKRasterizer<3> rasterizer;
  rasterizer.render(Executor<Host>(), map.geometry(), scene.view());
  const RenderPlanes out = rasterizer.rendered();
  // 0.01 * 0.01 is 1e-4 up to rounding: whether the second one still counts is at the threshold by construction.
  CHECK(out.colour[4] == doctest::Approx(0.99f));
  CHECK(out.colour[2 * 9 + 4] == 0.f);
  CHECK(rasterizer.topk_id()[4] == 0);
  CHECK(rasterizer.topk_id()[2 * 9 + 4] == -1);
  CHECK(out.transmittance[4] >= RasterConstants::kMinTransmittance);
}

TEST_CASE("tiled rendering equals the oracle") {
  const SceneRanges plain;
  check_agreement(random_scene(37, 53, 80, plain, 1), "37x53");
  check_agreement(random_scene(16, 16, 60, plain, 2), "16x16");
  check_agreement(random_scene(17, 31, 60, plain, 3), "17x31");
  check_agreement(random_scene(64, 1, 40, plain, 4), "64x1");
  check_agreement(random_scene(1, 1, 9, {0.4, 4, 3, 1, 20, 0.1, 0.9}, 5), "1x1");
  check_agreement(random_scene(90, 70, 700, {0.4, 4, 0.2, 0.3, 5, 0.02, 0.6}, 6), "many, several batches a tile");
}

TEST_CASE("difficult Gaussians equal the oracle") {
  SceneRanges r;
  r.border = 1.5;
  r.thickest = 40;
  r.greatest_opacity = 0.5;
  check_agreement(random_scene(37, 53, 60, r, 11), "centres far outside");
  r = {};
  r.near = 0.0501;
  r.far = 0.3;
  check_agreement(random_scene(37, 53, 60, r, 12), "near plane");
  r.near = 0.02;
  r.far = 0.1;
  check_agreement(random_scene(37, 53, 60, r, 13), "on both sides of the near plane");
  r = {};
  r.thinnest = 0.001;
  r.thickest = 30;
  check_agreement(random_scene(37, 53, 60, r, 14), "needles and discs", 2e-5);
  r.thinnest = r.thickest = 1e-3;
  check_agreement(random_scene(37, 53, 300, r, 15), "tiny");
  r.thinnest = 20;
  r.thickest = 2000;
  r.greatest_opacity = 0.1;
  check_agreement(random_scene(37, 53, 30, r, 16), "huge", 2e-5);
  r = {};
  r.least_opacity = 0.001;
  r.greatest_opacity = 0.006;
  check_agreement(random_scene(37, 53, 200, r, 17), "nearly transparent");
  r.least_opacity = 0.9;
  r.greatest_opacity = 0.9999;
  check_agreement(random_scene(37, 53, 200, r, 18), "nearly opaque");
}

TEST_CASE("splats on tile borders are neither lost nor drawn twice") {
  for (const double offset : {-0.51, -0.5, -0.49, 0.0, 0.5}) {
    RenderScene scene;
    scene.camera = {50, 50, 24, 24, 48, 48};
    for (const int u : {0, 15, 16, 31, 32, 47})
      for (const int v : {0, 15, 16, 31, 32, 47}) {
        Gaussian<1> g;
        const double z = 1 + 0.01 * u + 0.003 * v;
        g.mean = scene.camera.back_project(u + offset, v + offset, z).cast<float>();
        g.log_scale.setConstant(u % 2 == 0 ? -9.f : -3.5f);
        scene.gaussians.push_back(g);
      }
    check_agreement(scene, "borders");
  }
}

TEST_CASE("equal depths are blended in the order of the Gaussians") {
  RenderScene scene = random_scene(37, 53, 50, {}, 21);
  scene.T_world_camera = Pose::Identity();
  for (std::size_t i = 0; i < scene.gaussians.size(); ++i) {
    Gaussian<1>& g = scene.gaussians[i];
    const CounterRng rng{22, i};
    const double z = i % 2 == 0 ? 1.5 : 2.25;
    g.mean = scene.camera.back_project(37 * rng.uniform(0), 53 * rng.uniform(1), z).cast<float>();
    g.log_scale.setConstant(-2.f);
  }
  check_agreement(scene, "equal depths");
}
