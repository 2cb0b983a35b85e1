// SPDX-License-Identifier: Apache-2.0
#include "langgs/optimize/feature_average.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <type_traits>
#include <vector>

#include "optimize/feature_problem.hpp"

using namespace langgs;
using test::FeatureProblem;

namespace {

/// The formula of FeatureAverage in double, one step from `f` and `confidence`.
template <class Problem>
void reference_step(const Problem& problem, std::vector<double>& f, std::vector<double>& confidence,
                    const FeatureAverage<>& settings) {
  const int dim = static_cast<int>(f.size()) / Problem::kGaussians;
  for (int g = 0; g < Problem::kGaussians; ++g) {
    double weight = 0;
    std::vector<double> sum(static_cast<std::size_t>(dim));
    for (int p = 0; p < Problem::kPixels; ++p)
      for (int i = problem.begin[p]; i < problem.begin[p + 1]; ++i) {
        if (problem.gaussian[i] != g) continue;
        weight += static_cast<double>(problem.contribution[i].weight);
        for (int c = 0; c < dim; ++c)
          sum[c] += static_cast<double>(problem.contribution[i].weight) * problem.target(p, c);
      }
    if (weight == 0) continue;
    const double known =
        std::min(std::max(confidence[g], static_cast<double>(settings.prior)), static_cast<double>(settings.window));
    for (int c = 0; c < dim; ++c) f[g * dim + c] = (known * f[g * dim + c] + sum[c]) / (known + weight);
    confidence[g] = known + weight;
  }
}

}  // namespace

TEST_CASE_TEMPLATE("FeatureAverage in full precision is its formula", Dim, std::integral_constant<int, 1>,
                   std::integral_constant<int, 3>, std::integral_constant<int, 16>, std::integral_constant<int, 33>,
                   std::integral_constant<int, 100>, std::integral_constant<int, 512>, std::integral_constant<int, 768>,
                   std::integral_constant<int, 1153>) {
  constexpr int D = Dim::value;
  FeatureProblem<D, FeatureAverage<float>> problem(17);
  std::vector<double> f = problem.features(), confidence(problem.kGaussians);
  FeatureAverage<float> optimizer;
  optimizer.prior = 0.5f;
  optimizer.window = 6;  // reached within a few steps
  const Executor<Host> executor(1);
  for (int n = 0; n < 7; ++n) {
    reference_step(problem, f, confidence, {optimizer.prior, optimizer.window});
    problem.step(executor, optimizer);
  }
  for (int i = 0; i < D * problem.kGaussians; ++i) REQUIRE(std::abs(problem.features()[i] - f[i]) < 1e-6);
  for (int g = 0; g < problem.kGaussians; ++g)
    REQUIRE(problem.map.feature_state.confidence.data()[g] == doctest::Approx(confidence[g]).epsilon(1e-6));
}

TEST_CASE("FeatureAverage in half precision stays within its rounding") {
  constexpr int D = 100;
  FeatureProblem<D, FeatureAverage<>> problem(5);
  std::vector<double> f = problem.features(), confidence(problem.kGaussians);
  const Executor<Host> executor(1);
  for (int n = 0; n < 50; ++n) {
    reference_step(problem, f, confidence, {});
    problem.step(executor);
  }
  // Values below 1/2: half a unit in the last place is 2^-13; the average forgets as much as each step rounds.
  for (int i = 0; i < D * problem.kGaussians; ++i)
    REQUIRE(std::abs(problem.features()[i] - f[i]) < 64 * std::ldexp(1.0, -13) / 4);
}

TEST_CASE("FeatureAverage needs few steps and then stays") {
  FeatureProblem<33, FeatureAverage<>> problem(6);
  const Executor<Host> executor(2);
  const double first = problem.loss(problem.features());
  for (int i = 0; i < 10; ++i) problem.step(executor);
  const double after_ten = problem.loss(problem.features());
  CHECK(after_ten < 0.6 * first);
  for (int i = 0; i < 1000; ++i) problem.step(executor);
  CHECK(problem.loss(problem.features()) < 1.02 * after_ten);
}

TEST_CASE("a Gaussian keeps the feature of a teacher that every view agrees on") {
  constexpr int D = 16;
  FeatureProblem<D, FeatureAverage<float>> problem(3);
  std::vector<float> same(D, 0.25f);  // of unit length
  for (int p = 2; p < problem.kPixels; ++p) problem.teacher.set_pixel(p % 5, p / 5, same.data());
  const Executor<Host> executor(1);
  FeatureAverage<float> optimizer;
  optimizer.prior = 0;  // what a Gaussian is inserted with does not count
  problem.step(executor, optimizer);
  for (int i = 0; i < D * (problem.kGaussians - 1); ++i)
    REQUIRE(problem.features()[i] == doctest::Approx(0.25).epsilon(1e-6));
}

TEST_CASE("what no pixel uses does not move, and no pixel moves nothing") {
  constexpr int D = 16;
  FeatureProblem<D, FeatureAverage<>> problem(8);
  const Executor<Host> executor(1);
  const std::vector<double> before = problem.features();
  const std::vector<std::int32_t> begin(problem.kPixels + 1, 0);
  problem.feature_step.step(executor, {}, problem.map, {5, 3, 0, begin.data(), nullptr, nullptr}, problem.teacher);
  CHECK(problem.features() == before);
  problem.step(executor);
  for (int i = 0; i < D * problem.kGaussians; ++i)
    REQUIRE((problem.features()[i] != before[i]) == (i / D != problem.kGaussians - 1));
  CHECK(problem.map.feature_state.confidence.data()[problem.kGaussians - 1] == 0);
}

TEST_CASE("a teacher of another size and settings that make no sense are refused") {
  FeatureProblem<16, FeatureAverage<>> problem(8);
  const Executor<Host> executor(1);
  CHECK_THROWS_AS(problem.feature_step.step(executor, {}, problem.map, problem.view(), FeatureMap<16>(4, 3)),
                  InvalidArgument);
  CHECK_THROWS_AS(problem.step(executor, {.prior = -1}), InvalidArgument);
  CHECK_THROWS_AS(problem.step(executor, {.prior = 2, .window = 1}), InvalidArgument);
  CHECK_THROWS_AS(problem.step(executor, {.prior = std::nanf("")}), InvalidArgument);
}
