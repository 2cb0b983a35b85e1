// SPDX-License-Identifier: Apache-2.0
#include "langgs/render/contributions.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <vector>

#include "reference/naive_renderer.hpp"
#include "render/render_scene.hpp"

using namespace langgs;

namespace {

struct Size {
  int width, height;
};

struct Rendered {
  explicit Rendered(const test::RenderScene& scene, int num_threads = 1) : executor(num_threads), map(scene.map()) {
    rasterizer.render(executor, map.geometry(), scene.view());
  }
  Executor<Host> executor;
  GaussianMap<1> map;
  TopKRasterizer<4> rasterizer;
  Contributions<Host> contributions;
};

/// Which pixel of `size` holds the centre of sample i of `count`: floor((i + 1/2) size / count), by search.
int naive_nearest(int i, int count, int size) {
  int pixel = 0;
  while ((2 * i + 1) * size >= 2 * (pixel + 1) * count) ++pixel;
  return pixel;
}

}  // namespace

TEST_CASE("samples lie at the pixels that hold their centres") {
  const Camera camera{50, 50, 10, 10, 29, 17};
  const std::vector<Size> sizes{{29, 17}, {7, 4}, {14, 8}, {1, 1}, {13, 11}, {28, 16}, {64, 64}, {58, 34}, {200, 3}};
  for (const Size& size : sizes) {
    const int width = size.width, height = size.height;
    CAPTURE(width);
    CAPTURE(height);
    const SampleGrid grid{width, height, camera};
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x)
        REQUIRE(grid.pixel(y * width + x) == naive_nearest(y, height, 17) * 29 + naive_nearest(x, width, 29));
  }
  const SampleGrid full{29, 17, camera};
  for (int p = 0; p < 29 * 17; ++p) REQUIRE(full.pixel(p) == p);
  CHECK(SampleGrid{160, 120, {500, 500, 320, 240, 640, 480}}.pixel(0) == 2 * 640 + 2);  // a centre between four pixels
  CHECK(SampleGrid{16384, 16384, {1, 1, 0, 0, 16384, 16384}}.pixel(16384 * 16384 - 1) == 16384 * 16384 - 1);
}

TEST_CASE("Top-K contributions are the oracle's K largest weights, renormalised") {
  const test::RenderScene scene = test::random_scene(45, 33, 120, {}, 21);
  Rendered r(scene);
  const reference::NaiveScene naive = scene.naive();
  const reference::NaiveRenderer oracle(naive);
  for (const Size& size : std::vector<Size>{{45, 33}, {11, 8}, {60, 50}, {1, 1}}) {
    const int width = size.width, height = size.height;
    CAPTURE(width);
    const SampleGrid grid{width, height, scene.camera};
    r.contributions.from_topk(r.executor, r.rasterizer, grid);
    const ContributionView view = r.contributions.view();
    REQUIRE(view.num_pixels() == width * height);
    REQUIRE(view.begin[0] == 0);
    for (int p = 0; p < view.num_pixels(); ++p)
      for (int i = view.begin[p]; i < view.begin[p + 1]; ++i) REQUIRE(view.contribution[i].pixel == p);
    REQUIRE(view.begin[view.num_pixels()] == view.size.most);
    int compared = 0;
    for (int p = 0; p < view.num_pixels(); ++p) {
      const int n = view.begin[p + 1] - view.begin[p], pixel = grid.pixel(p);
      double sum = 0;
      for (int i = view.begin[p]; i < view.begin[p + 1]; ++i) {
        sum += view.contribution[i].weight;
        REQUIRE(view.contribution[i].weight > 0);
        REQUIRE(view.gaussian[i] >= 0);
      }
      if (n > 0) REQUIRE(sum == doctest::Approx(1).epsilon(1e-6));
      const reference::NaivePixel expected = oracle.pixel(pixel % 45, pixel / 45);
      if (expected.margin < 1e-3) continue;
      const std::vector<reference::NaiveHit> hits = reference::naive_topk(expected, 4);
      REQUIRE(n == static_cast<int>(hits.size()));
      double total = 0;
      for (const auto& hit : hits) total += hit.weight;
      for (int k = 0; k < n; ++k)  // places of nearly equal weight may swap: compare the weights
        REQUIRE(view.contribution[view.begin[p] + k].weight == doctest::Approx(hits[k].weight / total).epsilon(2e-3));
      ++compared;
    }
    CHECK(compared >= view.num_pixels() * 4 / 5);
  }
}

TEST_CASE("blended contributions are all hits of the oracle, front to back, with raw weights") {
  const test::RenderScene scene = test::random_scene(45, 33, 150, {}, 22);
  Rendered r(scene);
  const reference::NaiveScene naive = scene.naive();
  const reference::NaiveRenderer oracle(naive);
  for (const Size& size : std::vector<Size>{{45, 33}, {12, 9}, {90, 7}}) {
    const int width = size.width, height = size.height;
    const SampleGrid grid{width, height, scene.camera};
    r.contributions.from_blending(r.executor, r.rasterizer.splats(), grid);
    const ContributionView view = r.contributions.view();
    REQUIRE(view.num_pixels() == width * height);
    int compared = 0, most = 0;
    for (int p = 0; p < view.num_pixels(); ++p) {
      const int pixel = grid.pixel(p), n = view.begin[p + 1] - view.begin[p];
      double sum = 0;
      for (int i = view.begin[p]; i < view.begin[p + 1]; ++i) sum += view.contribution[i].weight;
      REQUIRE(sum + r.rasterizer.rendered().transmittance[pixel] == doctest::Approx(1).epsilon(1e-5));
      const reference::NaivePixel expected = oracle.pixel(pixel % 45, pixel / 45);
      if (expected.margin < 1e-3) continue;
      REQUIRE(n == static_cast<int>(expected.hits.size()));
      for (int k = 0; k < n; ++k) {
        REQUIRE(view.gaussian[view.begin[p] + k] == expected.hits[k].gaussian);
        REQUIRE(view.contribution[view.begin[p] + k].weight ==
                doctest::Approx(expected.hits[k].weight).epsilon(1e-3).scale(1e-3));
      }
      ++compared;
      most = std::max(most, n);
    }
    CHECK(compared >= view.num_pixels() * 4 / 5);
    CHECK(most > 4);  // more than Top-K keeps
  }
}

TEST_CASE("an empty map and a view of nothing contribute nothing") {
  test::RenderScene scene = test::empty_scene(20, 15);
  SUBCASE("no Gaussian") {}
  SUBCASE("all behind the camera") {
    Gaussian<1> g;
    g.mean = (scene.T_world_camera * Eigen::Vector3d(0, 0, -2)).cast<float>();
    scene.gaussians.assign(3, g);
  }
  Rendered r(scene);
  for (const bool blend : {false, true}) {
    const SampleGrid grid{7, 5, scene.camera};
    if (blend)
      r.contributions.from_blending(r.executor, r.rasterizer.splats(), grid);
    else
      r.contributions.from_topk(r.executor, r.rasterizer, grid);
    CHECK(r.contributions.view().num_pixels() == 35);
    CHECK(r.contributions.view().size.most == 0);
    for (int p = 0; p <= 35; ++p) REQUIRE(r.contributions.view().begin[p] == 0);
  }
}

TEST_CASE("samples that are not wanted get nothing, and the others what they had") {
  const test::RenderScene scene = test::random_scene(45, 33, 120, {}, 24);
  Rendered r(scene);
  const SampleGrid grid{20, 15, scene.camera};
  std::vector<std::uint8_t> wanted(20 * 15);
  for (int p = 0; p < 20 * 15; ++p) wanted[p] = p % 3 == 0 ? 1 : 0;
  for (const bool blend : {false, true}) {
    const auto record = [&](const std::uint8_t* mask) {
      if (blend)
        r.contributions.from_blending(r.executor, r.rasterizer.splats(), grid, mask);
      else
        r.contributions.from_topk(r.executor, r.rasterizer, grid, mask);
      const ContributionView view = r.contributions.view();
      std::vector<std::vector<std::int32_t>> of(20 * 15);
      for (int i = 0; i < view.size.most; ++i) of[view.contribution[i].pixel].push_back(view.gaussian[i]);
      return of;
    };
    auto all = record(nullptr);
    for (int p = 0; p < 20 * 15; ++p)
      if (wanted[p] == 0) all[p].clear();
    CHECK(record(wanted.data()) == all);
  }
}

TEST_CASE("contributions are the same bits for any number of threads") {
  const test::RenderScene scene = test::random_scene(45, 33, 150, {}, 23);
  for (const bool blend : {false, true}) {
    std::vector<float> weights;
    std::vector<std::int32_t> ids;
    for (const int threads : {1, 2, 3}) {
      Rendered r(scene, threads);
      const SampleGrid grid{45, 33, scene.camera};
      if (blend)
        r.contributions.from_blending(r.executor, r.rasterizer.splats(), grid);
      else
        r.contributions.from_topk(r.executor, r.rasterizer, grid);
      const ContributionView view = r.contributions.view();
      std::vector<float> w;
      for (int i = 0; i < view.size.most; ++i) w.push_back(view.contribution[i].weight);
      const std::vector<std::int32_t> g(view.gaussian, view.gaussian + view.size.most);
      if (threads == 1) weights = w, ids = g;
      CHECK(w == weights);
      CHECK(g == ids);
    }
  }
}
