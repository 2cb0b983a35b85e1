// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "langgs/render/topk_rasterizer.hpp"
#include "render/render_scene.hpp"

using namespace langgs;
using test::random_scene;
using test::RenderScene;

namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
constexpr float kInf = std::numeric_limits<float>::infinity();

int count_not_finite(const float* values, int count) {
  int result = 0;
  for (int i = 0; i < count; ++i) result += std::isfinite(values[i]) ? 0 : 1;
  return result;
}

/// Renders and differentiates; everything must come out finite, whatever is in the map.
void check_finite(const GaussianMap<1>& map, const RenderScene& scene, const std::string& what) {
  const Executor<Host> executor(2);
  TopKRasterizer<3> rasterizer;
  rasterizer.render(executor, map.geometry(), scene.view());
  const int n = scene.camera.num_pixels();
  const std::vector<float> ones(3 * n, 1.f);
  MapGradient<Host> gradient;
  rasterizer.backward(executor, map.geometry(), {ones.data(), ones.data()}, gradient);
  INFO(what);
  CHECK(count_not_finite(rasterizer.rendered().colour, 5 * n) == 0);
  CHECK(count_not_finite(rasterizer.topk_weight(), 3 * n) == 0);
  for (int i = 0; i < 3 * n; ++i) {
    REQUIRE(rasterizer.topk_id()[i] >= -1);
    REQUIRE(rasterizer.topk_id()[i] < map.size());
  }
  for (int p = 0; p < kNumPlanes; ++p) {
    INFO("gradient of plane ", p);
    CHECK(count_not_finite(gradient.planes().plane(p), gradient.size()) == 0);
  }
  CHECK(gradient.pose().allFinite());
}

}  // namespace

TEST_CASE("an empty map gives a black, transparent image") {
  const RenderScene scene = test::empty_scene(20, 33);
  const GaussianMap<1> map;
  check_finite(map, scene, "empty");
  TopKRasterizer<2> rasterizer;
  rasterizer.render(Executor<Host>(), map.geometry(), scene.view());
  for (int i = 0; i < 20 * 33; ++i) {
    CHECK(rasterizer.rendered().colour[i] == 0.f);
    CHECK(rasterizer.rendered().transmittance[i] == 1.f);
    CHECK(rasterizer.topk_id()[i] == -1);
  }
  CHECK(rasterizer.splats().num_splats() == 0);
}

TEST_CASE("Gaussians behind the camera are not drawn") {
  RenderScene scene = random_scene(20, 20, 30, {}, 1);
  Pose turn = Pose::Identity();
  turn.linear() = so3_exp({0, 3.14159265, 0});
  scene.T_world_camera = scene.T_world_camera * turn;
  TopKRasterizer<2> rasterizer;
  const GaussianMap<1> map = scene.map();
  rasterizer.render(Executor<Host>(), map.geometry(), scene.view());
  CHECK(rasterizer.splats().num_splats() == 0);
  check_finite(map, scene, "behind");
}

TEST_CASE("any value in any parameter leaves image and gradients finite") {
  for (const bool identity : {false, true}) {  // the identity has zeros, which meet infinities
    RenderScene scene = random_scene(24, 20, 12, {}, 2);
    if (identity) {
      for (Gaussian<1>& g : scene.gaussians)
        g.mean = (scene.T_world_camera.inverse() * g.mean.cast<double>()).cast<float>();
      scene.T_world_camera = Pose::Identity();
    }
    for (const float value : {kNaN, kInf, -kInf, 1e38f, -1e38f, 1e20f, -1e20f, 1e10f, -1e10f, 1e8f, 1e5f, -1e5f, 100.f,
                              -100.f, 0.f, 1e-30f, 1e-42f}) {
      for (int plane = 0; plane < kNumPlanes; ++plane) {
        GaussianMap<1> map = scene.map();
        for (int i = 0; i < map.size(); i += 2) map.geometry().plane(plane)[i] = value;
        check_finite(map, scene, "plane " + std::to_string(plane) + " = " + std::to_string(value));
      }
      GaussianMap<1> map = scene.map();
      for (int i = 0; i < map.size(); i += 2) {
        for (int a = 0; a < 4; ++a) map.geometry().plane(kRotationW + a)[i] = value;
        for (int a = 0; a < 3; ++a) map.geometry().plane(kLogScaleX + a)[i] = value;
      }
      check_finite(map, scene, "rotation and scale = " + std::to_string(value));
    }
  }
}

TEST_CASE("random nonsense in every parameter leaves image and gradients finite") {
  for (std::uint64_t seed = 0; seed < 300; ++seed) {
    const RenderScene scene = random_scene(24, 20, 40, {}, seed);
    GaussianMap<1> map = scene.map();
    const CounterRng rng{seed, 99};
    for (int k = 0; k < 60; ++k) {
      const double magnitude = std::pow(10.0, test::between(-45, 38.5, rng.uniform(4 * k)));
      float* plane = map.geometry().plane(static_cast<int>(rng.below(4 * k + 1, kNumPlanes)));
      plane[rng.below(4 * k + 2, 40)] = static_cast<float>(rng.normal(10000 + k) < 0 ? -magnitude : magnitude);
    }
    check_finite(map, scene, "seed " + std::to_string(seed));
  }
}

TEST_CASE("a broken Gaussian does not disturb the others") {
  const RenderScene scene = random_scene(24, 20, 12, {}, 3);
  RenderScene without = scene;
  without.gaussians.erase(without.gaussians.begin() + 4);
  GaussianMap<1> broken = scene.map();
  broken.geometry().plane(kMeanY)[4] = kNaN;
  const GaussianMap<1> clean = without.map();
  TopKRasterizer<1> a, b;
  a.render(Executor<Host>(), broken.geometry(), scene.view());
  b.render(Executor<Host>(), clean.geometry(), scene.view());
  for (int i = 0; i < 5 * a.num_pixels(); ++i) REQUIRE(a.rendered().colour[i] == b.rendered().colour[i]);
}

TEST_CASE("extreme but valid cameras") {
  RenderScene scene = random_scene(24, 20, 12, {}, 4);
  for (const float focal : {1e-6f, 0.1f, 1e3f, 9e5f}) {
    scene.camera.fx = scene.camera.fy = focal;
    check_finite(scene.map(), scene, "focal length " + std::to_string(focal));
  }
  scene = random_scene(24, 20, 12, {}, 4);
  for (const float centre : {-9e5f, 9e5f}) {
    scene.camera.cx = centre;
    check_finite(scene.map(), scene, "principal point " + std::to_string(centre));
  }
}

TEST_CASE("a view refuses a pose that is not finite and a camera that is none") {
  RenderScene scene = random_scene(8, 8, 1, {}, 5);
  Pose pose = scene.T_world_camera;
  pose.translation().x() = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_AS(View(scene.camera, pose), InvalidArgument);
  for (const Camera& camera : {Camera{0, 1, 0, 0, 8, 8}, Camera{1, kNaN, 0, 0, 8, 8}, Camera{1, 1, 0, 0, 0, 8},
                               Camera{1, 1, kInf, 0, 8, 8}, Camera{1, 1, 0, 0, 8, 1 << 20}})
    CHECK_THROWS_AS(View(camera, scene.T_world_camera), InvalidArgument);
}
