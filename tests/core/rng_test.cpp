// SPDX-License-Identifier: Apache-2.0
#include "langgs/core/rng.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <set>
#include <vector>

namespace {

using langgs::CounterRng;

constexpr std::uint64_t kSamples = 200000;

}  // namespace

TEST_CASE("mix64 is SplitMix64") {
  // First outputs of the published generator for the seeds 0 and 1234567.
  CHECK(langgs::mix64(0) == 0xE220A8397B1DCDAFull);
  CHECK(langgs::mix64(0x9E3779B97F4A7C15ull) == 0x6E789E6AA1B965F4ull);
  CHECK(langgs::mix64(1234567) == 6457827717110365317ull);
}

TEST_CASE("values depend on seed, stream and counter alone") {
  static_assert(CounterRng{1, 2}.bits(3) == CounterRng{1, 2}.bits(3));
  std::set<std::uint64_t> seen;
  for (std::uint64_t seed = 0; seed < 20; ++seed)
    for (std::uint64_t stream = 0; stream < 20; ++stream)
      for (std::uint64_t counter = 0; counter < 50; ++counter) seen.insert(CounterRng{seed, stream}.bits(counter));
  CHECK(seen.size() == 20 * 20 * 50);
}

TEST_CASE("flipping any bit of the seed, stream or counter flips about half of the output") {
  for (int bit = 0; bit < 64; ++bit) {
    const std::uint64_t flip = std::uint64_t{1} << bit;
    int flipped[3] = {};
    for (std::uint64_t i = 0; i < 500; ++i) {
      const std::uint64_t base = CounterRng{i, 7}.bits(11);
      flipped[0] += std::popcount(base ^ CounterRng{i ^ flip, 7}.bits(11));
      flipped[1] += std::popcount(base ^ CounterRng{i, 7 ^ flip}.bits(11));
      flipped[2] += std::popcount(base ^ CounterRng{i, 7}.bits(11 ^ flip));
    }
    for (const int count : flipped) CHECK(count / 500.0 == doctest::Approx(32).epsilon(0.05));
  }
}

TEST_CASE("uniform has the moments and the histogram of a uniform variable, and stays inside (0, 1)") {
  const CounterRng rng{42, 1};
  double sum = 0, sum2 = 0, lagged = 0, previous = 0.5, low = 1, high = 0;
  std::array<int, 100> histogram{};
  for (std::uint64_t i = 0; i < kSamples; ++i) {
    const double u = rng.uniform(i);
    low = std::min(low, u);
    high = std::max(high, u);
    sum += u;
    sum2 += u * u;
    lagged += (u - 0.5) * (previous - 0.5);
    previous = u;
    ++histogram[static_cast<std::size_t>(u * 100)];
  }
  CHECK(low > 0);
  CHECK(high < 1);
  const double n = kSamples, sigma = 1 / std::sqrt(12 * n);
  CHECK(std::abs(sum / n - 0.5) < 4 * sigma);
  CHECK(std::abs(sum2 / n - 1.0 / 3) < 4 * std::sqrt(4.0 / 45 / n));
  CHECK(std::abs(lagged / n) < 4.0 / 12 / std::sqrt(n));
  double chi2 = 0;
  for (const int count : histogram) chi2 += (count - n / 100) * (count - n / 100) / (n / 100);
  CHECK(chi2 < 160);  // 99 degrees of freedom: 1 in 10^4 lies above
}

TEST_CASE("below covers its range evenly and never reaches n") {
  const CounterRng rng{7, 3};
  for (const std::uint32_t n : {1u, 2u, 3u, 7u, 10u}) {
    std::vector<int> counts(n);
    for (std::uint64_t i = 0; i < 100000; ++i) {
      const std::uint32_t value = rng.below(i, n);
      REQUIRE(value < n);
      ++counts[value];
    }
    const double expected = 100000.0 / n;
    for (const int count : counts) CHECK(std::abs(count - expected) < 5 * std::sqrt(expected) + 1);
  }
  std::uint32_t largest = 0;
  for (std::uint64_t i = 0; i < 100000; ++i) largest = std::max(largest, rng.below(i, 0xFFFFFFFFu));
  CHECK(largest > 0xFFFF0000u);
}

TEST_CASE("normal has the moments of a standard normal variable") {
  const CounterRng rng{5, 9};
  double moments[5] = {};
  for (std::uint64_t i = 0; i < kSamples; ++i) {
    const double x = rng.normal(i);
    REQUIRE(std::isfinite(x));
    double power = 1;
    for (double& moment : moments) {
      moment += power;
      power *= x;
    }
  }
  const double n = kSamples;
  CHECK(std::abs(moments[1] / n) < 4 / std::sqrt(n));
  CHECK(std::abs(moments[2] / n - 1) < 4 * std::sqrt(2 / n));
  CHECK(std::abs(moments[3] / n) < 4 * std::sqrt(15 / n));
  CHECK(std::abs(moments[4] / n - 3) < 4 * std::sqrt(96 / n));
}
