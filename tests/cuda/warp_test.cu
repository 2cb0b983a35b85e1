// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <type_traits>
#include <vector>

#include "cuda/device_array.hpp"
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

}  // namespace
}  // namespace langgs
