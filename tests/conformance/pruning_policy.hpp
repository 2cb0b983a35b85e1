// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "langgs/core/rng.hpp"
#include "langgs/manage/pruning_policy.hpp"
#include "langgs/map/gaussian_map.hpp"

/// @file What LangGsSlam relies on in a pruning policy. For a type of your own, in one source file:
///
///   #include "conformance/pruning_policy.hpp"
///   TEST_CASE_TEMPLATE_INVOKE(langgs_pruning_policy_conformance, MyPruning);

namespace langgs::conformance {

/// A map of n Gaussians with statistics of every kind, moments that tell rows apart, and a few values gone bad.
inline GaussianMap<2> worn_map(int n) {
  GaussianMap<2> map;
  const CounterRng rng{77, 0};
  std::vector<Gaussian<2>> gaussians(n);
  for (int i = 0; i < n; ++i) {
    gaussians[i].mean = {static_cast<float>(rng.normal(8 * i)), static_cast<float>(rng.normal(8 * i + 1)), 2};
    gaussians[i].log_scale.setConstant(static_cast<float>(-4 + rng.normal(8 * i + 2)));
    gaussians[i].opacity_logit = static_cast<float>(4 * rng.normal(8 * i + 3));
  }
  map.append(gaussians, 0, 0);
  for (int i = 0; i < n; ++i) {
    map.statistics.topk_count.data()[i] = i % 3 == 0 ? 0 : i;
    map.statistics.max_weight.data()[i] = i % 4 == 0 ? 0.f : static_cast<float>(rng.uniform(8 * i + 4));
    map.statistics.num_views.data()[i] = i % 5;
    map.statistics.birth.data()[i] = 13 * (i % 90);
  }
  return map;
}

}  // namespace langgs::conformance

TEST_CASE_TEMPLATE_DEFINE("pruning policy conformance", Policy, langgs_pruning_policy_conformance) {
  using namespace langgs;
  static_assert(require_map_pruning<Policy>());
  const Policy policy{};
  std::vector<std::int64_t> iterations{0, 1, 7, 199, 1001};
  for (std::int64_t i = 0, found = 0; i < 5000 && found < 4; ++i)
    if (policy.due(i)) {
      iterations.push_back(i);
      ++found;
    }

  SUBCASE("one flag for every Gaussian, whatever the vector held; the report counts what goes") {
    for (const std::int64_t iteration : iterations)
      for (const int n : {0, 1, 2, 257}) {
        CAPTURE(iteration);
        CAPTURE(n);
        GaussianMap<2> map = conformance::worn_map(n);
        std::vector<std::int32_t> keep(1000, -5);
        const PruningReport report = policy.select(iteration, pruning_statistics(map), keep);
        REQUIRE(static_cast<int>(keep.size()) == n);
        int removed = 0;
        for (const std::int32_t k : keep) removed += k == 0;
        CHECK(removed == report.num_removed());
        CHECK(report.num_inconsistent <= report.num_candidates);
        CHECK(map.prune(keep) == removed);
      }
  }
  SUBCASE("the same question gets the same answer") {
    const GaussianMap<2> map = conformance::worn_map(300);
    for (const std::int64_t iteration : iterations) {
      std::vector<std::int32_t> first, second(7, 1);
      policy.select(iteration, pruning_statistics(map), first);
      policy.select(iteration, pruning_statistics(map), second);
      CHECK(first == second);
      CHECK(policy.due(iteration) == policy.due(iteration));
    }
  }
  SUBCASE("values that are not finite do no harm") {
    GaussianMap<2> map = conformance::worn_map(64);
    const float bad[] = {std::nanf(""), std::numeric_limits<float>::infinity(),
                         -std::numeric_limits<float>::infinity()};
    for (int i = 0; i < 64; ++i) {
      map.geometry().plane(i % kNumPlanes)[i] = bad[i % 3];
      map.statistics.max_weight.data()[i] = bad[i / 3 % 3];
    }
    for (const std::int64_t iteration : iterations) {
      std::vector<std::int32_t> keep;
      policy.select(iteration, pruning_statistics(map), keep);
      CHECK(keep.size() == 64);
    }
  }
}
