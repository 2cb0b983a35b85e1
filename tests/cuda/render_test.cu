// SPDX-License-Identifier: Apache-2.0
// The tile kernels on CUDA against the same kernels on the host, stage by stage. The exponential differs in its last
// bits, so a hit may fall on the other side of a threshold: few values may differ by one threshold's worth.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "cuda/device_array.hpp"
#include "cuda/host_render.hpp"
#include "langgs/device/launch.hpp"
#include "langgs/render/contributions.hpp"
#include "langgs/render/map_gradient.hpp"
#include "langgs/render/splat_list.hpp"

namespace langgs {
namespace {

using test::DeviceArray;
using test::HostRender;
using test::kTestK;

/// Device copies of what a tile kernel reads.
struct DeviceScene {
  explicit DeviceScene(const HostRender& host)
      : map(host.map),
        tile_begin(host.tile_begin),
        sorted_slot(host.sorted_slot),
        slot(host.slot),
        splat_gaussian(host.splat_gaussian),
        slot_begin(host.slot_begin),
        splats(host.splats) {}
  [[nodiscard]] InstanceView instances() const {
    return {tile_begin.data(), sorted_slot.data(), slot.data(), splats.data(), splat_gaussian.data()};
  }

  DeviceArray<float> map;
  DeviceArray<std::int32_t> tile_begin, sorted_slot;
  DeviceArray<Instance> slot;
  DeviceArray<std::int32_t> splat_gaussian, slot_begin;
  DeviceArray<Splat> splats;
};

/// How many of `got` are further than absolute + relative |expected| from `expected`; NaN counts.
template <class T>
int num_far(const std::vector<T>& got, const std::vector<T>& expected, double absolute, double relative) {
  REQUIRE(got.size() == expected.size());
  int far = 0;
  for (std::size_t i = 0; i < got.size(); ++i) {
    const double e = static_cast<double>(expected[i]), difference = std::abs(static_cast<double>(got[i]) - e);
    far += difference <= absolute + relative * std::abs(e) ? 0 : 1;
  }
  return far;
}

// Partial tiles on both sides; 23 tiles' worth of Gaussians, some of them outside.
HostRender scene() { return test::render_on_host(69, 45, 300, 7); }

TEST_CASE("Projection on CUDA equals the host's") {
  const HostRender host = scene();
  const DeviceScene device(host);
  const Executor<Cuda> executor;
  DeviceArray<float> projected(host.projected.size());
  DeviceArray<std::int32_t> visible(host.visible.size());
  for_each_lanes(
      executor, host.size,
      ProjectGaussians{
          {device.map.data(), host.size, host.size}, host.view, projected.data(), host.size, visible.data()});
  executor.synchronize();
  CHECK(visible.values() == host.visible);
  std::vector<float> got = projected.values(), expected = host.projected;
  for (std::size_t i = 0; i < got.size(); ++i)
    if (host.visible[i % host.size] == 0) got[i] = expected[i] = 0;  // behind the camera anything goes
  CHECK(num_far(got, expected, 1e-4, 1e-4) == 0);
}

TEST_CASE("Rendering with Top-K on CUDA equals the host's") {
  const HostRender host = scene();
  const DeviceScene device(host);
  const Executor<Cuda> executor;
  const std::size_t n = host.view.camera.num_pixels(), num_instances = host.sorted_slot.size();
  const std::size_t num_places = num_instances + static_cast<std::size_t>(host.grid.count());
  DeviceArray<float> planes(5 * n), topk_weight(kTestK * n), place_max_weight(num_places);
  DeviceArray<std::int32_t> topk_id(kTestK * n), place_gaussian(num_places), place_count(num_places);
  DeviceArray<InstanceStatistics> slot(num_instances);
  const RenderPlanes out{planes.data(), planes.data() + 3 * n, planes.data() + 4 * n};
  launch(executor, host.grid.count(),
         TileForward<kTestK>{host.grid,
                             device.instances(),
                             out,
                             {topk_id.data(), topk_weight.data(), slot.data(), place_gaussian.data(),
                              place_count.data(), place_max_weight.data()}});
  executor.synchronize();
  CHECK(num_far(planes.values(), host.planes, 1e-4, 1e-4) <= 2);
  CHECK(num_far(planes.values(), host.planes, 0.05, 0.) == 0);
  CHECK(num_far(topk_weight.values(), host.topk_weight, 1e-5, 1e-4) <= 2);
  CHECK(num_far(topk_id.values(), host.topk_id, 0., 0.) <= 4);

  const std::vector<InstanceStatistics> seen = slot.values();
  std::vector<std::int32_t> splat_count;
  std::vector<float> splat_most;
  for (std::size_t c = 0; c < host.splats.size(); ++c) {
    splat_count.push_back(0);
    splat_most.push_back(0);
    for (int s = host.slot_begin[c]; s < host.slot_begin[c + 1]; ++s) {
      splat_count.back() += seen[s].topk_count;
      splat_most.back() = std::max(splat_most.back(), seen[s].max_weight);
    }
  }
  CHECK(num_far(splat_count, host.topk_count, 2., 0.) == 0);
  CHECK(num_far(splat_most, host.max_weight, 1e-5, 1e-4) <= 1);

  // Without recording: the same picture, bit for bit.
  DeviceArray<float> plain(5 * n);
  launch(executor, host.grid.count(),
         TileForward<0>{host.grid, device.instances(), {plain.data(), plain.data() + 3 * n, plain.data() + 4 * n}, {}});
  executor.synchronize();
  CHECK(num_far(plain.values(), planes.values(), 0., 0.) == 0);

  DeviceArray<std::int32_t> num_hits(n);
  launch(executor, host.grid.count(),
         detail::RecordHits{host.grid, device.instances(), nullptr, num_hits.data(), nullptr, nullptr});
  executor.synchronize();
  CHECK(num_far(num_hits.values(), host.num_hits, 0., 0.) <= 2);
}

TEST_CASE("Gradients on CUDA equal the host's") {
  const HostRender host = scene();
  const DeviceScene device(host);
  const Executor<Cuda> executor;
  const std::size_t n = host.view.camera.num_pixels(), num_splats = host.splats.size();
  DeviceArray<float> planes(host.planes), upstream(host.upstream);
  DeviceArray<float> slot_sums(host.sorted_slot.size() * kSplatSumStride), gradient(kNumPlanes * num_splats),
      pose(6 * num_splats);
  launch(executor, host.grid.count(),
         TileBackward{host.grid,
                      device.instances(),
                      {planes.data(), planes.data() + 3 * n, planes.data() + 4 * n},
                      {upstream.data(), upstream.data() + 3 * n},
                      slot_sums.data()});
  const int size = static_cast<int>(num_splats);
  for_each_lanes(executor, size,
                 GatherGradient{{device.map.data(), host.size, host.size},
                                host.view,
                                device.splat_gaussian.data(),
                                device.slot_begin.data(),
                                slot_sums.data(),
                                {gradient.data(), size, size},
                                pose.data()});
  executor.synchronize();

  const std::vector<float> got = gradient.values();
  for (int p = 0; p < kNumPlanes; ++p) {
    CAPTURE(p);
    const std::vector<float> row(got.begin() + p * size, got.begin() + (p + 1) * size);
    const std::vector<float> expected(host.gradient.begin() + p * size, host.gradient.begin() + (p + 1) * size);
    double largest = 0;
    for (float v : expected) largest = std::max(largest, std::abs(static_cast<double>(v)));
    REQUIRE(largest > 0);
    CHECK(num_far(row, expected, 1e-4 * largest, 1e-3) <= 2);
    CHECK(num_far(row, expected, 0.05 * largest, 0.05) == 0);
  }
  const std::vector<float> rows = pose.values();
  for (int a = 0; a < 6; ++a) {
    double sum = 0, size_of_sum = 0;
    for (int c = 0; c < size; ++c) {
      sum += static_cast<double>(rows[a * size + c]);
      size_of_sum += std::abs(static_cast<double>(rows[a * size + c]));
    }
    CHECK(std::abs(sum - host.pose[a]) < 1e-3 * size_of_sum);
  }
}

TEST_CASE("A launch that cannot work names the kernel and its shape") {
  const Executor<Cuda> executor;
  CHECK_NOTHROW(launch(executor, 0, TileForward<0>{}));
  CHECK_THROWS_WITH_AS(launch(executor, -1, TileForward<0>{}), doctest::Contains("TileForward<0>"), InvalidArgument);
  CHECK_THROWS_WITH_AS(detail::check_cuda(cudaErrorInvalidConfiguration, "launch of X with ", 3, " blocks"),
                       doctest::Contains("launch of X with 3 blocks: cudaErrorInvalidConfiguration"), DeviceError);
}

}  // namespace
}  // namespace langgs
