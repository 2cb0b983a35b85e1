// SPDX-License-Identifier: Apache-2.0
#include "langgs/map/gaussian_map.hpp"

#include <doctest/doctest.h>

#include <limits>
#include <numeric>
#include <string>
#include <type_traits>
#include <vector>

#include "langgs/core/rng.hpp"

using namespace langgs;

namespace {

constexpr int kDim = 5;

/// What a feature optimiser might keep: rows of two widths.
struct TwoArrays {
  using Scalar = float;
  template <int FeatDim, class Backend>
  struct State {
    Rows<float, Backend> wide{FeatDim}, narrow;
    template <class F>
    void for_each_array(F&& f) {
      f(wide);
      f(narrow);
    }
  };
};
using Map = GaussianMap<kDim, Host, TwoArrays>;

/// What array `array` holds at entry `entry` of the Gaussian `uid`: known from the uid alone.
float stamp(std::uint32_t uid, int array, int entry) {
  return static_cast<float>(CounterRng{uid, static_cast<std::uint64_t>(array)}.uniform(entry));
}

Gaussian<kDim> stamped_gaussian(std::uint32_t uid) {
  Gaussian<kDim> g;
  for (int a = 0; a < 3; ++a) g.mean[a] = stamp(uid, 0, kMeanX + a);
  for (int a = 0; a < 3; ++a) g.log_scale[a] = stamp(uid, 0, kLogScaleX + a);
  for (int a = 0; a < 4; ++a) g.rotation[a] = stamp(uid, 0, kRotationW + a);
  g.opacity_logit = stamp(uid, 0, kOpacityLogit);
  for (int a = 0; a < 3; ++a) g.colour[a] = stamp(uid, 0, kRed + a);
  for (int d = 0; d < kDim; ++d) g.feature[d] = stamp(uid, 1, d);
  return g;
}

int stamped_count(std::uint32_t uid, int array) { return static_cast<int>(1000 * stamp(uid, array, 0)); }

/// Appends stamped Gaussians; moments and statistics of the new rows must be zero and get their stamps.
void append_stamped(Map& map, std::uint32_t& next_uid, int count) {
  const int first = map.size();
  std::vector<Gaussian<kDim>> fresh;
  for (int i = 0; i < count; ++i) fresh.push_back(stamped_gaussian(next_uid + i));
  map.append(fresh, static_cast<int>(next_uid), -static_cast<int>(next_uid));
  REQUIRE(map.size() == first + count);
  for (int i = first; i < map.size(); ++i) {
    const std::uint32_t uid = next_uid++;
    REQUIRE(map.statistics.uid.data()[i] == uid);
    REQUIRE(map.statistics.topk_count.data()[i] == 0);
    REQUIRE(map.statistics.max_weight.data()[i] == 0.f);
    REQUIRE(map.statistics.num_views.data()[i] == 0);
    int array = 2;
    for (Planes<Host>* moment : {&map.first_moment, &map.second_moment}) {
      for (int p = 0; p < kNumPlanes; ++p) {
        REQUIRE(moment->view().plane(p)[i] == 0.f);
        moment->view().plane(p)[i] = stamp(uid, array, p);
      }
      array += 2;
    }
    for (int d = 0; d < kDim; ++d) {
      REQUIRE(map.feature_state.wide.row(i)[d] == 0.f);
      map.feature_state.wide.row(i)[d] = stamp(uid, 3, d);
    }
    REQUIRE(map.feature_state.narrow.data()[i] == 0.f);
    map.feature_state.narrow.data()[i] = stamp(uid, 5, 0);
    map.statistics.topk_count.data()[i] = stamped_count(uid, 6);
    map.statistics.max_weight.data()[i] = stamp(uid, 7, 0);
    map.statistics.num_views.data()[i] = stamped_count(uid, 8);
  }
}

/// Number of entries that are not the stamp of their row's uid.
int count_mismatches(Map& map) {
  int wrong = 0;
  const auto expect = [&](auto value, auto expected) { wrong += value == expected ? 0 : 1; };
  for (int i = 0; i < map.size(); ++i) {
    const std::uint32_t uid = map.statistics.uid.data()[i];
    for (int p = 0; p < kNumPlanes; ++p) {
      expect(map.geometry().plane(p)[i], stamp(uid, 0, p));
      expect(map.first_moment.view().plane(p)[i], stamp(uid, 2, p));
      expect(map.second_moment.view().plane(p)[i], stamp(uid, 4, p));
    }
    for (int d = 0; d < kDim; ++d) {
      expect(map.features().row(i)[d], stamp(uid, 1, d));
      expect(map.feature_state.wide.row(i)[d], stamp(uid, 3, d));
    }
    expect(map.feature_state.narrow.data()[i], stamp(uid, 5, 0));
    expect(map.statistics.topk_count.data()[i], stamped_count(uid, 6));
    expect(map.statistics.max_weight.data()[i], stamp(uid, 7, 0));
    expect(map.statistics.num_views.data()[i], stamped_count(uid, 8));
    expect(map.statistics.birth.data()[i], -map.statistics.keyframe.data()[i]);
  }
  return wrong;
}

}  // namespace

static_assert(!std::is_copy_constructible_v<Map> && std::is_move_constructible_v<Map>);

TEST_CASE("appending and pruning conserve every array of every Gaussian") {
  Map map;
  std::uint32_t next_uid = 0;
  std::vector<std::uint32_t> expected;
  for (int round = 0; round < 30; ++round) {
    const CounterRng rng{7, static_cast<std::uint64_t>(round)};
    const std::uint32_t first = next_uid;
    append_stamped(map, next_uid, static_cast<int>(rng.below(0, 90)));
    for (std::uint32_t uid = first; uid < next_uid; ++uid) expected.push_back(uid);
    REQUIRE(count_mismatches(map) == 0);

    std::vector<std::int32_t> keep;
    std::vector<std::uint32_t> survivors;
    const double share = round % 7 == 0 ? 0.0 : (round % 5 == 0 ? 1.0 : 0.6);
    for (int i = 0; i < map.size(); ++i) {
      keep.push_back(rng.uniform(100 + i) < share ? 1 + i : 0);
      if (keep[i] != 0) survivors.push_back(expected[i]);
    }
    CHECK(map.prune(keep) == static_cast<int>(expected.size() - survivors.size()));
    expected = survivors;
    REQUIRE(map.size() == static_cast<int>(expected.size()));
    for (int i = 0; i < map.size(); ++i) REQUIRE(map.statistics.uid.data()[i] == expected[i]);
    REQUIRE(count_mismatches(map) == 0);
  }
  CHECK(expected.size() > 20);
}

TEST_CASE("a map grows across its capacities, Gaussian by Gaussian and at once") {
  Map map;
  std::uint32_t next_uid = 0;
  for (int i = 0; i < 200; ++i) append_stamped(map, next_uid, 1);
  append_stamped(map, next_uid, 0);
  append_stamped(map, next_uid, 3000);
  CHECK(count_mismatches(map) == 0);
  // Planes may be read in whole vectors of 32.
  CHECK(map.geometry().stride % 32 == 0);
  CHECK(map.geometry().stride >= map.size());
}

TEST_CASE("values come back as they went in, and set leaves the neighbours alone") {
  Map map;
  std::uint32_t next_uid = 0;
  append_stamped(map, next_uid, 3);
  const auto equal = [](const Gaussian<kDim>& a, const Gaussian<kDim>& b) {
    return a.mean == b.mean && a.log_scale == b.log_scale && a.rotation == b.rotation &&
           a.opacity_logit == b.opacity_logit && a.colour == b.colour && a.feature == b.feature;
  };
  for (std::uint32_t i = 0; i < 3; ++i) CHECK(equal(map[static_cast<int>(i)], stamped_gaussian(i)));
  map.set(1, stamped_gaussian(42));
  CHECK(equal(map[0], stamped_gaussian(0)));
  CHECK(equal(map[1], stamped_gaussian(42)));
  CHECK(equal(map[2], stamped_gaussian(2)));
  CHECK(map.statistics.uid.data()[1] == 1);
  CHECK(map.first_moment.view().plane(kMeanX)[1] == stamp(1, 2, kMeanX));
}

TEST_CASE("a Gaussian that is not finite is refused and leaves the map as it was") {
  for (const float bad : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(),
                          -std::numeric_limits<float>::infinity()})
    for (int place = 0; place < 6; ++place) {
      Map map;
      std::uint32_t next_uid = 0;
      append_stamped(map, next_uid, 2);
      Gaussian<kDim> g = stamped_gaussian(9);
      if (place == 0) g.mean.y() = bad;
      if (place == 1) g.log_scale.z() = bad;
      if (place == 2) g.rotation.w() = bad;
      if (place == 3) g.opacity_logit = bad;
      if (place == 4) g.colour.x() = bad;
      if (place == 5) g.feature[kDim - 1] = bad;
      CHECK_THROWS_AS(map.append({stamped_gaussian(8), g}, 0, 0), InvalidArgument);
      CHECK(map.size() == 2);
      CHECK(count_mismatches(map) == 0);
      append_stamped(map, next_uid, 1);  // uids go on without a gap
    }
}

TEST_CASE("pruning asks for one flag a Gaussian") {
  Map map;
  CHECK(map.prune({}) == 0);
  std::uint32_t next_uid = 0;
  append_stamped(map, next_uid, 3);
  CHECK_THROWS_AS(map.prune({1, 1}), InvalidArgument);
  CHECK_THROWS_AS(map.prune({1, 1, 1, 1}), InvalidArgument);
  CHECK(map.prune({0, 0, 0}) == 3);
  CHECK(map.size() == 0);
  append_stamped(map, next_uid, 2);  // uids are never reused
  CHECK(map.statistics.uid.data()[0] == 3);
  CHECK(count_mismatches(map) == 0);
}

TEST_CASE("bytes are counted part by part") {
  Map map;
  for (const auto& [part, bytes] : map.memory_report()) CHECK(bytes == 0);
  std::uint32_t next_uid = 0;
  append_stamped(map, next_uid, 1000);
  const auto parts = map.memory_report();
  const auto bytes_of = [&](const std::string& name) {
    for (const auto& part : parts)
      if (part.first == name) return part.second;
    FAIL("no part ", name);
    return std::size_t{0};
  };
  // At least what is stored, at most an eighth more and a few rows.
  const auto check = [&](const std::string& name, std::size_t per_gaussian) {
    INFO(name);
    CHECK(bytes_of(name) >= 1000 * per_gaussian);
    CHECK(bytes_of(name) <= 1160 * per_gaussian);
  };
  check("geometry", 14 * 4);
  check("features", kDim * 4);
  check("geometry_moments", 2 * 14 * 4);
  check("feature_optimizer", (kDim + 1) * 4);
  check("statistics", 6 * 4);
}

TEST_CASE("features are stored in half precision unless asked otherwise") {
  GaussianMap<kDim> halves;
  GaussianMap<kDim, Host, PlainFeatures<float>> floats;
  static_assert(std::is_same_v<decltype(halves)::Scalar, Half> && std::is_same_v<decltype(floats)::Scalar, float>);
  const Gaussian<kDim> g = stamped_gaussian(4);
  halves.append({g}, 0, 0);
  floats.append({g}, 0, 0);
  for (int d = 0; d < kDim; ++d) {
    CHECK(floats[0].feature[d] == g.feature[d]);
    CHECK(halves[0].feature[d] == static_cast<float>(Half(g.feature[d])));
  }
}

TEST_CASE("a map that grows keyframe by keyframe holds little more than it stores") {
  // 512 dimensions, moment-free: 14 parameters and their moments, 6 statistics, 512 halves.
  constexpr std::size_t kStored = 3 * 14 * 4 + 6 * 4 + 512 * 2;
  GaussianMap<512> map;
  std::size_t most = 0;
  for (int n = 0; n < 40; ++n) {
    map.append(std::vector<Gaussian<512>>(100 + 13 * static_cast<std::size_t>(n % 7)), 0, 0);
    std::size_t bytes = 0;
    for (const auto& part : map.memory_report()) bytes += part.second;
    if (n > 4) most = std::max(most, bytes / static_cast<std::size_t>(map.size()));
  }
  CHECK(most <= kStored * 9 / 8 + 8);
}
