// SPDX-License-Identifier: Apache-2.0
#include "langgs/optimize/feature_average.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <vector>

#include "optimize/feature_problem.hpp"

using namespace langgs;
using test::FeatureProblem;

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
