// SPDX-License-Identifier: Apache-2.0
// Lists whose sizes the device knows before the host does: the algorithms stop at the size, however much room there is.
#include <doctest/doctest.h>

#include <algorithm>
#include <cstdint>
#include <vector>

#include "cuda/device_array.hpp"
#include "langgs/core/rng.hpp"
#include "langgs/device/counted_lists.hpp"

namespace langgs {
namespace {

using test::DeviceArray;

constexpr int kRoom = 5000;

TEST_CASE("Algorithms on CUDA stop at a size that only the device knows") {
  const Executor<Cuda> executor{gpu::Stream()};
  const CounterRng rng{11};
  for (const int n : {0, 1, 700, kRoom}) {
    CAPTURE(n);
    const DeviceArray<std::int32_t> exact(std::vector<std::int32_t>{n});
    const ListSize size(kRoom, exact.data());
    std::vector<std::uint32_t> keys(kRoom);
    std::vector<std::int32_t> values(kRoom), group_begin(kRoom + 1), untouched(kRoom, -7);
    std::vector<KeyValue> pairs(kRoom);
    std::vector<float> rows(2 * kRoom);
    for (int i = 0; i < kRoom; ++i) {
      keys[i] = rng.below(i, 50);  // smaller beyond the size, too
      values[i] = i;
      pairs[i] = {keys[i], i};
      group_begin[i + 1] = group_begin[i] + static_cast<std::int32_t>(keys[i] % 4);
      rows[i] = rows[kRoom + i] = static_cast<float>(i % 100);
    }
    std::vector<std::int32_t> sorted(values.begin(), values.begin() + n);
    std::stable_sort(sorted.begin(), sorted.end(), [&](int a, int b) { return keys[a] < keys[b]; });

    SortScratch<Cuda> scratch;
    const DeviceArray<std::uint32_t> by(keys);
    const DeviceArray<std::int32_t> order(values);
    sort_by_key(executor, by.data(), order.data(), size, scratch);
    Buffer<std::int32_t, Cuda> offsets;
    const DeviceArray<KeyValue> key_values(pairs);
    const DeviceArray<std::int32_t> grouped(untouched), places(untouched), begin(group_begin);
    group_by_key(executor, key_values.data(), size, grouped.data(), offsets, 50, scratch);
    Buffer<std::int32_t, Cuda> offsets_again;
    const DeviceArray<std::uint32_t> constant_keys(keys);
    const DeviceArray<std::int32_t> constant_values(values), grouped_again(kRoom), sums_before(kRoom + 1);
    group_by_key(executor, constant_keys.data(), constant_values.data(), size, grouped_again.data(), offsets_again, 50,
                 scratch);
    const ListSize total = exclusive_scan(executor, constant_values.data(), sums_before.data(), n, INT32_MAX);
    scan_in_order(executor, order.data(), begin.data(), places.data(), size);
    const DeviceArray<float> values_of_rows(rows);
    const DeviceArray<double> sums(2);
    sum_rows(executor, values_of_rows.data(), kRoom, size, 2, sums.data());
    executor.synchronize();

    auto got = order.values();
    got.resize(n);
    CHECK(got == sorted);
    got = grouped.values();
    CHECK(std::count(got.begin() + n, got.end(), -7) == kRoom - n);
    got.resize(n);
    CHECK(got == sorted);
    got = grouped_again.values();
    got.resize(n);
    CHECK(got == sorted);
    CHECK(constant_keys.values() == keys);
    std::vector<std::int32_t> ends(51), ends_again(51);
    copy_to_host(executor, offsets.data(), 51, ends.data());
    copy_to_host(executor, offsets_again.data(), 51, ends_again.data());
    CHECK(ends_again == ends);
    CHECK(total.most == INT32_MAX);
    CHECK(sums_before.values()[n] == n * (n - 1) / 2);
    CHECK(total.exact == sums_before.data() + n);
    for (int k = 0; k <= 50; ++k)
      REQUIRE(ends[k] ==
              std::count_if(keys.begin(), keys.begin() + n, [&](auto key) { return static_cast<int>(key) < k; }));
    std::int32_t next = 0;
    const std::vector<std::int32_t> place = places.values();
    for (const int g : sorted) {
      REQUIRE(place[g] == next);
      next += group_begin[g + 1] - group_begin[g];
    }
    double sum = 0;
    for (int i = 0; i < n; ++i) sum += i % 100;
    CHECK(sums.values() == std::vector<double>{sum, sum});
  }
}

TEST_CASE("Counted lists on CUDA are empty where one has no room, and have it from then on") {
  const Executor<Cuda> executor{gpu::Stream()};
  CountedLists<Cuda, 2> lists;
  Buffer<std::int32_t, Cuda> offsets(executor, 3), others(executor, 3);
  const auto scan = [&](std::vector<std::int32_t> counts, std::vector<std::int32_t> other) {
    const DeviceArray<std::int32_t> first(counts), second(other);
    lists.scan(executor, {{first.data(), offsets.data()}, {second.data(), others.data()}}, 2);
    lists.begin(executor);
    executor.synchronize();
  };
  const auto on_device = [&](std::size_t k) {
    std::int32_t size = -1;
    copy_to_host(executor, lists[k].exact, 1, &size);
    return size;
  };
  scan({3, 5}, {0, 0});
  CHECK(on_device(0) == 0);
  CHECK(!lists.fits());
  CHECK(lists[0].most == 8);
  CHECK(lists[0].exact == nullptr);
  scan({4, 6}, {0, 0});  // a quarter more than before
  CHECK(on_device(0) == 10);
  CHECK(lists.fits());
  CHECK(lists[0].most == 10);
  scan({1, 1}, {1, 0});  // room for one alone
  CHECK(on_device(0) == 0);
  CHECK(on_device(1) == 0);
  CHECK(!lists.fits());
  CHECK(lists.fits());
  scan({10, 0}, {1, 0});
  CHECK(on_device(0) == 10);
  CHECK(on_device(1) == 1);
  scan({INT32_MAX, 1}, {1, 0});
  CHECK_THROWS_AS((void)lists.fits(), Error);
}

}  // namespace
}  // namespace langgs
