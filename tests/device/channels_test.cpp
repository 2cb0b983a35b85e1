// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <bit>
#include <cmath>
#include <cstring>
#include <vector>

#include "langgs/core/rng.hpp"
#include "langgs/device/launch.hpp"

using namespace langgs;
using host::kLanes;

namespace {

const host::Warp<32, false> kWarp(0);

}  // namespace

TEST_CASE("rows of channels: every half word loads as Half converts it") {
  std::vector<Half> words(65536);
  for (std::size_t i = 0; i < words.size(); ++i) words[i].bits = static_cast<std::uint16_t>(i);
  int wrong = 0;
  for (std::size_t at = 0; at < words.size(); at += kLanes) {
    const Varying<float> row = kWarp.load_channels(words.data() + at, kLanes);
    for (int l = 0; l < kLanes; ++l) {
      const float want = static_cast<float>(words[at + l]), have = row.lane(l);
      wrong += std::isnan(want) ? !std::isnan(have) : std::memcmp(&want, &have, sizeof(want)) != 0;
    }
  }
  CHECK(wrong == 0);
}

TEST_CASE("rows of channels: storing rounds as Half does") {
  const CounterRng rng{3, 0};
  int wrong = 0;
  for (std::uint64_t n = 0; n < 20000; ++n) {
    float values[kLanes];
    Half stored[kLanes];
    for (int l = 0; l < kLanes; ++l) {
      const std::uint64_t at = n * kLanes + static_cast<std::uint64_t>(l);
      // Every exponent, and ties of the 13 bits that are dropped.
      auto word = static_cast<std::uint32_t>(rng.bits(at));
      if (at % 3 == 0) word = (word & 0xFFFFE000u) | 0x1000u;
      values[l] = std::bit_cast<float>(word);
    }
    kWarp.store_channels(stored, kLanes, Varying<float>::load(values));
    for (int l = 0; l < kLanes; ++l)
      wrong += std::isnan(values[l]) ? !std::isnan(static_cast<float>(stored[l])) : stored[l] != Half(values[l]);
  }
  CHECK(wrong == 0);
}

TEST_CASE_TEMPLATE("rows of channels: nothing beyond the row is read or written", T, float, Half) {
  for (int count = 0; count < kLanes; ++count) {
    CAPTURE(count);
    std::vector<T> row(static_cast<std::size_t>(count));  // exactly as long: the sanitizers see an access beyond it
    for (int i = 0; i < count; ++i) row[i] = static_cast<T>(0.5f * static_cast<float>(i + 1));
    const Varying<float> loaded = kWarp.load_channels(row.data(), count);
    for (int l = 0; l < kLanes; ++l) REQUIRE(loaded.lane(l) == (l < count ? 0.5f * static_cast<float>(l + 1) : 0.f));
    kWarp.store_channels(row.data(), count, loaded * 2.f);
    for (int i = 0; i < count; ++i) REQUIRE(static_cast<float>(row[i]) == static_cast<float>(i + 1));
  }
}
