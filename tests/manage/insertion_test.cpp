// SPDX-License-Identifier: Apache-2.0
#include "langgs/manage/insertion.hpp"

#include <doctest/doctest.h>

#include <limits>
#include <vector>

using namespace langgs;

static_assert(require_insertion_policy<RedundancyFilter>());
static_assert(require_insertion_policy<InsertAll>());
static_assert(!InsertionPolicy<int>);

namespace {

constexpr float kUnknown = std::numeric_limits<float>::infinity();
using Points = std::vector<Eigen::Vector3f>;
using Chosen = std::vector<std::int32_t>;

Points grid(int n, float spacing) {
  Points points;
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j)
      points.emplace_back(static_cast<float>(i) * spacing - 1, static_cast<float>(j) * spacing, 2.f);
  return points;
}

}  // namespace

TEST_CASE("insertion: points near a target Gaussian are suppressed by the reused distance") {
  RedundancyFilter filter;
  const Points points = {{0, 0, 1}, {1, 0, 1}, {2, 0, 1}, {3, 0, 1}, {4, 0, 1}};
  Chosen chosen{77};  // appended to, not overwritten
  const InsertionReport report =
      filter.select({points, {1.9e-4f, 2.1e-4f, kUnknown, 0.f, std::numeric_limits<float>::quiet_NaN()}}, chosen);
  CHECK(chosen == Chosen{77, 1, 2, 4});
  CHECK(report.num_inserted == 3);
  CHECK(report.num_near == 2);
}

TEST_CASE("insertion: what was inserted is not inserted again, not even without distances") {
  RedundancyFilter filter;
  const Points points = grid(40, 0.03f);
  Chosen chosen;
  CHECK(filter.select({points, {}}, chosen).num_inserted == 1600);
  chosen.clear();
  const InsertionReport again = filter.select({points, std::vector<float>(points.size(), kUnknown)}, chosen);
  CHECK(again.num_inserted == 0);
  CHECK(again.num_occupied == 1600);
  CHECK(chosen.empty());
}

TEST_CASE("insertion: points of one call do not suppress each other") {
  RedundancyFilter filter;
  const Points dense = grid(20, 0.002f);
  Chosen chosen;
  CHECK(filter.select({dense, {}}, chosen).num_inserted == 400);
  CHECK(filter.num_cells() < 20);
}

TEST_CASE("insertion: a rebuild from the map frees the cells of pruned Gaussians") {
  RedundancyFilter filter;
  const Points points = grid(10, 0.05f);
  Chosen chosen;
  filter.select({points, {}}, chosen);
  filter.rebuild(50, [&](int i) { return points[i]; });
  chosen.clear();
  CHECK(filter.select({points, {}}, chosen).num_inserted == 50);
  CHECK(chosen.front() == 50);
}

TEST_CASE("insertion: cells and filter can be switched off") {
  const Points points = grid(10, 0.05f);
  Chosen chosen;
  RedundancyFilter no_cells({.use_cells = false});
  no_cells.select({points, {}}, chosen);
  CHECK(no_cells.select({points, {}}, chosen).num_inserted == 100);
  CHECK(no_cells.num_cells() == 0);
  RedundancyFilter off({.squared_distance = 0});
  off.select({points, std::vector<float>(100, 0.f)}, chosen);
  CHECK(off.select({points, std::vector<float>(100, 0.f)}, chosen).num_inserted == 100);
  CHECK(InsertAll{}.select({points, std::vector<float>(100, 0.f)}, chosen).num_inserted == 100);
}

TEST_CASE("insertion: hostile points are dropped, mistakes are named") {
  const float inf = std::numeric_limits<float>::infinity(), nan = std::numeric_limits<float>::quiet_NaN();
  const Points points = {{nan, 0, 0}, {0, inf, 0}, {0, 0, -inf}, {1e30f, 0, 0}, {0, 0, 0}, {-0.001f, 0, 0}};
  RedundancyFilter filter;
  Chosen chosen;
  const InsertionReport report = filter.select({points, {}}, chosen);
  CHECK(chosen == Chosen{4, 5});
  CHECK(report.num_invalid == 4);
  CHECK(filter.num_cells() == 2);  // either side of zero: no cell of double width there
  CHECK(InsertAll{}.select({points, {}}, chosen).num_invalid == 3);
  CHECK_THROWS_AS(filter.select({points, {1.f}}, chosen), InvalidArgument);
  CHECK_THROWS_AS(RedundancyFilter({.squared_distance = -1}), InvalidArgument);
  CHECK_THROWS_AS(RedundancyFilter({.squared_distance = nan}), InvalidArgument);
  CHECK(filter.select({Points{}, {}}, chosen).num_inserted == 0);
}
