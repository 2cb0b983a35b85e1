// SPDX-License-Identifier: Apache-2.0
#include "langgs/optimize/adam.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "langgs/core/rng.hpp"
#include "langgs/render/topk_rasterizer.hpp"
#include "render/render_scene.hpp"

using namespace langgs;

namespace {

/// Adam without bias correction, one number at a time, in double.
struct ScalarAdam {
  double value = 0, first = 0, second = 0;

  void step(double gradient, double rate, const LearningRates& r) {
    const double beta1 = r.beta1, beta2 = r.beta2;
    first = beta1 * first + (1 - beta1) * gradient;
    second = beta2 * second + (1 - beta2) * gradient * gradient;
    value -= rate * first / (std::sqrt(second) + static_cast<double>(r.epsilon));
  }
};

double rate_of(int plane, const LearningRates& r) {
  if (plane <= kMeanZ) return r.mean;
  if (plane <= kLogScaleZ) return r.log_scale;
  if (plane <= kRotationZ) return r.rotation;
  return plane == kOpacityLogit ? r.opacity_logit : r.colour;
}

/// A map, a view of it and a loss that is linear in colour and depth; and the reference of every parameter.
class Bench {
 public:
  /// With a border some Gaussians are out of sight; without, the visible ones are neighbours in the map.
  explicit Bench(int num_threads = 1, double border = 0.8) : executor(num_threads) {
    test::SceneRanges ranges;
    ranges.border = border;
    scene = test::random_scene(40, 28, 90, ranges, 5);
    map = scene.map();
    upstream.resize_discard(4 * static_cast<std::size_t>(scene.camera.num_pixels()));
    for (std::size_t i = 0; i < upstream.size(); ++i)
      upstream.data()[i] = static_cast<float>(1e-3 * CounterRng{9, 0}.normal(i));
    reference.resize(static_cast<std::size_t>(kNumPlanes) * map.size());
    for (int p = 0; p < kNumPlanes; ++p)
      for (int i = 0; i < map.size(); ++i) at(p, i).value = map.geometry().plane(p)[i];
  }
  ScalarAdam& at(int plane, int i) { return reference[static_cast<std::size_t>(plane) * map.size() + i]; }

  void compute_gradient() {
    const View view = scene.view();
    rasterizer.render(executor, map.geometry(), view);
    const float* base = upstream.data();
    rasterizer.backward(executor, map.geometry(), {base, base + 3 * scene.camera.num_pixels()}, gradient);
  }
  void step() {
    compute_gradient();
    for (int k = 0; k < gradient.size(); ++k)
      for (int p = 0; p < kNumPlanes; ++p)
        at(p, gradient.gaussian()[k]).step(gradient.planes().plane(p)[k], rate_of(p, rates), rates);
    adam.step(executor, map, gradient);
  }
  /// Largest deviation from the reference, in units of the length of one step.
  double worst() {
    double most = 0;
    for (int p = 0; p < kNumPlanes; ++p)
      for (int i = 0; i < map.size(); ++i) {
        const double value = map.geometry().plane(p)[i];
        const double step = rate_of(p, rates) + 1e-5 * std::abs(value);
        most = std::max(most, std::abs(value - at(p, i).value) / step);
      }
    return most;
  }

  Executor<Host> executor;
  test::RenderScene scene;
  GaussianMap<1> map;
  LearningRates rates{.mean = 2e-4f};  // long steps: the rounding of a coordinate must not hide an error
  SelectiveAdam<Host> adam{rates};
  TopKRasterizer<3> rasterizer;
  MapGradient<Host> gradient;
  Buffer<float, Host> upstream;
  std::vector<ScalarAdam> reference;
};

}  // namespace

TEST_CASE("one Adam step and a hundred agree with a scalar reference in double") {
  Bench bench;
  bench.step();
  REQUIRE(bench.gradient.size() > 20);
  CHECK(bench.worst() < 1e-3);
  for (int i = 1; i < 100; ++i) bench.step();
  CHECK(bench.worst() < 0.02);  // a hundred steps long: relative error 2e-4
  const PlanesView m = bench.map.first_moment.view(), v = bench.map.second_moment.view();
  for (int p = 0; p < kNumPlanes; ++p)
    for (int k = 0; k < bench.gradient.size(); ++k) {
      const int i = bench.gradient.gaussian()[k];
      const ScalarAdam& r = bench.at(p, i);
      REQUIRE(std::abs(m.plane(p)[i] - r.first) <= 1e-4 * (std::sqrt(r.second) + 1e-12));
      REQUIRE(std::abs(v.plane(p)[i] - r.second) <= 1e-4 * (r.second + 1e-24));
    }
}

TEST_CASE("Adam of a map that is all in sight agrees with the scalar reference") {
  Bench bench(1, -0.1);
  for (int i = 0; i < 3; ++i) bench.step();
  REQUIRE(bench.gradient.size() == bench.map.size());
  CHECK(bench.worst() < 3e-3);
}

TEST_CASE("a first step has the length that the missing bias correction gives") {
  Bench bench;
  bench.compute_gradient();
  const int k = 0, i = bench.gradient.gaussian()[k];
  const float before = bench.map.geometry().plane(kRed)[i], g = bench.gradient.planes().plane(kRed)[k];
  REQUIRE(g != 0.f);
  bench.adam.step(bench.executor, bench.map, bench.gradient);
  const double length = 0.1 / std::sqrt(0.001);  // (1 - beta1) / sqrt(1 - beta2)
  CHECK(before - bench.map.geometry().plane(kRed)[i] ==
        doctest::Approx(std::copysign(length * bench.rates.colour, g)).epsilon(1e-3));
}

TEST_CASE("Gaussians out of sight keep parameters and moments to the bit") {
  Bench bench;
  bench.compute_gradient();
  std::vector<bool> seen(bench.map.size(), false);
  for (int k = 0; k < bench.gradient.size(); ++k) seen[bench.gradient.gaussian()[k]] = true;
  REQUIRE(std::count(seen.begin(), seen.end(), false) > 5);
  // Moments that a step would move even with a gradient of zero.
  for (int p = 0; p < kNumPlanes; ++p)
    for (int i = 0; i < bench.map.size(); ++i) {
      bench.map.first_moment.view().plane(p)[i] = 0.5f;
      bench.map.second_moment.view().plane(p)[i] = 0.25f;
    }
  std::vector<Gaussian<1>> before;
  for (int i = 0; i < bench.map.size(); ++i) before.push_back(bench.map[i]);
  bench.adam.step(bench.executor, bench.map, bench.gradient);
  for (int i = 0; i < bench.map.size(); ++i) {
    CAPTURE(i);
    const bool same = bench.map[i].mean == before[i].mean && bench.map[i].opacity_logit == before[i].opacity_logit &&
                      bench.map.first_moment.view().plane(kMeanX)[i] == 0.5f &&
                      bench.map.second_moment.view().plane(kBlue)[i] == 0.25f;
    REQUIRE(same == !seen[i]);
    REQUIRE(bench.map[i].feature == before[i].feature);
  }
}

TEST_CASE("pruned rows keep their own moments and new rows begin without") {
  Bench bench;
  for (int i = 0; i < 5; ++i) bench.step();
  std::vector<std::int32_t> keep(bench.map.size()), kept;
  for (int i = 0; i < bench.map.size(); ++i) {
    keep[i] = i % 3 != 1;
    if (keep[i]) kept.push_back(i);
  }
  std::vector<ScalarAdam> reference;
  for (int p = 0; p < kNumPlanes; ++p) {
    for (const int i : kept) reference.push_back(bench.at(p, i));
    for (int i = 0; i < 2; ++i) reference.emplace_back();
  }
  bench.map.prune(keep);
  bench.map.append({bench.scene.gaussians[0], bench.scene.gaussians[1]}, 0, 0);
  bench.reference = reference;
  for (int p = 0; p < kNumPlanes; ++p)
    for (int i = bench.map.size() - 2; i < bench.map.size(); ++i) {
      bench.at(p, i).value = bench.map.geometry().plane(p)[i];
      REQUIRE(bench.map.first_moment.view().plane(p)[i] == 0.f);
    }
  CHECK(bench.worst() < 0.005);
  for (int i = 0; i < 5; ++i) bench.step();  // wrong moments would go whole steps astray
  CHECK(bench.worst() < 0.01);
}

TEST_CASE("Adam gives the same bits for any number of threads") {
  Bench one(1), three(3);
  for (int i = 0; i < 5; ++i) {
    one.step();
    three.step();
  }
  for (int p = 0; p < kNumPlanes; ++p)
    CHECK(std::equal(one.map.geometry().plane(p), one.map.geometry().plane(p) + one.map.size(),
                     three.map.geometry().plane(p)));
}
