// SPDX-License-Identifier: Apache-2.0
#include "langgs/optimize/feature_weight_gradient.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "langgs/core/rng.hpp"
#include "reference/central_difference.hpp"
#include "render/gradient_check.hpp"
#include "render/render_scene.hpp"

using namespace langgs;
using test::RenderScene;

namespace {

/// A rendered scene whose Gaussians have features of D channels, and a teacher that knows all samples but every fifth.
template <int D, int K, class Backend = Host>
struct FeatureScene {
  FeatureScene(const Executor<Backend>& executor, const RenderScene& a_scene, int columns, int rows)
      : scene(a_scene), map(a_scene.map()), grid{columns, rows, a_scene.camera}, teacher(columns, rows) {
    rasterizer.render(executor, map.geometry(), scene.view());
    for (std::size_t i = 0; i < scene.gaussians.size() * D; ++i)
      features.push_back(static_cast<float>(Half(static_cast<float>(0.3 * CounterRng{41, 0}.normal(i)))));
    for (int p = 0; p < columns * rows; ++p) teach(p, p % 5 != 0);
  }
  void teach(int p, bool has_feature) {
    std::vector<float> target(D, 0.f);
    for (int c = 0; c < D && has_feature; ++c)
      target[c] = static_cast<float>(CounterRng{42, static_cast<std::uint64_t>(p)}.normal(c));
    teacher.set_pixel(p % grid.width, p / grid.width, target.data());
  }
  [[nodiscard]] double taught(int p, int c) const {
    return static_cast<double>(static_cast<float>(teacher.pixel(p % grid.width, p / grid.width)[c]));
  }
  [[nodiscard]] double feature(int gaussian, int c) const {
    return static_cast<double>(features[static_cast<std::size_t>(gaussian) * D + c]);
  }
  [[nodiscard]] int id(int k, int pixel) const { return rasterizer.topk_id()[k * rasterizer.num_pixels() + pixel]; }
  [[nodiscard]] bool teaches(int p) const { return id(0, grid.pixel(p)) >= 0 && taught(p, 0) != 0; }

  RenderScene scene;
  GaussianMap<1> map;
  SampleGrid grid;
  FeatureMap<D> teacher;
  TopKRasterizer<K, Backend> rasterizer;
  std::vector<float> features;  ///< [N, D]; exact in half precision
};

/// sum over channels of |F - F*| for sample p with the given raw weights; `least` is the smallest of them.
template <int D, int K>
double naive_loss(const FeatureScene<D, K>& s, int p, const std::vector<double>& weights, double& least) {
  double total = 0, loss = 0;
  for (const double w : weights) total += w;
  least = std::numeric_limits<double>::max();
  for (int c = 0; c < D; ++c) {
    double value = -s.taught(p, c);
    for (std::size_t k = 0; k < weights.size(); ++k)
      value += weights[k] / total * s.feature(s.id(static_cast<int>(k), s.grid.pixel(p)), c);
    loss += std::abs(value);
    least = std::min(least, std::abs(value));
  }
  return loss;
}

/// Every value of dL/dw against central differences by the recorded weights, and zeros where nothing is sampled.
template <int D, int K, class T>
void check_planes(int columns, int rows) {
  CAPTURE(D);
  const Executor<Host> executor;
  const FeatureScene<D, K> s(executor, test::random_scene(45, 33, 60, {}, 21), columns, rows);
  const std::vector<T> features(s.features.begin(), s.features.end());
  FeatureWeightGradient<D, K> on_weights;
  const double loss = on_weights.evaluate(executor, s.rasterizer, s.grid, features.data(), s.teacher, 0.5f);

  const int n = s.rasterizer.num_pixels();
  std::vector<bool> is_sampled(n, false);
  int teaching = 0, compared = 0;
  double expected_loss = 0, unused = 0;
  test::GradientGroup group{"weights"};
  for (int p = 0; p < columns * rows; ++p) teaching += s.teaches(p) ? 1 : 0;
  REQUIRE(teaching > columns * rows / 3);
  for (int p = 0; p < columns * rows; ++p) {
    if (!s.teaches(p)) continue;
    const int pixel = s.grid.pixel(p);
    is_sampled[pixel] = true;
    std::vector<double> weights;
    for (int k = 0; k < K && s.id(k, pixel) >= 0; ++k)
      weights.push_back(static_cast<double>(s.rasterizer.topk_weight()[k * n + pixel]));
    double least = 0;
    expected_loss += naive_loss(s, p, weights, least) / (static_cast<double>(teaching) * D);
    for (std::size_t k = weights.size(); k < K; ++k) REQUIRE(on_weights.view().gradient[k * n + pixel] == 0);
    if (least < 1e-5) continue;  // near a kink, where single precision may see the other sign
    for (std::size_t k = 0; k < weights.size(); ++k) {
      const double step = 0.02 * least * weights[0];  // does not reach the kink
      const double slope =
          reference::central_difference([&] { return naive_loss(s, p, weights, unused); }, weights[k], step);
      group.add(static_cast<double>(on_weights.view().gradient[k * n + pixel]),
                0.5 * slope / (static_cast<double>(teaching) * D));
    }
    ++compared;
  }
  CHECK(loss == doctest::Approx(expected_loss).epsilon(1e-5));
  CHECK(compared > teaching * 3 / 4);
  group.check("planes", 1e-4);
  for (int k = 0; k < K; ++k)
    for (int i = 0; i < n; ++i)
      if (!is_sampled[i]) REQUIRE(on_weights.view().gradient[k * n + i] == 0);
}

/// L_feat of the oracle through its own Top-K, at the samples where neither the K largest weights nor a sign of F - F*
/// is about to change; the others get no teacher.
template <int D, int K>
void check_geometry(const RenderScene& scene, int columns, int rows, const std::string& name) {
  const Executor<Host> executor;
  FeatureScene<D, K> s(executor, scene, columns, rows);
  test::OracleLoss loss(scene);
  for (std::size_t i = 0; i < scene.gaussians.size(); ++i) {
    loss.scene().gaussians[i].feature.resize(D);
    for (int c = 0; c < D; ++c) loss.scene().gaussians[i].feature[c] = s.feature(static_cast<int>(i), c);
  }
  struct Sample {
    int index = -1;  ///< in the teacher
    std::vector<int> gaussians;
    std::vector<bool> signs;
  };
  /// Which decisions sample p makes, its loss, and how far the closest decision is.
  const auto look = [&](int p, const reference::NaivePixel& pixel, Sample& sample, double& margin) {
    const std::vector<reference::NaiveHit> hits = reference::naive_topk(pixel, K);
    const Eigen::VectorXd mean = reference::naive_feature_mean(loss.scene(), hits);
    double sum = 0;
    margin = 1;
    sample = {p, {}, {}};
    for (const reference::NaiveHit& hit : hits) sample.gaussians.push_back(hit.gaussian);
    std::sort(sample.gaussians.begin(), sample.gaussians.end());
    const std::vector<reference::NaiveHit> all = reference::naive_topk(pixel, K + 1);
    if (all.size() > K) margin = 1 - all[K].weight / all[K - 1].weight;
    for (int c = 0; c < D; ++c) {
      const double difference = mean[c] - s.taught(p, c);
      sample.signs.push_back(difference > 0);
      margin = std::min(margin, std::abs(difference));
      sum += std::abs(difference);
    }
    return sum;
  };
  std::vector<Sample> at_pixel(scene.camera.num_pixels());
  int teaching = 0, several = 0;
  const reference::NaiveRenderer oracle(loss.scene());
  for (int p = 0; p < columns * rows; ++p) {
    const int i = s.grid.pixel(p);
    const reference::NaivePixel pixel = oracle.pixel(i % scene.camera.width, i / scene.camera.width);
    Sample sample;
    double margin = 0;
    if (!pixel.hits.empty()) look(p, pixel, sample, margin);
    s.teach(p, loss.counts(i) && margin > 3e-3);
    if (!s.teaches(p)) continue;
    look(p, pixel, at_pixel[i], margin);
    several += at_pixel[i].gaussians.size() > 1 ? 1 : 0;
    ++teaching;
  }
  REQUIRE(teaching > columns * rows / 3);
  REQUIRE(several > teaching / 3);

  loss.term = [&](int i, const reference::NaivePixel& pixel) {
    if (at_pixel[i].index < 0) return 0.0;
    Sample now;
    double margin = 0;
    const double sum = look(at_pixel[i].index, pixel, now, margin);
    loss.crossed = loss.crossed || now.gaussians != at_pixel[i].gaussians || now.signs != at_pixel[i].signs;
    return sum / (static_cast<double>(teaching) * D);
  };
  FeatureWeightGradient<D, K> on_weights;
  const double value = on_weights.evaluate(executor, s.rasterizer, s.grid, s.features.data(), s.teacher);
  CHECK(value == doctest::Approx(loss()).epsilon(1e-5));
  REQUIRE(!loss.crossed);

  const std::vector<float> zero(static_cast<std::size_t>(3) * scene.camera.num_pixels(), 0.f);
  MapGradient<Host> gradient;
  s.rasterizer.backward(executor, s.map.geometry(), {zero.data(), zero.data()}, gradient, on_weights.view());
  const test::KernelGradient kernel(Executor<Host>(1), gradient, scene.gaussians.size());
  test::check_gradients(kernel, loss, name, 1e-4, kRed);
}

/// The loss and dL/dw, as bits to compare.
template <class Backend>
std::vector<double> everything(const Executor<Backend>& executor) {
  constexpr int kD = 33, kK = 3;
  const FeatureScene<kD, kK, Backend> s(executor, test::random_scene(45, 33, 300, {}, 23), 15, 11);
  FeatureWeightGradient<kD, kK, Backend> on_weights;
  std::vector<double> result{on_weights.evaluate(executor, s.rasterizer, s.grid, s.features.data(), s.teacher, 100.f)};
  for (int i = 0; i < kK * s.rasterizer.num_pixels(); ++i)
    result.push_back(static_cast<double>(on_weights.view().gradient[i]));
  return result;
}

}  // namespace

TEST_CASE("dL/dw equals central differences by the recorded weights, for float and half features") {
  check_planes<1, 3, float>(45, 33);
  check_planes<3, 2, Half>(11, 8);
  check_planes<33, 3, float>(15, 11);
  check_planes<33, 5, Half>(45, 33);
  check_planes<512, 3, float>(11, 8);
  check_planes<512, 3, Half>(7, 33);
}

TEST_CASE("the feature loss's gradient through the Top-K weights equals central differences") {
  test::SceneRanges r;
  r.border = 0.1;
  r.thinnest = 2;
  check_geometry<8, 3>(test::random_scene(37, 21, 25, r, 1), 37, 21, "a sample a pixel");
  check_geometry<8, 3>(test::random_scene(37, 21, 25, r, 2), 18, 10, "a coarse grid");
  check_geometry<33, 5>(test::random_scene(20, 18, 40, r, 3), 20, 18, "K = 5");
}

TEST_CASE("with K = 1 the weight cancels: the gradient is exactly zero") {
  const Executor<Host> executor;
  FeatureScene<16, 1> s(executor, test::random_scene(37, 21, 60, {}, 5), 37, 21);
  FeatureWeightGradient<16, 1> on_weights;
  CHECK(on_weights.evaluate(executor, s.rasterizer, s.grid, s.features.data(), s.teacher) > 0.1);
  for (int i = 0; i < 37 * 21; ++i) REQUIRE(on_weights.view().gradient[i] == 0);
  const std::vector<float> zero(3 * 37 * 21, 0.f);
  MapGradient<Host> gradient;
  s.rasterizer.backward(executor, s.map.geometry(), {zero.data(), zero.data()}, gradient, on_weights.view());
  REQUIRE(gradient.size() > 20);
  for (int p = 0; p < kNumPlanes; ++p)
    for (int c = 0; c < gradient.size(); ++c) REQUIRE(gradient.planes().plane(p)[c] == 0);
  CHECK(gradient.pose() == Twist::Zero());
}

TEST_CASE("a multiplier scales the gradient, not the loss; nothing to learn gives zeros") {
  const Executor<Host> executor;
  FeatureScene<16, 3> s(executor, test::random_scene(45, 33, 60, {}, 6), 15, 11);
  FeatureWeightGradient<16, 3> on_weights;
  const auto evaluate = [&](float weight) {
    return on_weights.evaluate(executor, s.rasterizer, s.grid, s.features.data(), s.teacher, weight);
  };
  const std::size_t size = static_cast<std::size_t>(3) * s.rasterizer.num_pixels();
  const auto planes = [&] {
    const float* values = on_weights.view().gradient;
    return std::vector<float>(values, values + size);
  };
  const double loss = evaluate(1);
  std::vector<float> once = planes();
  CHECK(loss > 0.1);
  CHECK(evaluate(4) == loss);
  for (float& v : once) v *= 4;
  CHECK(planes() == once);

  const std::vector<float> zeros(size, 0.f);
  SUBCASE("no teacher") {
    s.teacher = FeatureMap<16>(15, 11);
    CHECK(evaluate(1) == 0);
    CHECK(planes() == zeros);
  }
  SUBCASE("no Gaussian in sight") {
    s.rasterizer.render(executor, GaussianMap<1>().geometry(), s.scene.view());
    CHECK(evaluate(1) == 0);
    CHECK(planes() == zeros);
  }
}

TEST_CASE("samples that share pixels and inputs that do not belong together are refused") {
  const Executor<Host> executor;
  const RenderScene scene = test::random_scene(20, 15, 30, {}, 7);
  const FeatureScene<4, 3> s(executor, scene, 10, 5);
  FeatureWeightGradient<4, 3> on_weights;
  const auto evaluate = [&](const SampleGrid& grid, const FeatureMap<4>& teacher, float weight) {
    return on_weights.evaluate(executor, s.rasterizer, grid, s.features.data(), teacher, weight);
  };
  CHECK(evaluate(s.grid, s.teacher, 1) > 0);
  CHECK_THROWS_AS(evaluate({21, 5, scene.camera}, FeatureMap<4>(21, 5), 1), InvalidArgument);
  CHECK_THROWS_AS(evaluate({10, 16, scene.camera}, FeatureMap<4>(10, 16), 1), InvalidArgument);
  CHECK_THROWS_AS(evaluate(s.grid, FeatureMap<4>(5, 10), 1), InvalidArgument);
  CHECK_THROWS_AS(evaluate({0, 0, scene.camera}, FeatureMap<4>(), 1), InvalidArgument);
  CHECK_THROWS_AS(evaluate({10, 5, test::empty_scene(20, 16).camera}, s.teacher, 1), InvalidArgument);
  CHECK_THROWS_AS(evaluate(s.grid, s.teacher, std::numeric_limits<float>::quiet_NaN()), InvalidArgument);
}

TEST_CASE("the gradient is the same bits for any number of threads and any order, and no sync is missing") {
  const std::vector<double> one = everything(Executor<Host>(1));
  CHECK(one == everything(Executor<Host>(2)));
  CHECK(one == everything(Executor<Host>(3)));
  Executor<CheckedHost> checked(2);
  const std::vector<double> ascending = everything(checked);
  checked.order = ExecutionOrder::descending;
  CHECK(ascending == everything(checked));
  checked.order = ExecutionOrder::shuffled;
  for (checked.seed = 1; checked.seed <= 3; ++checked.seed) CHECK(ascending == everything(checked));
}
