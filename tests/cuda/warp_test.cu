// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <type_traits>
#include <utility>
#include <vector>

#include "cuda/device_array.hpp"
#include "langgs/core/half.hpp"
#include "langgs/core/rng.hpp"
#include "langgs/device/launch.hpp"

namespace langgs {
namespace {

/// Sums N values of each lane in both ways: to[0 .. N - 1] one by one, to[N .. 2 N - 1] together.
template <int N>
struct SumTwice {
  static constexpr int kThreads = 64;
  template <class Block>
  struct Shared {};
  const float* from;  ///< [N, 64]
  float* to;          ///< [2 warps, 2 N]

  template <class Block>
  LANGGS_HD void operator()(Block& block, Shared<Block>&) const {
    block.warps([&](const auto& warp) {
      float values[N];
      for (int v = 0; v < N; ++v) values[v] = warp.load(from + 64 * v + 32 * warp.index());
      float* const mine = to + 2 * N * warp.index();
      for (int v = 0; v < N; ++v) warp.store_uniform(mine + v, warp.sum(values[v]));
      warp.sums(values, [&](int v, float sum) { mine[N + v] += sum; });
    });
  }
};

TEST_CASE_TEMPLATE("Sums that a warp makes together are those that it makes one by one", Count,
                   std::integral_constant<int, 1>, std::integral_constant<int, 2>, std::integral_constant<int, 5>,
                   std::integral_constant<int, 10>, std::integral_constant<int, 32>, std::integral_constant<int, 37>) {
  constexpr int N = Count::value;
  std::vector<float> values;
  for (int i = 0; i < 64 * N; ++i) values.push_back(static_cast<float>(CounterRng{1, 0}.normal(i)));
  const test::DeviceArray<float> from(values), to(4 * N, 0);  // adding to zeros: a sum that is put twice shows
  const Executor<Cuda> executor;
  launch(executor, 1, SumTwice<N>{from.data(), to.data()});
  executor.synchronize();
  const std::vector<float> got = to.values();
  for (int w = 0; w < 2; ++w)
    for (int v = 0; v < N; ++v) CHECK(got[2 * N * w + N + v] == got[2 * N * w + v]);
  CHECK(got[0] != 0.f);
}

struct MaxTwice {
  static constexpr int kThreads = 64;
  template <class Block>
  struct Shared {};
  const float* from;  ///< [64]
  float* to;          ///< [2 warps, 2]

  template <class Block>
  LANGGS_HD void operator()(Block& block, Shared<Block>&) const {
    block.warps([&](const auto& warp) {
      const float value = warp.load(from + 32 * warp.index());
      warp.store_uniform(to + 2 * warp.index(), warp.max(value));
      warp.store_uniform(to + 2 * warp.index() + 1, warp.max_of_non_negative(value));
    });
  }
};

TEST_CASE("The largest of a warp's values is found by their bits where none is negative") {
  for (const int place : {0, 13, 31}) {
    CAPTURE(place);
    std::vector<float> values(64);
    for (int i = 0; i < 32; ++i) values[i] = std::ldexp(1.f, -140 + 8 * i);  // subnormal to large, and zeros
    std::swap(values[31], values[place]);
    const test::DeviceArray<float> from(values), to(4, 0xFF);
    const Executor<Cuda> executor;
    launch(executor, 1, MaxTwice{from.data(), to.data()});
    executor.synchronize();
    CHECK(to.values() == std::vector<float>{0x1p108f, 0x1p108f, 0.f, 0.f});
  }
}

/// One step there and one back of the values that a warp has.
struct ConvertChannels {
  static constexpr int kThreads = 64;
  template <class Block>
  struct Shared {};
  const Half* halves;
  const float* floats;
  float* from_halves;
  Half* from_floats;

  template <class Block>
  LANGGS_HD void operator()(Block& block, Shared<Block>&) const {
    block.warps([&](const auto& warp) {
      const int first = 64 * block.index() + 32 * warp.index();
      warp.store_channels(from_halves + first, 32, warp.load_channels(halves + first, 32));
      warp.store_channels(from_floats + first, 32, warp.load_channels(floats + first, 32));
    });
  }
};

TEST_CASE("Channels are converted as the host converts them") {
  // Every half; each with the floats that are next to it, half-way to the next one, and next to that.
  std::vector<Half> halves;
  std::vector<float> floats;
  const auto neighbours = [&](float value) {
    for (const float toward : {-INFINITY, INFINITY}) floats.push_back(std::nextafter(value, toward));
    floats.push_back(value);
  };
  for (int bits = 0; bits < 0x10000; ++bits) {
    Half half;
    half.bits = static_cast<std::uint16_t>(bits);
    halves.push_back(half);
    const auto value = static_cast<float>(half);
    if (!std::isfinite(value) || bits % 16 != 0) continue;
    half.bits = static_cast<std::uint16_t>(bits + 1);
    neighbours(value);
    neighbours(0.5f * (value + static_cast<float>(half)));
  }
  floats.insert(floats.end(), {65519.9f, 65520.f, 1e9f, -1e9f, INFINITY, 1e-30f, -1e-30f});
  while (floats.size() < halves.size()) floats.push_back(0.f);
  const test::DeviceArray<Half> of_halves(halves), from_floats(halves.size());
  const test::DeviceArray<float> of_floats(floats), from_halves(halves.size());
  const Executor<Cuda> executor;
  launch(executor, static_cast<int>(halves.size() / 64),
         ConvertChannels{of_halves.data(), of_floats.data(), from_halves.data(), from_floats.data()});
  executor.synchronize();
  const std::vector<float> widened = from_halves.values();
  const std::vector<Half> rounded = from_floats.values();
  int different = 0;
  for (std::size_t i = 0; i < halves.size(); ++i) {
    const auto expected = static_cast<float>(halves[i]);
    different += std::isnan(expected)
                     ? !std::isnan(widened[i])
                     : std::bit_cast<std::uint32_t>(widened[i]) != std::bit_cast<std::uint32_t>(expected);
    different += rounded[i] != Half(floats[i]);
  }
  CHECK(different == 0);
}

}  // namespace
}  // namespace langgs
