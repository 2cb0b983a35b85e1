// SPDX-License-Identifier: Apache-2.0
#include "langgs/manage/pruning_policy.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

#include "langgs/map/gaussian_map.hpp"

using namespace langgs;

static_assert(require_map_pruning<PruningPolicy>());
static_assert(require_map_pruning<NoPruning>());
static_assert(!MapPruning<int>);

namespace {

using Map = GaussianMap<1>;

/// n opaque, small Gaussians that were seen but never selected, with max weight 0.5.
Map make_map(int n) {
  Map map;
  Gaussian<1> gaussian;
  gaussian.opacity_logit = 1;
  map.append(std::vector<Gaussian<1>>(n, gaussian), 0, 0);
  for (int i = 0; i < n; ++i) {
    map.statistics.num_views.data()[i] = 3;
    map.statistics.max_weight.data()[i] = 0.5f;
  }
  return map;
}

PruningReport run(const PruningPolicy& policy, std::int64_t iteration, const Map& map,
                  std::vector<std::int32_t>& keep) {
  return policy.select(iteration, pruning_statistics(map), keep);
}

int sum(const std::vector<std::int32_t>& keep) { return std::accumulate(keep.begin(), keep.end(), 0); }

}  // namespace

TEST_CASE("pruning is due at multiples of its periods, never at the start") {
  const PruningPolicy policy;
  for (const int i : {200, 400, 500, 1000}) CHECK(policy.due(i));
  for (const int i : {0, 1, 199, 300, 501}) CHECK(!policy.due(i));
  PruningPolicy off;
  off.backbone_period = off.consistency_period = 0;
  for (int i = 0; i < 2000; ++i) CHECK(!off.due(i));
  CHECK(!NoPruning{}.due(500));
}

TEST_CASE("backbone pruning removes transparent, oversized and broken Gaussians only") {
  Map map = make_map(8);
  const PlanesView g = map.geometry();
  g.plane(kOpacityLogit)[1] = std::log(0.0049f / 0.9951f);
  g.plane(kOpacityLogit)[2] = std::log(0.0051f / 0.9949f);
  g.plane(kLogScaleY)[3] = std::log(0.26f);
  g.plane(kLogScaleZ)[4] = std::log(0.24f);
  g.plane(kOpacityLogit)[5] = std::numeric_limits<float>::quiet_NaN();
  g.plane(kLogScaleX)[6] = std::numeric_limits<float>::quiet_NaN();
  std::vector<std::int32_t> keep;
  const PruningReport report = run({}, 200, map, keep);
  CHECK(keep == std::vector<std::int32_t>{1, 0, 1, 0, 1, 0, 0, 1});
  CHECK(report.num_transparent == 2);
  CHECK(report.num_large == 2);
  CHECK(report.num_candidates == 0);
  CHECK(!report.reset_statistics);
}

TEST_CASE("consistency pruning keeps exactly ceil(r n) of the candidates") {
  for (const int n : {0, 1, 2, 7, 100}) {
    for (const double ratio : {0.0, 0.07, 0.5, 0.7, 1.0}) {
      CAPTURE(n);
      CAPTURE(ratio);
      PruningPolicy policy;
      policy.keep_ratio = ratio;
      std::vector<std::int32_t> keep;
      const PruningReport report = run(policy, 500, make_map(n), keep);
      const int expected = static_cast<int>(std::ceil(ratio * n - 1e-9));
      CHECK(sum(keep) == expected);
      CHECK(report.num_candidates == n);
      CHECK(report.num_removed() == n - expected);
      CHECK(report.reset_statistics);
    }
  }
}

TEST_CASE("young, unseen and selected Gaussians are no candidates; those removed already do not count") {
  Map map = make_map(6);
  map.statistics.birth.data()[0] = 501;
  map.statistics.num_views.data()[1] = 0;
  map.statistics.topk_count.data()[2] = 1;
  map.geometry().plane(kOpacityLogit)[3] = -20;
  PruningPolicy policy;
  policy.keep_ratio = 0;
  std::vector<std::int32_t> keep;
  const PruningReport report = run(policy, 1000, map, keep);
  CHECK(keep == std::vector<std::int32_t>{1, 1, 1, 0, 0, 0});
  CHECK(report.num_transparent == 1);
  CHECK(report.num_candidates == 2);
  policy.max_topk_count = 1;
  run(policy, 1000, map, keep);
  CHECK(keep[2] == 0);
}

TEST_CASE("Gaussians without any contribution go first, and fill up only when nothing else is left") {
  Map map = make_map(100);
  for (int i = 0; i < 100; ++i) map.statistics.max_weight.data()[i] = i < 30 ? 0.f : 1e-30f;
  map.statistics.max_weight.data()[3] = std::numeric_limits<float>::quiet_NaN();
  PruningPolicy policy;
  std::vector<std::int32_t> keep;
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    policy.seed = seed;
    run(policy, 500, map, keep);
    REQUIRE(sum(keep) == 50);
    for (int i = 0; i < 30; ++i) REQUIRE(keep[i] == 0);
  }
  policy.keep_ratio = 0.8;
  run(policy, 500, map, keep);
  CHECK(sum(keep) == 80);
  for (int i = 30; i < 100; ++i) CHECK(keep[i] == 1);
}

TEST_CASE("inclusion frequencies are those of successive weighted draws without replacement") {
  // Four Gaussians with weights 1:2:3:4, two survive. P(i survives) = p_i + sum_j p_j p_i / (1 - p_j).
  Map map = make_map(4);
  const double p[] = {0.1, 0.2, 0.3, 0.4};
  for (int i = 0; i < 4; ++i) map.statistics.max_weight.data()[i] = static_cast<float>(p[i]);
  constexpr int kDraws = 20000;
  int kept[4] = {};
  std::vector<std::int32_t> keep;
  PruningPolicy policy;
  for (int d = 0; d < kDraws; ++d) {
    policy.seed = 1000 + d;
    run(policy, 500, map, keep);
    for (int i = 0; i < 4; ++i) kept[i] += keep[i];
  }
  double chi_square = 0;
  for (int i = 0; i < 4; ++i) {
    double expected = p[i];
    for (int j = 0; j < 4; ++j)
      if (j != i) expected += p[j] * p[i] / (1 - p[j]);
    const double deviation = kept[i] - kDraws * expected;
    chi_square += deviation * deviation / (kDraws * expected * (1 - expected));
  }
  CHECK(chi_square < 18.5);  // 4 terms: 99.9 %
}

TEST_CASE("the draw belongs to Gaussians, not to rows, and changes with the iteration") {
  Map map = make_map(200);
  std::vector<std::int32_t> keep, again, later;
  const PruningPolicy policy;
  run(policy, 500, map, keep);
  run(policy, 500, map, again);
  run(policy, 1000, map, later);
  CHECK(keep == again);
  CHECK(keep != later);
  for (int i = 0; i < 100; ++i) std::swap(map.statistics.uid.data()[i], map.statistics.uid.data()[199 - i]);
  run(policy, 500, map, again);
  CHECK(std::vector<std::int32_t>(keep.rbegin(), keep.rend()) == again);
}

TEST_CASE("mistakes in pruning are named") {
  std::vector<std::int32_t> keep;
  PruningStatistics missing;
  missing.size = 3;
  CHECK_THROWS_AS(PruningPolicy{}.select(500, missing, keep), InvalidArgument);
  const Map map = make_map(2);
  PruningPolicy bad;
  bad.keep_ratio = 1.5;
  CHECK_THROWS_AS(run(bad, 500, map, keep), InvalidArgument);
  bad = {};
  bad.backbone_period = -1;
  CHECK_THROWS_AS(run(bad, 500, map, keep), InvalidArgument);
  NoPruning{}.select(500, pruning_statistics(map), keep);
  CHECK(keep == std::vector<std::int32_t>{1, 1});
}
