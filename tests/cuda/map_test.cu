// SPDX-License-Identifier: Apache-2.0
// A map in the device's memory goes through the same appends and prunings as one on the host.
#include <doctest/doctest.h>

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <vector>

#include "cuda/device_array.hpp"
#include "langgs/core/rng.hpp"
#include "langgs/map/gaussian_map.hpp"
#include "langgs/optimize/feature_adam.hpp"

namespace langgs {
namespace {

using test::DeviceArray;

constexpr int kMapDim = 37;
using Storage = FeatureAdam<Half>;
using HostMap = GaussianMap<kMapDim, Host, Storage>;
using CudaMap = GaussianMap<kMapDim, Cuda, Storage>;

std::vector<Gaussian<kMapDim>> random_gaussians(std::uint64_t seed, int n) {
  const CounterRng rng{seed, 0};
  std::vector<Gaussian<kMapDim>> result(n);
  std::uint64_t next = 0;
  const auto draw = [&] { return static_cast<float>(rng.normal(next++)); };
  for (Gaussian<kMapDim>& g : result) {
    g.mean = {draw(), draw(), draw()};
    g.log_scale = {draw(), draw(), draw()};
    g.rotation = {draw(), draw(), draw(), draw()};
    g.opacity_logit = draw();
    g.colour = {draw(), draw(), draw()};
    for (float& f : g.feature) f = draw();
  }
  return result;
}

bool same(const PlanesView& a, const PlanesView& b) {
  for (int p = 0; p < kNumPlanes; ++p)
    if (a.size > 0 && std::memcmp(a.plane(p), b.plane(p), a.size * sizeof(float)) != 0) return false;
  return a.size == b.size;
}
template <class T>
bool same(const Rows<T, Host>& a, const Rows<T, Host>& b, int size) {
  const std::size_t bytes = static_cast<std::size_t>(size) * a.width() * sizeof(T);
  return bytes == 0 || std::memcmp(a.data(), b.data(), bytes) == 0;
}
bool same(const HostMap& a, const HostMap& b) {
  const int n = a.size();
  const Statistics<Host>&s = a.statistics, &t = b.statistics;
  return same(a.geometry(), b.geometry()) && same(a.first_moment.view(), b.first_moment.view()) &&
         same(a.second_moment.view(), b.second_moment.view()) && same(a.features(), b.features(), n) &&
         same(a.feature_state.first, b.feature_state.first, n) &&
         same(a.feature_state.second, b.feature_state.second, n) && same(s.topk_count, t.topk_count, n) &&
         same(s.max_weight, t.max_weight, n) && same(s.num_views, t.num_views, n) && same(s.birth, t.birth, n) &&
         same(s.uid, t.uid, n) && same(s.keyframe, t.keyframe, n);
}

TEST_CASE("A map on CUDA grows, shrinks and is read as on the host") {
  const Executor<Cuda> executor{gpu::Stream()};
  CudaMap map;
  HostMap host;
  CHECK(map.on_host(executor).size() == 0);
  CHECK(map.prune(executor, {}) == 0);
  for (int round = 0; round < 8; ++round) {
    const CounterRng rng{5, static_cast<std::uint64_t>(round)};
    const auto fresh = random_gaussians(round, static_cast<int>(rng.below(0, 200)));
    map.append(executor, fresh, round, -round);
    host.append(fresh, round, -round);
    REQUIRE(same(map.on_host(executor), host));
    // Zeros say little: what belongs to a row goes with it.
    std::vector<float> marks(host.size());
    for (int i = 0; i < host.size(); ++i) marks[i] = static_cast<float>(host.statistics.uid.data()[i]);
    copy_from_host(executor, marks.data(), marks.size(), map.second_moment.view().plane(kBlue));
    copy_from_host(executor, marks.data(), marks.size(), map.feature_state.first.data());
    std::memcpy(host.second_moment.view().plane(kBlue), marks.data(), marks.size() * sizeof(float));
    std::memcpy(host.feature_state.first.data(), marks.data(), marks.size() * sizeof(float));

    const double share = round == 3 ? 0 : (round == 4 ? 1 : 0.7);
    std::vector<std::int32_t> keep;
    for (int i = 0; i < host.size(); ++i) keep.push_back(rng.uniform(100 + i) < share ? 1 : 0);
    REQUIRE(map.prune(executor, keep) == host.prune(keep));
    REQUIRE(same(map.on_host(executor), host));
    REQUIRE(map.memory_report() == host.memory_report());
  }
  const Gaussian<kMapDim> other = random_gaussians(99, 1)[0];
  map.set(executor, 3, other);
  host.set(3, other);
  CHECK(same(map.on_host(executor), host));
  CHECK(map.get(executor, 3).mean == other.mean);
  CHECK(map.get(executor, 3).rotation == other.rotation);
  CHECK(map.get(executor, 3).feature == host[3].feature);
  CHECK_THROWS_AS(map.prune(executor, {1}), InvalidArgument);
}

TEST_CASE("Rows that are kept on CUDA may be many more than are moved at once") {
  const Executor<Cuda> executor{gpu::Stream()};
  constexpr int kWidth = 3, kRows = 40;
  const std::vector<std::int32_t> kept{0, 2, 3, 5, 6, 9, 10, 11, 12, 20, 21, 38, 39};
  std::vector<std::uint32_t> all(kRows * kWidth), expected;
  for (int i = 0; i < kRows * kWidth; ++i) all[i] = 100 + i;
  for (const int row : kept) expected.insert(expected.end(), &all[kWidth * row], &all[kWidth * row] + kWidth);
  const DeviceArray<std::int32_t> which(kept);
  for (const int elements : {1, kWidth, 4 * kWidth + 1, 13 * kWidth, 1000}) {  // 1, 1, 4, 13 rows, all
    CAPTURE(elements);
    const DeviceArray<std::uint32_t> rows(all);
    keep_rows(executor, rows.data(), kWidth, which.data(), static_cast<int>(kept.size()), elements);
    executor.synchronize();
    std::vector<std::uint32_t> got = rows.values();
    got.resize(expected.size());
    CHECK(got == expected);
  }
}

}  // namespace
}  // namespace langgs
