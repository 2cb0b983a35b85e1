// SPDX-License-Identifier: Apache-2.0
#include "langgs/optimize/feature_step.hpp"

#include <doctest/doctest.h>

#include <cstring>
#include <set>
#include <vector>

#include "langgs/optimize/feature_adam.hpp"
#include "langgs/optimize/feature_average.hpp"
#include "optimize/feature_problem.hpp"

using namespace langgs;
using test::FeatureProblem;

namespace {

/// Random contributions of `num_gaussians` Gaussians to a grid.
struct RandomGrid {
  RandomGrid(int columns, int rows, int num_gaussians) : width(columns), height(rows) {
    const CounterRng rng{11, 0};
    for (int p = 0; p < width * height; ++p) {
      for (std::uint32_t k = 0; k < rng.below(p, 4); ++k) {
        gaussian.push_back(static_cast<std::int32_t>(rng.below(10000 + 8 * p + k, num_gaussians)));
        contribution.push_back({p, static_cast<float>(rng.uniform(50000 + 8 * p + k))});
      }
      begin.push_back(static_cast<std::int32_t>(gaussian.size()));
    }
  }
  [[nodiscard]] ContributionView view() const {
    return {width, height, static_cast<int>(gaussian.size()), begin.data(), gaussian.data(), contribution.data()};
  }
  int width, height;
  std::vector<std::int32_t> begin{0}, gaussian;
  std::vector<Contribution> contribution;
};

}  // namespace

TEST_CASE("hits are the contributions, Gaussian by Gaussian, in the order of the image") {
  constexpr int kGaussians = 300, kWidth = 37, kHeight = 41;
  const RandomGrid grid(kWidth, kHeight, kGaussians);
  FeatureHits<Host> hits;
  hits.build(Executor<Host>(2), grid.view(), kGaussians);
  const FeatureHitsView view = hits.view();
  const FeaturePatches patches{kWidth, kHeight};
  std::set<int> seen;
  int last_patch = 0, total = 0;
  for (int n = 0; n < view.num_touched.most; ++n) {
    const TouchedGaussian t = view.touched[n];
    REQUIRE(t.begin < t.end);
    REQUIRE(seen.insert(t.gaussian).second);
    REQUIRE(patches.of(view.hits[t.begin].pixel) >= last_patch);
    last_patch = patches.of(view.hits[t.begin].pixel);
    int at = t.begin;
    for (std::size_t i = 0; i < grid.gaussian.size(); ++i) {
      if (grid.gaussian[i] != t.gaussian) continue;
      REQUIRE(view.hits[at].pixel == grid.contribution[i].pixel);
      REQUIRE(view.hits[at++].weight == grid.contribution[i].weight);
    }
    REQUIRE(at == t.end);
    total += t.end - t.begin;
  }
  CHECK(total == static_cast<int>(grid.gaussian.size()));
}

TEST_CASE_TEMPLATE("a feature step gives the same bits for any number of threads", Optimizer, FeatureAverage<>,
                   FeatureAdam<>, FeatureAdam<Half>) {
  constexpr int D = 100;
  std::vector<double> first;
  for (const int threads : {1, 2, 3}) {
    FeatureProblem<D, Optimizer> problem(3);
    const Executor<Host> executor(threads);
    for (int i = 0; i < 5; ++i) problem.step(executor);
    if (first.empty()) first = problem.features();
    CHECK(problem.features() == first);
  }
}

TEST_CASE_TEMPLATE("a feature step on a checked host misses no barrier in any order of execution", Optimizer,
                   FeatureAverage<>, FeatureAdam<>) {
  constexpr int D = 33;
  std::vector<double> first;
  for (const ExecutionOrder order : {ExecutionOrder::ascending, ExecutionOrder::descending, ExecutionOrder::shuffled}) {
    FeatureProblem<D, Optimizer, CheckedHost> problem(3);
    Executor<CheckedHost> executor(1);
    executor.order = order;
    problem.step(executor);
    if (first.empty()) first = problem.features();
    CHECK(problem.features() == first);
  }
}

TEST_CASE("a feature step allocates and scatters within the rows of the map") {
  // The rows end where the allocation does: sanitizers see an access beyond them.
  FeatureProblem<7, FeatureAverage<>> seven(2);
  FeatureProblem<7, FeatureAdam<Half>> adam(2);
  const Executor<Host> executor(2);
  for (int i = 0; i < 3; ++i) {
    seven.step(executor);
    adam.step(executor);
  }
  for (const double value : seven.features()) CHECK(std::isfinite(value));
  for (const double value : adam.features()) CHECK(std::isfinite(value));
}
