// SPDX-License-Identifier: Apache-2.0
#include "langgs/eval/association.hpp"

#include <doctest/doctest.h>

#include <cstdint>
#include <limits>

using namespace langgs;

TEST_CASE("associate: nearest in time, gap inclusive, lists unsorted, reuse allowed") {
  const std::vector<double> a = {5.0, 1.0, 2.75, 9.0}, b = {3.0, 1.25, 5.5, 4.5};
  // 5.0 is as far from 4.5 as from 5.5: the earlier wins.
  CHECK(associate(a, b, 0.5) == std::vector<StampPair>{{0, 3}, {1, 1}, {2, 0}});
  CHECK(associate(a, b, 0.25) == std::vector<StampPair>{{1, 1}, {2, 0}});
  CHECK(associate(a, b, 0.0).empty());
  CHECK(associate(a, a, 0.0).size() == a.size());
  const std::vector<double> one = {2.0};
  CHECK(associate(a, one, 10) == std::vector<StampPair>{{0, 0}, {1, 0}, {2, 0}, {3, 0}});
  CHECK(associate({}, b, 1).empty());
  CHECK(associate(a, {}, 1).empty());
}

TEST_CASE("associate: of equal stamps the one listed first") {
  const std::vector<double> a = {0.9, 1.0, 1.1}, b = {2.0, 1.0, 1.0, 1.0, -3.0};
  CHECK(associate(a, b, 0.2) == std::vector<StampPair>{{0, 1}, {1, 1}, {2, 1}});
}

TEST_CASE("associate: bad arguments") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<double> a = {1.0}, bad = {nan};
  CHECK_THROWS_AS((void)associate(a, a, -1), InvalidArgument);
  CHECK_THROWS_AS((void)associate(a, a, nan), InvalidArgument);
  CHECK_THROWS_AS((void)associate(a, bad, 1), InvalidArgument);
  CHECK_THROWS_AS((void)associate(bad, a, 1), InvalidArgument);
}

TEST_CASE("associate: agrees with exhaustive search") {
  std::uint64_t state = 88172645463325252u;
  const auto random = [&] {
    state ^= state << 13;
    state ^= state >> 7;
    state ^= state << 17;
    return static_cast<double>(state % 200) * 0.25;  // many ties
  };
  for (int round = 0; round < 200; ++round) {
    std::vector<double> a(20), b(15);
    for (double& v : a) v = random();
    for (double& v : b) v = random();
    std::vector<StampPair> expected;
    for (std::size_t i = 0; i < a.size(); ++i) {
      std::size_t best = 0;
      for (std::size_t j = 1; j < b.size(); ++j) {
        const double d = std::abs(b[j] - a[i]), e = std::abs(b[best] - a[i]);
        if (d < e || (d == e && b[j] < b[best])) best = j;
      }
      if (std::abs(b[best] - a[i]) <= 1.0) expected.push_back({i, best});
    }
    REQUIRE(associate(a, b, 1.0) == expected);
  }
}
