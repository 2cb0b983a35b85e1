// SPDX-License-Identifier: Apache-2.0
#include "langgs/device/algorithm.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <numeric>
#include <vector>

#include "langgs/core/rng.hpp"

using namespace langgs;

namespace {

constexpr int kSizes[] = {0, 1, 7, 8, 9, 100'000};

std::vector<std::uint32_t> random_keys(int n, std::uint32_t num_keys, std::uint64_t seed) {
  const CounterRng rng{seed};
  std::vector<std::uint32_t> keys(n);
  for (int i = 0; i < n; ++i) keys[i] = rng.below(i, num_keys);
  return keys;
}

/// The indices 0 .. n - 1, stably sorted by key.
std::vector<std::int32_t> sorted_indices(const std::vector<std::uint32_t>& keys) {
  std::vector<std::int32_t> order(keys.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return keys[a] < keys[b]; });
  return order;
}

}  // namespace

TEST_CASE("sort_by_key is the stable sort of the standard library, for any number of threads") {
  SortScratch scratch;
  for (const int threads : {1, 2, 5}) {
    const Executor<Host> executor(threads);
    for (const int n : kSizes)
      for (const std::uint32_t num_keys : {1u, 5u, 300u, 0xFFFFFFFFu}) {
        std::vector<std::uint32_t> keys = random_keys(n, num_keys, n);
        if (n > 0 && num_keys != 300) keys[n / 2] = 0xFFFFFFFFu;  // the others share one range of keys then
        const std::vector<std::int32_t> expected = sorted_indices(keys);
        std::vector<std::int32_t> values(n);
        std::iota(values.begin(), values.end(), 0);
        sort_by_key(executor, keys.data(), values.data(), n, scratch);
        CHECK(values == expected);
        CHECK(std::is_sorted(keys.begin(), keys.end()));
      }
  }
}

TEST_CASE("scan_in_order places groups of any size one after the other") {
  for (const int threads : {1, 3}) {
    const Executor<Host> executor(threads);
    for (const int n : kSizes) {
      const CounterRng rng{4};
      std::vector<std::int32_t> begin(n + 1, 0), offsets(n, -1), expected(n);
      for (int i = 0; i < n; ++i) begin[i + 1] = begin[i] + static_cast<std::int32_t>(rng.below(i, 6));
      const std::vector<std::int32_t> which = sorted_indices(random_keys(n, 1000, 8));
      std::int32_t next = 0;
      for (const int g : which) {
        expected[g] = next;
        next += begin[g + 1] - begin[g];
      }
      scan_in_order(executor, which.data(), begin.data(), offsets.data(), n);
      CHECK(offsets == expected);
    }
  }
}

TEST_CASE("exclusive_scan is the one of the standard library, with the total behind it") {
  const Executor<Host> executor(2);
  for (const int n : kSizes) {
    std::vector<std::int32_t> counts(n), offsets(n + 1, -1), expected(n + 1);
    const CounterRng rng{9};
    for (int i = 0; i < n; ++i) counts[i] = static_cast<std::int32_t>(rng.below(i, 20));
    std::partial_sum(counts.begin(), counts.end(), expected.begin() + 1);
    CHECK(exclusive_scan(executor, counts.data(), offsets.data(), n) == expected[n]);
    CHECK(offsets == expected);
  }
}

TEST_CASE("exclusive_scan says so when the total does not fit") {
  const Executor<Host> executor(1);
  std::vector<std::int32_t> counts = {INT32_MAX, 0}, offsets(3);
  CHECK(exclusive_scan(executor, counts.data(), offsets.data(), 2) == INT32_MAX);
  counts[1] = 1;
  CHECK_THROWS_AS(exclusive_scan(executor, counts.data(), offsets.data(), 2), Error);
}

TEST_CASE("select_flagged gives the flagged indices in order") {
  const Executor<Host> executor(2);
  for (const int n : kSizes)
    for (const std::uint32_t odds : {1u, 2u, 1000u}) {
      std::vector<std::int32_t> flags(n), selected(n + 1, -1), expected;
      const CounterRng rng{odds};
      for (int i = 0; i < n; ++i) {
        flags[i] = rng.below(i, odds) == 0 ? -7 : 0;  // any value but 0 is a flag
        if (flags[i] != 0) expected.push_back(i);
      }
      const int count = select_flagged(executor, flags.data(), selected.data(), n);
      CHECK(std::vector<std::int32_t>(selected.begin(), selected.begin() + count) == expected);
      CHECK(selected[n] == -1);
    }
}

TEST_CASE("sum_rows adds up rows in double, and gives the same bits for any number of threads") {
  for (const int n : kSizes) {
    const int num_rows = 3, stride = n + 5;
    const CounterRng rng{6};
    std::vector<float> rows(static_cast<std::size_t>(num_rows) * stride,
                            1e30f);  // what lies between rows does not count
    std::vector<double> expected(num_rows, 0), sums(num_rows, -1), again(num_rows, -1);
    for (int r = 0; r < num_rows; ++r)
      for (int i = 0; i < n; ++i) {
        const float value = static_cast<float>(rng.below(r * stride + i, 2000)) * 0.37f - 300;
        rows[r * stride + i] = value;
        expected[r] += static_cast<double>(value);
      }
    sum_rows(Executor<Host>(1), rows.data(), stride, n, num_rows, sums.data());
    sum_rows(Executor<Host>(4), rows.data(), stride, n, num_rows, again.data());
    CHECK(sums == again);
    for (int r = 0; r < num_rows; ++r) CHECK(sums[r] == doctest::Approx(expected[r]).epsilon(1e-12));
  }
}

TEST_CASE("group_by_key is stable, complete, and the same for any number of threads") {
  std::vector<std::int32_t> offsets = {1, 2, 3}, scratch = {4, 5};  // leftovers of an earlier call
  for (const int n : kSizes)
    for (const int num_keys : {1, 3, 300}) {
      CAPTURE(n);
      CAPTURE(num_keys);
      const std::vector<std::uint32_t> keys = random_keys(n, static_cast<std::uint32_t>(num_keys), 31);
      const std::vector<std::int32_t> order = sorted_indices(keys);
      std::vector<std::int32_t> values(n), expected(n);
      for (int i = 0; i < n; ++i) values[i] = 10 * i + 3;
      for (int i = 0; i < n; ++i) expected[i] = values[order[i]];
      for (const int threads : {1, 2, 5}) {
        const Executor<Host> executor(threads);
        std::vector<std::int32_t> grouped(n, -1);
        group_by_key(executor, keys.data(), values.data(), n, grouped.data(), offsets, num_keys, scratch);
        CHECK(grouped == expected);
        std::vector<KeyValue> pairs(n);
        for (int i = 0; i < n; ++i) pairs[i] = {keys[i], values[i]};
        std::fill(grouped.begin(), grouped.end(), -1);
        group_by_key(executor, pairs.data(), n, grouped.data(), offsets, num_keys, scratch);
        CHECK(grouped == expected);
        REQUIRE(static_cast<int>(offsets.size()) == num_keys + 1);
        for (int k = 0; k <= num_keys; ++k) {
          const auto smaller = std::count_if(keys.begin(), keys.end(),
                                             [k](std::uint32_t key) { return key < static_cast<unsigned>(k); });
          REQUIRE(offsets[k] == smaller);
        }
      }
    }
}
