// SPDX-License-Identifier: Apache-2.0
#include "langgs/optimize/feature_adam.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <type_traits>
#include <vector>

#include "optimize/feature_problem.hpp"
#include "reference/central_difference.hpp"

using namespace langgs;
using test::FeatureProblem;

TEST_CASE_TEMPLATE("FeatureAdam descends the gradient of the naive L1 loss", Dim, std::integral_constant<int, 1>,
                   std::integral_constant<int, 3>, std::integral_constant<int, 16>, std::integral_constant<int, 33>,
                   std::integral_constant<int, 100>, std::integral_constant<int, 512>,
                   std::integral_constant<int, 1153>) {
  constexpr int D = Dim::value;
  FeatureProblem<D, FeatureAdam<>> problem(17);
  std::vector<double> f = problem.features();
  double least = 1;
  (void)problem.loss(f, &least);
  REQUIRE(least > 1e-7);
  const double step = 0.2 * least;  // the difference quotient never crosses a kink

  const FeatureAdam<> optimizer;
  problem.step(Executor<Host>(1), optimizer);

  const int num_checked = std::min(D * problem.kGaussians, 240);
  const double largest = 1.0 / D;
  for (int n = 0; n < num_checked; ++n) {
    const int at = static_cast<int>(static_cast<std::int64_t>(n) * (D * problem.kGaussians) / num_checked);
    const double gradient = reference::central_difference([&] { return problem.loss(f); }, f[at], step);
    // After one step from zero the first moment is (1 - beta1) times the gradient.
    CAPTURE(at);
    REQUIRE(problem.map.feature_state.first.data()[at] / 0.1 ==
            doctest::Approx(gradient).epsilon(1e-4).scale(largest * 1e-2));
    const double moved = f[at] - problem.map.features().data()[at];
    if (std::abs(gradient) > 1e-6)
      REQUIRE(moved == doctest::Approx(std::copysign(3.1623 * optimizer.rate, gradient)).epsilon(1e-3));
    else if (at / D == problem.kGaussians - 1)
      REQUIRE(moved == 0);
  }
}

TEST_CASE_TEMPLATE("FeatureAdam lowers the loss", T, float, Half) {
  FeatureProblem<33, FeatureAdam<T>> problem(6);
  const Executor<Host> executor(2);
  const double first = problem.loss(problem.features());
  for (int i = 0; i < 300; ++i) problem.step(executor);
  CHECK(problem.loss(problem.features()) < 0.6 * first);
}

TEST_CASE("a Gaussian that no teacher sees does not coast on its moments") {
  constexpr int D = 16;
  FeatureProblem<D, FeatureAdam<>> problem(8);
  for (int c = 0; c < D * problem.kGaussians; ++c) {
    problem.map.feature_state.first.data()[c] = 1e-3f;
    problem.map.feature_state.second.data()[c] = 1e-6f;
  }
  const std::vector<double> before = problem.features();
  problem.step(Executor<Host>(1));
  for (int i = 0; i < D * problem.kGaussians; ++i)
    REQUIRE((problem.features()[i] != before[i]) == (i / D != problem.kGaussians - 1));
}

TEST_CASE("settings of FeatureAdam that make no sense are refused") {
  FeatureProblem<16, FeatureAdam<>> problem(8);
  const Executor<Host> executor(1);
  FeatureAdam<> optimizer;
  optimizer.rate = std::nanf("");
  CHECK_THROWS_AS(problem.step(executor, optimizer), InvalidArgument);
  optimizer = {};
  optimizer.beta1 = 1;
  CHECK_THROWS_AS(problem.step(executor, optimizer), InvalidArgument);
}
