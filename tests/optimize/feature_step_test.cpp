// SPDX-License-Identifier: Apache-2.0
#include "langgs/optimize/feature_step.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <vector>

#include "langgs/core/rng.hpp"
#include "reference/central_difference.hpp"

using namespace langgs;

namespace {

/// Made-up contributions of N Gaussians to the pixels of a small teacher: pixel 0 has none, pixel 1 no teacher.
template <int D>
struct FeatureProblem {
  static constexpr int kWidth = 5, kHeight = 3, kPixels = kWidth * kHeight, kGaussians = 12;

  explicit FeatureProblem(std::uint64_t seed) : teacher(kWidth, kHeight) {
    const CounterRng rng{seed, 0};
    std::vector<Gaussian<D>> gaussians(kGaussians);
    for (int i = 0; i < kGaussians; ++i)
      for (int c = 0; c < D; ++c) gaussians[i].feature[c] = static_cast<float>(0.3 * rng.normal(1000 + i * D + c));
    map.append(gaussians, 0, 0);

    begin.push_back(0);
    for (int p = 0; p < kPixels; ++p) {
      const int hits = p == 0 ? 0 : 1 + static_cast<int>(rng.below(p, 4));
      for (int k = 0; k < hits; ++k) {
        gaussian.push_back((3 * p + 5 * k) % (kGaussians - 1));  // the last one is never seen
        weight.push_back(static_cast<float>(0.1 + 0.8 * rng.uniform(500 + 8 * p + k)));
      }
      begin.push_back(static_cast<std::int32_t>(gaussian.size()));
      std::vector<float> target(D);
      for (int c = 0; c < D; ++c) target[c] = static_cast<float>(rng.normal(90000 + p * D + c));
      if (p != 1) teacher.set_pixel(p % kWidth, p / kWidth, target.data());
    }
  }
  [[nodiscard]] ContributionView view() const {
    return {kPixels, static_cast<int>(gaussian.size()), begin.data(), gaussian.data(), weight.data()};
  }
  [[nodiscard]] std::vector<double> features() const {
    return std::vector<double>(map.features().data(), map.features().data() + kGaussians * D);
  }
  /// mean |F - F*| over teaching pixels and channels; `least` becomes the smallest difference met.
  [[nodiscard]] double loss(const std::vector<double>& f, double* least = nullptr) const {
    double sum = 0;
    for (int p = 2; p < kPixels; ++p)
      for (int c = 0; c < D; ++c) {
        double value = -static_cast<double>(static_cast<float>(teacher.pixel(p % kWidth, p / kWidth)[c]));
        for (int i = begin[p]; i < begin[p + 1]; ++i) value += weight[i] * f[gaussian[i] * D + c];
        sum += std::abs(value);
        if (least) *least = std::min(*least, std::abs(value));
      }
    return sum / ((kPixels - 2) * D);
  }

  GaussianMap<D> map;
  FeatureMap<D> teacher;
  std::vector<std::int32_t> begin, gaussian;
  std::vector<float> weight;
};

constexpr float kRate = 1e-3f;

LearningRates rates() {
  LearningRates r;
  r.feature = kRate;
  return r;
}

}  // namespace

TEST_CASE_TEMPLATE("the feature step descends the gradient of the naive L1 loss", Dim, std::integral_constant<int, 1>,
                   std::integral_constant<int, 3>, std::integral_constant<int, 16>, std::integral_constant<int, 33>,
                   std::integral_constant<int, 100>, std::integral_constant<int, 512>) {
  constexpr int D = Dim::value;
  FeatureProblem<D> problem(17);
  std::vector<double> f = problem.features();
  double least = 1;
  const double expected_loss = problem.loss(f, &least);
  REQUIRE(least > 1e-7);
  const double step = 0.2 * least;  // the difference quotient never crosses a kink

  const Executor<Host> executor(1);
  FeatureStep<D, Host> optimizer(rates());
  const double loss = optimizer.step(executor, problem.map, problem.view(), problem.teacher);
  CHECK(loss == doctest::Approx(expected_loss).epsilon(1e-5));

  const int num_checked = std::min(D * problem.kGaussians, 240);
  const double largest = 1.0 / D;
  for (int n = 0; n < num_checked; ++n) {
    const int at = static_cast<int>(static_cast<std::int64_t>(n) * (D * problem.kGaussians) / num_checked);
    const double gradient = reference::central_difference([&] { return problem.loss(f); }, f[at], step);
    // After one step from zero the first moment is (1 - beta1) times the gradient.
    CAPTURE(at);
    REQUIRE(problem.map.first_moment.feature.data()[at] / 0.1 ==
            doctest::Approx(gradient).epsilon(1e-4).scale(largest * 1e-2));
    const double moved = f[at] - problem.map.features().data()[at];
    if (std::abs(gradient) > 1e-6)
      REQUIRE(moved == doctest::Approx(std::copysign(3.1623 * kRate, gradient)).epsilon(1e-3));
    else if (at / D == problem.kGaussians - 1)
      REQUIRE(moved == 0);
  }
}

TEST_CASE("a hundred feature steps agree with a scalar Adam in double") {
  constexpr int D = 3;
  FeatureProblem<D> problem(4);
  const Executor<Host> executor(1);
  FeatureStep<D, Host> optimizer(rates());
  std::vector<double> m(D * problem.kGaussians), v(m), f = problem.features();
  for (int n = 0; n < 100; ++n) {
    // The reference takes its gradient where the map stands: signs near a kink are not its subject.
    const std::vector<double> at = problem.features();
    std::vector<double> gradient(at.size());
    for (int p = 2; p < problem.kPixels; ++p)
      for (int c = 0; c < D; ++c) {
        float value = 0;
        for (int i = problem.begin[p]; i < problem.begin[p + 1]; ++i)
          value += problem.weight[i] * static_cast<float>(at[problem.gaussian[i] * D + c]);
        const float target = static_cast<float>(problem.teacher.pixel(p % 5, p / 5)[c]);
        for (int i = problem.begin[p]; i < problem.begin[p + 1]; ++i)
          gradient[problem.gaussian[i] * D + c] += (value > target ? 1 : -1) * problem.weight[i];
      }
    optimizer.step(executor, problem.map, problem.view(), problem.teacher);
    for (std::size_t i = 0; i < f.size(); ++i) {
      const double g = gradient[i] / ((problem.kPixels - 2) * D);
      m[i] = 0.9f * m[i] + (1 - 0.9f) * g;
      v[i] = 0.999f * v[i] + (1 - 0.999f) * g * g;
      f[i] -= kRate * m[i] / (std::sqrt(v[i]) + 1e-15);
    }
  }
  for (std::size_t i = 0; i < f.size(); ++i)
    CHECK(problem.map.features().data()[i] == doctest::Approx(f[i]).epsilon(1e-4).scale(0.1));
}

TEST_CASE("the feature loss decreases") {
  constexpr int D = 33;
  FeatureProblem<D> problem(6);
  const Executor<Host> executor(2);
  FeatureStep<D, Host> optimizer(rates());
  const double first = optimizer.step(executor, problem.map, problem.view(), problem.teacher);
  double last = first;
  for (int i = 0; i < 300; ++i) last = optimizer.step(executor, problem.map, problem.view(), problem.teacher);
  CHECK(last < 0.6 * first);
}

TEST_CASE("what does not teach moves nothing") {
  constexpr int D = 16;
  FeatureProblem<D> problem(8);
  const Executor<Host> executor(1);
  FeatureStep<D, Host> optimizer(rates());

  SUBCASE("no pixel has a teacher") {
    const std::vector<double> before = problem.features();
    CHECK(optimizer.step(executor, problem.map, problem.view(), FeatureMap<D>(5, 3)) == 0);
    CHECK(problem.features() == before);
  }
  SUBCASE("no pixel is hit") {
    const std::vector<double> before = problem.features();
    const std::vector<std::int32_t> begin(problem.kPixels + 1, 0);
    CHECK(optimizer.step(executor, problem.map, {problem.kPixels, 0, begin.data(), nullptr, nullptr},
                         problem.teacher) == 0);
    CHECK(problem.features() == before);
  }
  SUBCASE("a Gaussian that only pixels without a teacher see does not coast on its moments") {
    for (int c = 0; c < D * problem.kGaussians; ++c) {
      problem.map.first_moment.feature.data()[c] = 1e-3f;
      problem.map.second_moment.feature.data()[c] = 1e-6f;
    }
    FeatureMap<D> teacher(5, 3);  // pixel 7 alone
    std::vector<float> feature(D, 0.25f);
    teacher.set_pixel(2, 1, feature.data());
    const std::vector<double> before = problem.features();
    optimizer.step(executor, problem.map, problem.view(), teacher);
    std::vector<bool> taught(problem.kGaussians, false);
    for (int i = problem.begin[7]; i < problem.begin[8]; ++i) taught[problem.gaussian[i]] = true;
    for (int i = 0; i < D * problem.kGaussians; ++i)
      REQUIRE((problem.features()[i] != before[i]) == static_cast<bool>(taught[i / D]));
  }
  SUBCASE("a teacher of another size is refused") {
    CHECK_THROWS_AS(optimizer.step(executor, problem.map, problem.view(), FeatureMap<D>(4, 3)), InvalidArgument);
  }
}

TEST_CASE("the feature step gives the same bits for any number of threads") {
  constexpr int D = 100;
  std::vector<double> first;
  for (const int threads : {1, 2, 3}) {
    FeatureProblem<D> problem(3);
    const Executor<Host> executor(threads);
    FeatureStep<D, Host> optimizer(rates());
    for (int i = 0; i < 5; ++i) optimizer.step(executor, problem.map, problem.view(), problem.teacher);
    if (first.empty()) first = problem.features();
    CHECK(problem.features() == first);
  }
}

TEST_CASE("a feature step on a checked host misses no barrier in any order of execution") {
  constexpr int D = 33;
  std::vector<float> first;
  for (const ExecutionOrder order : {ExecutionOrder::ascending, ExecutionOrder::descending, ExecutionOrder::shuffled}) {
    FeatureProblem<D> problem(3);
    GaussianMap<D, CheckedHost> map;
    std::vector<Gaussian<D>> gaussians;
    for (int i = 0; i < problem.kGaussians; ++i) gaussians.push_back(problem.map[i]);
    map.append(gaussians, 0, 0);
    Executor<CheckedHost> executor(1);
    executor.order = order;
    FeatureStep<D, CheckedHost> optimizer(rates());
    optimizer.step(executor, map, problem.view(), problem.teacher);
    std::vector<float> features(map.features().data(), map.features().data() + D * problem.kGaussians);
    if (first.empty()) first = features;
    CHECK(features == first);
  }
}
