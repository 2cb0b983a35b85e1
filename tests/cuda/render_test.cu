// SPDX-License-Identifier: Apache-2.0
// The owners on CUDA against the same owners on the host: a view rendered and its backward pass. The exponential
// differs in its last bits, so a hit may fall on the other side of a threshold: few values may differ by one
// threshold's worth.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "cuda/counted_memory.hpp"
#include "cuda/device_array.hpp"
#include "cuda/host_render.hpp"
#include "langgs/cuda/graph.hpp"
#include "langgs/device/copy.hpp"
#include "langgs/optimize/adam.hpp"
#include "langgs/optimize/geometric_loss.hpp"
#include "langgs/render/contributions.hpp"
#include "langgs/render/topk_rasterizer.hpp"

namespace langgs {
namespace {

using test::DeviceArray;
using test::HostRender;
using test::kTestK;
using FloatBuffer = Buffer<float, Cuda>;

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

struct Bench {
  /// Partial tiles on both sides; some Gaussians are outside.
  explicit Bench(int width = 69, int height = 45, int num_gaussians = 300)
      : host(test::render_on_host(width, height, num_gaussians, 7)), executor(gpu::Stream(), memory) {
    upload(host.map, map_memory);
    upload(host.target, target);
    upload(host.planes, host_planes);
    upload(host.upstream, upstream);
  }
  void upload(const std::vector<float>& values, FloatBuffer& to) {
    to.resize_discard(executor, values.size());
    copy_from_host(executor, values.data(), values.size(), to.data());
  }
  template <class T>
  [[nodiscard]] std::vector<T> fetch(const T* from, std::size_t n) const {
    std::vector<T> result(n);
    copy_to_host(executor, from, n, result.data());
    return result;
  }
  [[nodiscard]] PlanesView map() { return {map_memory.data(), host.size, host.size}; }
  [[nodiscard]] std::size_t num_pixels() const { return host.view.camera.num_pixels(); }

  HostRender host;
  std::shared_ptr<test::CountedMemory> memory = std::make_shared<test::CountedMemory>();
  Executor<Cuda> executor;
  FloatBuffer map_memory, target, host_planes, upstream;
  TopKRasterizer<kTestK, Cuda> rasterizer;
};

TEST_CASE("Splats and tile lists on CUDA equal the host's") {
  Bench bench;
  const HostRender& host = bench.host;
  SplatList<Cuda> list;
  list.build(bench.executor, bench.map(), host.view);
  REQUIRE(list.num_splats() == static_cast<int>(host.splats.size()));
  REQUIRE(list.num_instances() == static_cast<int>(host.sorted_slot.size()));
  const InstanceView instances = list.instances();
  CHECK(bench.fetch(list.gaussian(), host.splats.size()) == host.splat_gaussian);
  CHECK(bench.fetch(list.slot_begin(), host.slot_begin.size()) == host.slot_begin);
  CHECK(bench.fetch(instances.tile_begin, host.tile_begin.size()) == host.tile_begin);
  CHECK(bench.fetch(instances.sorted_slot, host.sorted_slot.size()) == host.sorted_slot);
  const std::vector<Instance> slot = bench.fetch(instances.slot, host.slot.size());
  int different = 0;
  for (std::size_t i = 0; i < slot.size(); ++i)
    different += slot[i].splat != host.slot[i].splat || slot[i].first_warp != host.slot[i].first_warp ||
                 slot[i].last_warp != host.slot[i].last_warp;
  CHECK(different == 0);
  const std::vector<Splat> splats = bench.fetch(instances.splats, host.splats.size());
  std::vector<float> got, expected;
  for (std::size_t c = 0; c < splats.size(); ++c)
    for (const auto member :
         {&Splat::x, &Splat::y, &Splat::half_xx, &Splat::xy, &Splat::half_yy, &Splat::log_opacity, &Splat::red,
          &Splat::green, &Splat::blue, &Splat::depth, &Splat::half_width, &Splat::half_height}) {
      got.push_back(splats[c].*member);
      expected.push_back(host.splats[c].*member);
    }
  CHECK(num_far(got, expected, 1e-4, 1e-4) == 0);
}

TEST_CASE("Rendering with Top-K on CUDA equals the host's") {
  Bench bench;
  const HostRender& host = bench.host;
  const std::size_t n = bench.num_pixels(), num_splats = host.splats.size();
  bench.rasterizer.render(bench.executor, bench.map(), host.view);
  const std::vector<float> planes = bench.fetch(bench.rasterizer.rendered().colour, 5 * n);
  CHECK(num_far(planes, host.planes, 1e-4, 1e-4) <= 2);
  CHECK(num_far(planes, host.planes, 0.05, 0.) == 0);
  CHECK(num_far(bench.fetch(bench.rasterizer.topk_weight(), kTestK * n), host.topk_weight, 1e-5, 1e-4) <= 2);
  CHECK(num_far(bench.fetch(bench.rasterizer.topk_id(), kTestK * n), host.topk_id, 0., 0.) <= 4);
  const SplatStatistics seen = bench.rasterizer.statistics();
  CHECK(num_far(bench.fetch(seen.topk_count, num_splats), host.topk_count, 2., 0.) == 0);
  CHECK(num_far(bench.fetch(seen.max_weight, num_splats), host.max_weight, 1e-5, 1e-4) <= 1);

  DeviceArray<std::int32_t> num_hits(n);
  launch(
      bench.executor, host.grid.count(),
      detail::RecordHits{host.grid, bench.rasterizer.splats().instances(), nullptr, num_hits.data(), nullptr, nullptr});
  bench.executor.synchronize();
  CHECK(num_far(num_hits.values(), host.num_hits, 0., 0.) <= 2);

  // Without recording: the same picture, bit for bit.
  bench.rasterizer.render(bench.executor, bench.map(), host.view, false);
  CHECK(bench.fetch(bench.rasterizer.rendered().colour, 5 * n) == planes);
}

TEST_CASE("Gradients on CUDA equal the host's") {
  Bench bench;
  const HostRender& host = bench.host;
  const std::size_t n = bench.num_pixels();
  MapGradient<Cuda> gradient;
  CHECK(gradient.pose() == Twist::Zero());
  bench.rasterizer.render(bench.executor, bench.map(), host.view, false);
  bench.rasterizer.backward(bench.executor, bench.map(), {bench.upstream.data(), bench.upstream.data() + 3 * n},
                            gradient);
  const int size = gradient.size();
  REQUIRE(size == static_cast<int>(host.splats.size()));
  for (int p = 0; p < kNumPlanes; ++p) {
    CAPTURE(p);
    const std::vector<float> got = bench.fetch(gradient.planes().plane(p), size);
    const std::vector<float> expected(host.gradient.begin() + p * size, host.gradient.begin() + (p + 1) * size);
    double largest = 0;
    for (float v : expected) largest = std::max(largest, std::abs(static_cast<double>(v)));
    REQUIRE(largest > 0);
    CHECK(num_far(got, expected, 1e-4 * largest, 1e-3) <= 2);
    CHECK(num_far(got, expected, 0.05 * largest, 0.05) == 0);
  }
  const Twist pose = gradient.pose();
  for (int a = 0; a < 6; ++a)
    CHECK(std::abs(pose[a] - host.pose[a]) < 1e-3 * Eigen::Map<const Twist>(host.pose.data()).norm());
}

TEST_CASE("Once the views are known, a step takes no device memory and the same bits come again") {
  Bench bench(37, 21, 60);
  const std::size_t n = bench.num_pixels();
  const HostRender& host = bench.host;
  const int width = host.view.camera.width, height = host.view.camera.height;
  GeometricLoss<Cuda> loss;
  MapGradient<Cuda> gradient;
  FloatBuffer up(bench.executor, 4 * n);
  const auto step = [&] {
    bench.rasterizer.render(bench.executor, bench.map(), host.view);
    const RenderPlanes rendered = bench.rasterizer.rendered();
    loss.start(bench.executor, {rendered.colour, rendered.depth, width, height},
               {bench.target.data(), bench.target.data() + 3 * n, width, height}, {up.data(), up.data() + 3 * n});
    bench.rasterizer.backward(bench.executor, bench.map(), {up.data(), up.data() + 3 * n}, gradient);
    return bench.fetch(gradient.planes().plane(0), gradient.size());
  };
  const std::vector<float> once = step();
  const Twist pose = gradient.pose();
  const int allocations = bench.memory->allocations;
  CHECK(step() == once);
  CHECK(gradient.pose() == pose);
  CHECK(bench.memory->allocations == allocations);
}

TEST_CASE("A view that has no room is empty and learns nothing; rendered again it is that of a render that waits") {
  Bench bench;
  const std::size_t n = bench.num_pixels();
  const HostRender& host = bench.host;
  const RenderGradient upstream{bench.upstream.data(), bench.upstream.data() + 3 * n};
  MapGradient<Cuda> gradient;
  bench.rasterizer.render(bench.executor, bench.map(), host.view);
  bench.rasterizer.backward(bench.executor, bench.map(), upstream, gradient);
  const std::vector<float> planes = bench.fetch(bench.rasterizer.rendered().colour, 5 * n);
  const std::vector<float> columns = bench.fetch(gradient.planes().plane(kOpacityLogit), gradient.size());
  const Twist pose = gradient.pose();

  TopKRasterizer<kTestK, Cuda> other;
  const auto draw = [&] {
    other.draw(bench.executor, bench.map());
    other.backward(bench.executor, bench.map(), upstream, gradient);
  };
  FloatBuffer first(bench.executor, host.map.size()), second(bench.executor, host.map.size());
  first.fill(bench.executor, 0.f);
  second.fill(bench.executor, 0.f);
  other.project(bench.executor, bench.map(), host.view);
  draw();
  SelectiveAdam<Cuda>().step(bench.executor,
                             {bench.map(), {first.data(), host.size, host.size}, {second.data(), host.size, host.size}},
                             gradient);
  CHECK(bench.fetch(other.rendered().colour, 4 * n) == std::vector<float>(4 * n, 0.f));
  CHECK(bench.fetch(bench.map_memory.data(), host.map.size()) == host.map);
  CHECK(gradient.pose() == Twist::Zero());
  REQUIRE(!other.fits());
  const auto check_again = [&] {
    CHECK(bench.fetch(other.rendered().colour, 5 * n) == planes);
    std::vector<float> got = bench.fetch(gradient.planes().plane(kOpacityLogit), gradient.size());
    got.resize(columns.size());
    CHECK(got == columns);
    CHECK(gradient.pose() == pose);
  };
  draw();
  CHECK(gradient.size() == static_cast<int>(columns.size()));
  check_again();
  // In more room than there are splats, and nobody waits.
  const int waits = bench.executor.num_waits();
  other.project(bench.executor, bench.map(), host.view);
  draw();
  CHECK(gradient.size() > static_cast<int>(columns.size()));
  CHECK(bench.executor.num_waits() == waits);
  CHECK(other.fits());
  CHECK(bench.executor.num_waits() == waits);
  check_again();
}

TEST_CASE("What follows a render can be captured in a graph: nothing of it waits") {
  Bench bench(37, 21, 60);
  const std::size_t n = bench.num_pixels();
  const HostRender& host = bench.host;
  const int width = host.view.camera.width, height = host.view.camera.height;
  GeometricLoss<Cuda> loss;
  MapGradient<Cuda> gradient;
  FloatBuffer up(bench.executor, 4 * n), first(bench.executor, host.map.size()),
      second(bench.executor, host.map.size());
  const AdamPlanes adam{bench.map(), {first.data(), host.size, host.size}, {second.data(), host.size, host.size}};
  bench.rasterizer.render(bench.executor, bench.map(), host.view);
  const auto learn = [&] {
    first.fill(bench.executor, 0.f);
    second.fill(bench.executor, 0.f);
    const RenderPlanes rendered = bench.rasterizer.rendered();
    loss.start(bench.executor, {rendered.colour, rendered.depth, width, height},
               {bench.target.data(), bench.target.data() + 3 * n, width, height}, {up.data(), up.data() + 3 * n});
    bench.rasterizer.backward(bench.executor, bench.map(), {up.data(), up.data() + 3 * n}, gradient);
    SelectiveAdam<Cuda>().step(bench.executor, adam, gradient);
  };
  learn();
  const std::vector<float> expected = bench.fetch(bench.map_memory.data(), host.map.size());
  const Twist pose = gradient.pose();
  const double total = loss.terms().total;

  const gpu::Graph graph(bench.executor, learn);
  bench.upload(host.map, bench.map_memory);
  std::vector<float> nothing(4 * n, 0.f);
  bench.upload(nothing, up);
  graph.launch(bench.executor);
  CHECK(bench.fetch(bench.map_memory.data(), host.map.size()) == expected);
  CHECK(gradient.pose() == pose);
  CHECK(loss.terms().total == total);
}

TEST_CASE("A launch that cannot work names the kernel and its shape") {
  const Executor<Cuda> executor;
  CHECK_NOTHROW(launch(executor, 0, TileForward<0>{}));
  CHECK_THROWS_WITH_AS(launch(executor, -1, TileForward<0>{}), doctest::Contains("TileForward<0>"), InvalidArgument);
}

}  // namespace
}  // namespace langgs
