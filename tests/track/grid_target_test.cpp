// SPDX-License-Identifier: Apache-2.0
#include "langgs/track/grid_target.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "langgs/track/kd_tree_target.hpp"
#include "track/box_room.hpp"

/// @file The grid against brute force and a k-d tree, and what a renewed grid shares with the former one.

using namespace langgs;
using test::isotropic_gaussians;

namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

/// Squared distances of the nearest five [m^2], ascending: one more than a target names.
using FewNearest = std::array<double, 2 + TargetMatch::kRunnersUp>;

FewNearest brute_force(const std::vector<Eigen::Vector3f>& means, const Eigen::Vector3f& query) {
  FewNearest found;
  found.fill(std::numeric_limits<double>::infinity());
  for (const Eigen::Vector3f& mean : means) {
    double d = (mean - query).cast<double>().squaredNorm();  // float difference: the coordinates are given
    for (double& f : found)
      if (d < f) std::swap(d, f);
  }
  return found;
}

/// Rounding of a sum of three squares in single precision, some of which may underflow.
bool same(double a, double b) { return std::abs(a - b) <= 4e-7 * std::max(a, b) + 1e-37; }

/// Everything that an answer promises. `expected` as found without a radius.
void check_answer(const TargetMatch& match, const FewNearest& expected, const Eigen::Vector3f& query, float radius) {
  const double first = std::sqrt(expected[0]);
  // Whether a cell lies within reach is decided with coordinates that are rounded, to about 1e-7 m in a room.
  const double slack = 2e-7 * (static_cast<double>(query.cwiseAbs().maxCoeff()) + radius);
  REQUIRE(match.rest_beyond <= radius);
  if (match.gaussian == nullptr) {
    REQUIRE(first >= radius - slack);
    for (const TargetGaussian* g : match.runners_up) REQUIRE(g == nullptr);
    return;
  }
  const double found = std::sqrt(static_cast<double>(match.squared_distance));
  REQUIRE(same((match.gaussian->mean - query).cast<double>().squaredNorm(), match.squared_distance));
  REQUIRE(std::abs(found - first) <= slack);
  REQUIRE(found <= radius + slack);
  // The nearest itself must be known to be it.
  REQUIRE(match.rest_beyond >= std::min<double>(radius, first) - slack);

  // Those named are different ones and ascend; who is not named is not nearer than the rest is said to be.
  std::vector<double> unnamed(expected.begin(), expected.end());
  std::vector<const TargetGaussian*> named{match.gaussian};
  for (const TargetGaussian* g : match.runners_up)
    if (g != nullptr) named.push_back(g);
  double last = 0;
  for (const TargetGaussian* g : named) {
    REQUIRE(std::count(named.begin(), named.end(), g) == 1);
    const double d = (g->mean - query).cast<double>().squaredNorm();
    REQUIRE(d >= last * (1 - 4e-7));
    last = d;
    const auto at = std::find_if(unnamed.begin(), unnamed.end(), [&](double e) { return same(d, e); });
    if (at != unnamed.end()) unnamed.erase(at);
  }
  REQUIRE(match.rest_beyond <= std::sqrt(unnamed.front()) + slack);
}

Eigen::Vector3f uniform(const CounterRng& rng, int i, float half) {
  return half *
         Eigen::Vector3d(2 * rng.uniform(3 * i) - 1, 2 * rng.uniform(3 * i + 1) - 1, 2 * rng.uniform(3 * i + 2) - 1)
             .cast<float>();
}

std::vector<Eigen::Vector3f> uniform_points(int n, float half, std::uint64_t seed) {
  std::vector<Eigen::Vector3f> points;
  for (int i = 0; i < n; ++i) points.push_back(uniform({seed}, i, half));
  return points;
}

/// Half of the queries anywhere, half near some point.
Eigen::Vector3f any_query(const std::vector<Eigen::Vector3f>& points, const CounterRng& rng, int i) {
  if (i % 2 == 0 || points.empty()) return uniform(rng, i, 1.2f);
  const auto near = static_cast<float>(std::pow(10.0, -5 + 5 * rng.uniform(7000000 + i)));  // 10 um to 1 m
  return points[rng.below(8000000 + i, static_cast<std::uint32_t>(points.size()))] + uniform(rng, i, near);
}

constexpr float kRadii[] = {0.01f, 0.032f, 0.064f, 0.1f, 0.3f, 0.5f};

void compare_with_brute_force(const std::vector<Eigen::Vector3f>& points, int num_queries, std::uint64_t seed) {
  const GridTarget target(isotropic_gaussians(points));
  REQUIRE(target.size() == static_cast<int>(points.size()));
  for (int i = 0; i < num_queries; ++i) {
    const Eigen::Vector3f query = any_query(points, {seed, 1}, i);
    const FewNearest expected = brute_force(points, query);
    for (const float radius : kRadii) check_answer(target.nearest(query, radius), expected, query, radius);
  }
}

/// Both targets give the same Gaussians for the same questions.
void check_equal(const GridTarget& a, const GridTarget& b, const std::vector<Eigen::Vector3f>& points) {
  REQUIRE(a.size() == b.size());
  REQUIRE(a.num_blocks() == b.num_blocks());
  for (int i = 0; i < 2000; ++i) {
    const Eigen::Vector3f query = any_query(points, {31, 1}, i);
    const TargetMatch x = a.nearest(query, 0.3f), y = b.nearest(query, 0.3f);
    REQUIRE((x.gaussian == nullptr) == (y.gaussian == nullptr));
    REQUIRE(x.squared_distance == y.squared_distance);
    REQUIRE(x.rest_beyond == y.rest_beyond);
    if (x.gaussian != nullptr) REQUIRE(x.gaussian->mean == y.gaussian->mean);
  }
}

}  // namespace

TEST_CASE("nearest is exact at any density") {
  for (const int n : {1, 2, 3, 17, 300, 3000}) compare_with_brute_force(uniform_points(n, 1, n), 1500, n);
}

TEST_CASE("nearest is exact in clusters, and on surfaces") {
  std::vector<Eigen::Vector3f> clusters;
  const std::vector<Eigen::Vector3f> centres = uniform_points(12, 1, 5);
  for (int i = 0; i < 3000; ++i) clusters.push_back(centres[i % 12] + uniform({6}, i, i % 3 ? 0.01f : 0.1f));
  compare_with_brute_force(clusters, 1500, 7);
  compare_with_brute_force(test::sample_box_room(4000, 3), 1500, 8);
}

TEST_CASE("nearest is exact at the borders of cells and blocks") {
  // Every coordinate within a few roundings of a multiple of the cell.
  const auto at_border = [](const CounterRng& rng, int i) {
    Eigen::Vector3f p;
    for (int a = 0; a < 3; ++a) {
      const float border = GridTarget::kCell * static_cast<float>(static_cast<int>(rng.below(6 * i + a, 17)) - 8);
      const float side[] = {border, std::nextafter(border, -1.f), std::nextafter(border, 1.f), border + 1e-5f, -border};
      p[a] = side[rng.below(6 * i + 3 + a, 5)];
    }
    return p;
  };
  std::vector<Eigen::Vector3f> points;
  for (int i = 0; i < 400; ++i) points.push_back(at_border({1}, i));
  const GridTarget target(isotropic_gaussians(points));
  for (int i = 0; i < 4000; ++i) {
    const Eigen::Vector3f query = at_border({2}, i);
    const FewNearest expected = brute_force(points, query);
    for (const float radius : kRadii) check_answer(target.nearest(query, radius), expected, query, radius);
  }
}

TEST_CASE("duplicates are at distance zero from each other") {
  std::vector<Eigen::Vector3f> points = uniform_points(500, 1, 9);
  points.insert(points.end(), points.begin(), points.end());
  const GridTarget target(isotropic_gaussians(points));
  for (const Eigen::Vector3f& point : points) {
    const TargetMatch match = target.nearest(point, 0.1f);
    REQUIRE(match.gaussian != nullptr);
    REQUIRE(match.squared_distance == 0);
    REQUIRE(match.runners_up[0] != nullptr);
    REQUIRE(match.runners_up[0]->mean == point);
  }
  compare_with_brute_force(points, 500, 10);
}

TEST_CASE("nearest is exact a kilometre away from the origin") {
  // There a float is good to 0.06 mm, and cells are numbered by tens of thousands.
  std::vector<Eigen::Vector3f> points = uniform_points(3000, 1, 11);
  for (Eigen::Vector3f& point : points) point += Eigen::Vector3f(1000, -1000, 1000);
  const GridTarget target(isotropic_gaussians(points));
  for (int i = 0; i < 3000; ++i) {
    const Eigen::Vector3f query = any_query(points, {12}, 2 * i + 1);
    const FewNearest expected = brute_force(points, query);
    for (const float radius : kRadii) check_answer(target.nearest(query, radius), expected, query, radius);
  }
}

TEST_CASE("a large grid agrees with a k-d tree") {
  const std::vector<Eigen::Vector3f> points = test::sample_box_room(200000, 21);
  const GridTarget grid(isotropic_gaussians(points));
  const KdTreeTarget tree(isotropic_gaussians(points));
  for (int i = 0; i < 20000; ++i) {
    const Eigen::Vector3f query = any_query(points, {22}, i);
    for (const float radius : {0.01f, 0.1f, 0.5f}) {
      const TargetMatch a = grid.nearest(query, radius), b = tree.nearest(query, radius);
      REQUIRE((a.gaussian == nullptr) == (b.gaussian == nullptr));
      REQUIRE(same(a.squared_distance, b.squared_distance));
      // The tree knows the fifth nearest, the grid may have stopped before it.
      REQUIRE(a.rest_beyond <= b.rest_beyond * (1 + 4e-7f));
    }
  }
}

TEST_CASE("queries that are nowhere have no answer") {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const GridTarget target(isotropic_gaussians(uniform_points(1000, 1, 3)));
  for (const float bad : {nan, kInfinity, -kInfinity, 1e5f * 1.01f, 3e38f, -3e38f})
    for (int axis = 0; axis < 3; ++axis) {
      Eigen::Vector3f query(0, 0, 0);
      query[axis] = bad;
      CHECK(target.nearest(query, 0.5f).gaussian == nullptr);
      CHECK(GridTarget().nearest(query, 0.5f).gaussian == nullptr);
    }
  CHECK(target.nearest({1e5f, -1e5f, 1e5f}, 0.5f).gaussian == nullptr);
  CHECK(GridTarget().nearest({0, 0, 0}, 0.5f).rest_beyond == 0.5f);
}

TEST_CASE("a renewed target equals one made anew, whatever came, went and moved") {
  const CounterRng rng{41};
  std::vector<Eigen::Vector3f> points;
  GridTarget target;
  for (int round = 0; round < 40; ++round) {
    const auto pick = [&](int k) { return rng.below(1000 * round + k, static_cast<std::uint32_t>(points.size())); };
    switch (round % 4) {
      case 0:  // come
        for (int i = 0; i < 500; ++i) points.push_back(uniform(rng, 100000 * round + i, 1));
        break;
      case 1:  // go: some anywhere
        for (int i = 0; i < 60; ++i) points.erase(points.begin() + pick(i));
        break;
      case 2:  // move
        for (int i = 0; i < 30; ++i) points[pick(i)] += uniform(rng, 100000 * round + i, 0.1f);
        break;
      default:  // one comes where one goes: the block keeps its number of Gaussians
        for (int i = 0; i < 30; ++i) points[pick(i)] = points[pick(i + 500)];
    }
    target = target.renewed(isotropic_gaussians(points));
    const GridTarget anew(isotropic_gaussians(points));
    check_equal(target, anew, points);
    if (round % 8 == 0) {
      for (int i = 0; i < 300; ++i) {
        const Eigen::Vector3f query = any_query(points, {42}, i);
        check_answer(target.nearest(query, 0.3f), brute_force(points, query), query, 0.3f);
      }
    }
  }
  target = target.renewed({});
  CHECK(target.size() == 0);
  CHECK(target.nearest({0, 0, 0}, 1).gaussian == nullptr);
  target = target.renewed(isotropic_gaussians(points));
  check_equal(target, GridTarget(isotropic_gaussians(points)), points);
}

TEST_CASE("what has not changed is shared") {
  std::vector<Eigen::Vector3f> points = test::sample_box_room(20000, 50);
  const GridTarget target(isotropic_gaussians(points));
  CHECK(target.num_shared_with(target) == target.num_blocks());
  CHECK(target.num_shared_with(GridTarget(isotropic_gaussians(points))) == 0);
  CHECK(target.renewed(isotropic_gaussians(points)).num_shared_with(target) == target.num_blocks());

  // One comes: its block alone is new.
  const Eigen::Vector3f inside = points[0];
  points.push_back(inside);
  GridTarget renewed = target.renewed(isotropic_gaussians(points));
  CHECK(renewed.num_blocks() == target.num_blocks());
  CHECK(renewed.num_shared_with(target) == target.num_blocks() - 1);
  points.back() = {50, 50, 50};  // where there was no block
  renewed = target.renewed(isotropic_gaussians(points));
  CHECK(renewed.num_blocks() == target.num_blocks() + 1);
  CHECK(renewed.num_shared_with(target) == target.num_blocks());
  // It goes again.
  points.pop_back();
  CHECK(renewed.renewed(isotropic_gaussians(points)).num_shared_with(target) == target.num_blocks());
  // One in the middle of the list goes.
  points.erase(points.begin() + 10000);
  CHECK(target.renewed(isotropic_gaussians(points)).num_shared_with(target) == target.num_blocks() - 1);
}

TEST_CASE("small movements are within the tolerance or not") {
  std::vector<Eigen::Vector3f> points = {{0.03f, 0.03f, 0.03f}, {1.03f, 0.03f, 0.03f}};
  const GridTarget target(isotropic_gaussians(points));
  points[0].x() += 1e-3f;
  CHECK(target.renewed(isotropic_gaussians(points), 0.9e-3f).num_shared_with(target) == 1);
  const GridTarget tolerant = target.renewed(isotropic_gaussians(points), 1.1e-3f);
  CHECK(tolerant.num_shared_with(target) == 2);
  REQUIRE(tolerant.nearest(points[0], 0.1f).gaussian != nullptr);
  CHECK(tolerant.nearest(points[0], 0.1f).gaussian->mean == Eigen::Vector3f(0.03f, 0.03f, 0.03f));
  points[0] = {0.065f, 0.03f, 0.03f};  // another cell
  CHECK(target.renewed(isotropic_gaussians(points), 0.1f).num_shared_with(target) == 1);
}
