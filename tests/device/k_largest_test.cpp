// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <algorithm>
#include <vector>

#include "langgs/core/rng.hpp"
#include "langgs/device/block.hpp"

namespace langgs {
namespace {

constexpr int kOffers = 20;
using TestBlock = host::Block<64, Host>;
using Warp = TestBlock::Warp;

struct Offered {
  float value;
  int tag;
};

/// Offers kOffers values from {0, 1/8, ..., 7/8} to each lane of both warps, with a settlement after each `batch`, and
/// compares with a stable sort.
template <int K>
void check_against_sort(int batch) {
  TestBlock::KLargest<K, kOffers> largest;
  std::vector<std::vector<Offered>> expected(TestBlock::kThreads);
  const CounterRng rng{7, 0};
  for (int w = 0; w < TestBlock::kWarps; ++w) {
    const Warp warp(w);
    largest.clear(warp);
    for (int i = 0; i < kOffers; ++i) {
      float values[host::kLanes];
      for (int lane = 0; lane < host::kLanes; ++lane) {
        const auto draw = static_cast<std::uint64_t>((w * kOffers + i) * host::kLanes + lane);
        values[lane] = static_cast<float>(rng.below(draw, 8)) / 8.f;
        if (values[lane] > 0.f) expected[w * host::kLanes + lane].push_back({values[lane], 100 + i});
      }
      largest.offer(warp, host::Varying<float>::load(values), 100 + i);
      if ((i + 1) % batch == 0) largest.settle(warp);
    }
    largest.settle(warp);
    for (int lane = 0; lane < host::kLanes; ++lane) {
      std::vector<Offered>& sorted = expected[w * host::kLanes + lane];
      std::stable_sort(sorted.begin(), sorted.end(),
                       [](const Offered& a, const Offered& b) { return a.value > b.value; });
      sorted.resize(K, {0.f, 0});
      for (int k = 0; k < K; ++k) {
        CHECK(largest.value(warp, k).lane(lane) == sorted[k].value);
        CHECK(largest.tag(warp, k).lane(lane) == sorted[k].tag);
      }
    }
  }
}

TEST_CASE("KLargest keeps the largest values; of equal ones those that came first") {
  for (const int batch : {1, 3, kOffers}) {
    check_against_sort<1>(batch);
    check_against_sort<3>(batch);
    check_against_sort<10>(batch);
    check_against_sort<16>(batch);
  }
}

TEST_CASE("ordered_insert on plain numbers") {
  float values[2] = {0, 0};
  int tags[2] = {-1, -1};
  for (const auto& [value, tag] : {Offered{0.25f, 7}, {0.25f, 3}, {0.25f, 1}, {0.f, 9}})
    ordered_insert(values, tags, value, tag);
  CHECK(tags[0] == 7);
  CHECK(tags[1] == 3);
  ordered_insert(values, tags, 0.5f, 2);
  CHECK(tags[0] == 2);
  CHECK(tags[1] == 7);
  CHECK(values[1] == 0.25f);
}

}  // namespace
}  // namespace langgs
