// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "langgs/render/topk_rasterizer.hpp"
#include "render/render_scene.hpp"

using namespace langgs;
using test::random_scene;
using test::RenderScene;
using test::SceneRanges;

namespace {

struct Recorded {
  std::vector<std::int32_t> id;          ///< [K, H, W]
  std::vector<float> weight;             ///< [K, H, W]
  std::vector<float> planes;             ///< [5, H, W]
  std::vector<float> max_weight;         ///< [N]
  std::vector<std::int32_t> topk_count;  ///< [N]
};

template <int K>
Recorded record(const RenderScene& scene) {
  const Executor<Host> executor;
  const GaussianMap<1> map = scene.map();
  TopKRasterizer<K> rasterizer;
  rasterizer.render(executor, map.geometry(), scene.view());
  const std::size_t n = scene.camera.num_pixels();
  Recorded r;
  r.id.assign(rasterizer.topk_id(), rasterizer.topk_id() + K * n);
  r.weight.assign(rasterizer.topk_weight(), rasterizer.topk_weight() + K * n);
  r.planes.assign(rasterizer.rendered().colour, rasterizer.rendered().colour + 5 * n);
  r.max_weight.assign(scene.gaussians.size(), 0.f);
  r.topk_count.assign(scene.gaussians.size(), 0);
  for (int c = 0; c < rasterizer.splats().num_splats(); ++c) {
    const int i = rasterizer.splats().gaussian()[c];
    r.max_weight[i] = rasterizer.statistics().max_weight[c];
    r.topk_count[i] = rasterizer.statistics().topk_count[c];
  }
  return r;
}

SceneRanges layered() {
  SceneRanges r;
  r.greatest_opacity = 0.4;
  r.thinnest = 3;
  return r;
}

/// Ids and weights of every pixel; where the oracle's order hangs on less than 1e-5, only weights are compared.
template <int K>
void check_topk(const RenderScene& scene) {
  const Recorded r = record<K>(scene);
  const reference::NaiveRenderer oracle(scene.naive());
  const int n = scene.camera.num_pixels();
  int compared = 0, full = 0, short_rows = 0, wrong_ids = 0, unordered = 0;
  double worst = 0, worst_mean = 0;
  const reference::NaiveScene naive = scene.naive();
  for (int i = 0; i < n; ++i) {
    const reference::NaivePixel pixel = oracle.pixel(i % scene.camera.width, i / scene.camera.width);
    if (pixel.margin < 1e-3) continue;
    ++compared;
    const std::vector<reference::NaiveHit> all = reference::naive_topk(pixel, 1000);
    const int filled = std::min<int>(K, static_cast<int>(all.size()));
    full += filled == K ? 1 : 0;
    short_rows += filled < K ? 1 : 0;
    double total = 0, mean = 0;
    for (int k = 0; k < K; ++k) {
      const int id = r.id[k * n + i];
      const double weight = static_cast<double>(r.weight[k * n + i]);
      if (k > 0) unordered += r.weight[k * n + i] > r.weight[(k - 1) * n + i] ? 1 : 0;
      if (k >= filled) {
        CHECK(id == -1);
        CHECK(weight == 0);
        continue;
      }
      worst = std::max(worst, std::abs(weight - all[k].weight));
      const bool clear_above = k == 0 || all[k - 1].weight - all[k].weight > 1e-5;
      const bool clear_below = k + 1 >= static_cast<int>(all.size()) || all[k].weight - all[k + 1].weight > 1e-5;
      if (clear_above && clear_below) wrong_ids += id != all[k].gaussian ? 1 : 0;
      REQUIRE(id >= 0);
      total += weight;
      mean += weight * naive.gaussians[id].feature[0];
    }
    if (filled > 0) {
      const bool boundary_clear = filled == static_cast<int>(all.size()) || all[K - 1].weight - all[K].weight > 1e-5;
      const double expected = reference::naive_feature_mean(naive, reference::naive_topk(pixel, K))[0];
      if (boundary_clear) worst_mean = std::max(worst_mean, std::abs(mean / total - expected));
    }
  }
  INFO("K = ", K, ": worst weight difference ", worst, ", worst feature difference ", worst_mean, ", pixels ", compared,
       ", with K hits ", full, ", with fewer ", short_rows);
  CHECK(compared > n / 2);
  CHECK(wrong_ids == 0);
  CHECK(unordered == 0);
  CHECK(worst < 1e-5);
  CHECK(worst_mean < 1e-4);
}

/// max_weight and Top-K counts; a pixel near a threshold may move a count by one.
template <int K>
void check_statistics(const RenderScene& scene) {
  const Recorded r = record<K>(scene);
  const int num = static_cast<int>(scene.gaussians.size()), n = scene.camera.num_pixels();
  const std::vector<reference::NaivePixel> image = reference::NaiveRenderer(scene.naive()).image();
  const reference::NaiveStatistics expected = reference::naive_statistics(image, num, K);
  int uncertain = 0;
  for (const reference::NaivePixel& pixel : image) {
    const std::vector<reference::NaiveHit> hits = reference::naive_topk(pixel, K + 1);
    const bool tie = hits.size() > K && hits[K - 1].weight - hits[K].weight < 1e-5;
    uncertain += pixel.margin < 1e-3 || tie ? 1 : 0;
  }
  int off = 0, sum = 0, ids = 0;
  for (int i = 0; i < num; ++i) {
    CHECK(static_cast<double>(r.max_weight[i]) == doctest::Approx(expected.max_weight[i]).epsilon(1e-4));
    off += std::abs(r.topk_count[i] - expected.topk_count[i]);
    sum += r.topk_count[i];
  }
  for (int i = 0; i < K * n; ++i) ids += r.id[i] >= 0 ? 1 : 0;
  INFO("K = ", K, ": counts differ by ", off, ", uncertain pixels ", uncertain);
  CHECK(sum == ids);
  CHECK(sum > 0);
  CHECK(off <= 2 * uncertain);
}

}  // namespace

TEST_CASE("Top-K equals the oracle") {
  const RenderScene scene = random_scene(37, 53, 60, layered(), 1);
  check_topk<1>(scene);
  check_topk<3>(scene);
  check_topk<5>(scene);
  check_topk<10>(scene);
  check_topk<16>(scene);
}

TEST_CASE("Top-K over several batches of one tile") {
  SceneRanges r;
  r.thinnest = 0.5;
  r.thickest = 3;
  r.border = 0;
  r.greatest_opacity = 0.3;
  check_topk<3>(random_scene(20, 20, 700, r, 2));
  check_statistics<3>(random_scene(20, 20, 700, r, 2));
}

TEST_CASE("K of at least the number of Gaussians gives the whole alpha blend") {
  const RenderScene scene = random_scene(20, 17, 14, layered(), 3);
  const Recorded r = record<16>(scene);
  const int n = scene.camera.num_pixels();
  for (int i = 0; i < n; ++i) {
    double weights = 0, red = 0;
    for (int k = 0; k < 16; ++k) {
      if (r.id[k * n + i] < 0) continue;
      weights += static_cast<double>(r.weight[k * n + i]);
      red += static_cast<double>(r.weight[k * n + i] * scene.gaussians[r.id[k * n + i]].colour[0]);
    }
    CHECK(red == doctest::Approx(static_cast<double>(r.planes[i])).epsilon(1e-5));
    CHECK(weights + static_cast<double>(r.planes[4 * n + i]) == doctest::Approx(1).epsilon(1e-6));
  }
}

TEST_CASE("of equal weights the front-most Gaussian is kept") {
  RenderScene scene;
  scene.camera = {10, 10, 2, 2, 5, 5};
  // alpha = 1/4, 1/3, 1/2 from front to back: each takes a quarter of the ray. Behind them a smaller weight.
  for (const double o : {0.25, 1 / 3.0, 0.5, 0.3}) {
    Gaussian<1> g;
    g.mean = {0, 0, 1 + 0.5f * static_cast<float>(scene.gaussians.size())};
    g.log_scale.setConstant(5);  // flat over the image
    g.opacity_logit = static_cast<float>(std::log(o / (1 - o)));
    scene.gaussians.push_back(g);
  }
  const Recorded r = record<3>(scene);
  for (int k = 0; k < 3; ++k) CHECK(r.weight[k * 25 + 12] == doctest::Approx(0.25f).epsilon(1e-5));
}

TEST_CASE("statistics equal the oracle") {
  const RenderScene scene = random_scene(37, 53, 60, layered(), 4);
  check_statistics<1>(scene);
  check_statistics<3>(scene);
  check_statistics<10>(scene);
}

TEST_CASE("the order of the Gaussians changes nothing but the ids") {
  const RenderScene scene = random_scene(37, 30, 80, layered(), 5);
  std::vector<int> from(scene.gaussians.size());
  std::iota(from.begin(), from.end(), 0);
  for (std::size_t i = from.size() - 1; i > 0; --i)
    std::swap(from[i], from[CounterRng{6, 0}.below(i, static_cast<std::uint32_t>(i + 1))]);
  RenderScene shuffled = scene;
  for (std::size_t i = 0; i < from.size(); ++i) shuffled.gaussians[i] = scene.gaussians[from[i]];

  const Recorded a = record<3>(scene), b = record<3>(shuffled);
  CHECK(a.planes == b.planes);
  CHECK(a.weight == b.weight);
  int different = 0;
  for (std::size_t i = 0; i < a.id.size(); ++i) different += a.id[i] != (b.id[i] < 0 ? -1 : from[b.id[i]]) ? 1 : 0;
  CHECK(different == 0);
  for (std::size_t i = 0; i < from.size(); ++i) {
    CHECK(b.max_weight[i] == a.max_weight[from[i]]);
    CHECK(b.topk_count[i] == a.topk_count[from[i]]);
  }
}

TEST_CASE("recording does not change the image, and buffers may be reused") {
  const RenderScene big = random_scene(37, 53, 60, {}, 7), small = random_scene(9, 40, 10, {}, 8);
  const Executor<Host> executor;
  const GaussianMap<1> big_map = big.map(), small_map = small.map();
  TopKRasterizer<3> used;
  used.render(executor, big_map.geometry(), big.view());
  used.render(executor, small_map.geometry(), small.view(), false);
  const std::vector<float> plain(used.rendered().colour, used.rendered().colour + 5 * used.num_pixels());
  const std::vector<float> recorded = record<3>(small).planes;
  REQUIRE(plain.size() == recorded.size());
  double worst = 0;  // not 0: a compiler may fuse other multiplications and additions in another instantiation
  for (std::size_t i = 0; i < plain.size(); ++i)
    worst = std::max(worst, static_cast<double>(std::abs(plain[i] - recorded[i])));
  CHECK(worst < 2e-6);
  used.render(executor, big_map.geometry(), big.view());
  const Recorded fresh = record<3>(big);
  CHECK(std::equal(fresh.id.begin(), fresh.id.end(), used.topk_id()));
  CHECK(std::equal(fresh.weight.begin(), fresh.weight.end(), used.topk_weight()));
}
