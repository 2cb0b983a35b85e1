// SPDX-License-Identifier: Apache-2.0
// Times the rasteriser, whole and by stage. LANGGS_WORKLOAD names a folder with gs.ply and cameras.txt for the
// "workload" family; the "room" family needs nothing. JSON: --benchmark_out=FILE --benchmark_out_format=json.
#include <benchmark/benchmark.h>

#include <cstdlib>
#include <map>
#include <memory>
#include <string>
#include <tuple>

#include "langgs/render/topk_rasterizer.hpp"
#include "workload.hpp"

namespace langgs::benchmarks {
namespace {

/// The last room asked for is kept, since making one takes longer than timing it.
const Workload& room(int size, int width, int height) {
  static std::tuple<int, int, int> key;
  static std::unique_ptr<Workload> kept;
  if (!kept || key != std::tuple(size, width, height)) {
    key = {size, width, height};
    kept = std::make_unique<Workload>(room_workload(size, width, height));
  }
  return *kept;
}
const Workload& workload() {
  static const Workload kept = read_workload(std::getenv("LANGGS_WORKLOAD"));
  return kept;
}

/// The stages of one view, each callable alone.
template <int K>
struct Stages {
  Executor<Host> executor;
  SplatList<Host> splats;
  TopKRasterizer<K == 0 ? 1 : K> rasterizer;
  MapGradient<Host> gradient;
  Buffer<float, Host> upstream;

  Stages(const Workload& work, int threads) : executor(threads) {
    const int pixels = work.views.front().camera.num_pixels();
    upstream.resize_discard(static_cast<std::size_t>(4) * pixels);
    const CounterRng rng{5, 0};
    for (int i = 0; i < 4 * pixels; ++i)
      upstream.data()[i] = static_cast<float>((rng.uniform(static_cast<std::uint64_t>(i)) - 0.5) / pixels);
  }
  void forward(const Workload& work, const View& view) {
    rasterizer.render(executor, work.map.geometry(), view, K > 0);
  }
  void backward(const Workload& work, const View& view) {
    const int pixels = view.camera.num_pixels();
    rasterizer.backward(executor, work.map.geometry(), {upstream.data(), upstream.data() + 3 * pixels}, gradient);
  }
};

/// Renders view after view and reports the mean time of one.
template <int K, class Body>
void time_views(benchmark::State& state, const Workload& work, const Body& body) {
  Stages<K> stages(work, static_cast<int>(state.range(0)));
  double instances = 0;
  for (const View& view : work.views) {  // buffers grow to their size
    stages.splats.build(stages.executor, work.map.geometry(), view);
    instances += stages.splats.num_instances();
    body(stages, view);
  }
  std::size_t next = 0;
  for (auto _ : state) body(stages, work.views[next++ % work.views.size()]);
  state.counters["instances"] = instances / static_cast<double>(work.views.size());
}

template <int K>
void forward(benchmark::State& state, const Workload& work) {
  time_views<K>(state, work, [&](auto& stages, const View& view) { stages.forward(work, view); });
}
template <int K>
void forward_backward(benchmark::State& state, const Workload& work) {
  time_views<K>(state, work, [&](auto& stages, const View& view) {
    stages.forward(work, view);
    stages.backward(work, view);
  });
}
void build_list(benchmark::State& state, const Workload& work) {
  time_views<0>(state, work, [&](auto& stages, const View& view) {
    stages.splats.build(stages.executor, work.map.geometry(), view);
  });
}
/// The backward pass alone, of the first view.
void backward(benchmark::State& state, const Workload& work) {
  Stages<0> stages(work, static_cast<int>(state.range(0)));
  stages.forward(work, work.views.front());
  for (auto _ : state) stages.backward(work, work.views.front());
}

/// The tile kernels alone and the way from their sums to the parameters, of the first view.
struct TileStages {
  Executor<Host> executor;
  const Workload& work;
  SplatList<Host> splats;
  Buffer<float, Host> planes, upstream, slot_sums;
  MapGradient<Host> map_gradient;

  TileStages(benchmark::State& state, const Workload& workload)
      : executor(static_cast<int>(state.range(0))), work(workload) {
    splats.build(executor, work.map.geometry(), view());
    const std::size_t n = view().camera.num_pixels();
    planes.resize_discard(5 * n);
    upstream.resize_discard(4 * n);
    upstream.fill(1.f / static_cast<float>(n));
    slot_sums.resize_discard(static_cast<std::size_t>(splats.num_instances()) * kSplatSumStride);
    blend();
    blend_backward();
    state.counters["instances"] = splats.num_instances();
  }
  [[nodiscard]] const View& view() const { return work.views.front(); }
  [[nodiscard]] RenderPlanes rendered() {
    const std::size_t n = view().camera.num_pixels();
    return {planes.data(), planes.data() + 3 * n, planes.data() + 4 * n};
  }
  void blend() {
    launch(executor, splats.grid().count(), TileForward<0>{splats.grid(), splats.instances(), rendered(), {}});
  }
  void blend_backward() {
    const std::size_t n = view().camera.num_pixels();
    launch(executor, splats.grid().count(),
           TileBackward{splats.grid(),
                        splats.instances(),
                        rendered(),
                        {upstream.data(), upstream.data() + 3 * n},
                        slot_sums.data()});
  }
  void gradient() { map_gradient.from_slot_sums(executor, work.map.geometry(), splats, slot_sums.data()); }
};
template <void (TileStages::*kStage)()>
void tile_stage(benchmark::State& state, const Workload& work) {
  TileStages stages(state, work);
  for (auto _ : state) (stages.*kStage)();
}

using Family = void (*)(benchmark::State&, const Workload&);
const std::pair<const char*, Family> kFamilies[] = {{"splat_list", build_list},
                                                    {"blend", tile_stage<&TileStages::blend>},
                                                    {"blend_backward", tile_stage<&TileStages::blend_backward>},
                                                    {"gradient", tile_stage<&TileStages::gradient>},
                                                    {"forward", forward<0>},
                                                    {"forward_top1", forward<1>},
                                                    {"forward_top3", forward<3>},
                                                    {"forward_top5", forward<5>},
                                                    {"forward_top10", forward<10>},
                                                    {"backward", backward},
                                                    {"forward_backward", forward_backward<0>}};

void apply(benchmark::internal::Benchmark* b) {
  b->ArgName("threads")->Arg(1)->Arg(2)->Unit(benchmark::kMillisecond)->UseRealTime();
}

void register_all() {
  if (std::getenv("LANGGS_WORKLOAD"))
    for (const auto& [name, family] : kFamilies)
      apply(benchmark::RegisterBenchmark(("workload/" + std::string(name)).c_str(),
                                         [family = family](benchmark::State& s) { family(s, workload()); }));
  constexpr std::tuple<int, int, int> kRooms[] = {{1'000, 640, 480},     {10'000, 640, 480},  {100'000, 640, 480},
                                                  {1'000'000, 640, 480}, {100'000, 320, 240}, {100'000, 1280, 720},
                                                  {100'000, 1920, 1080}};
  for (const auto& [size, width, height] : kRooms)
    for (const auto& [name, family] : kFamilies)
      apply(benchmark::RegisterBenchmark(
          ("room/" + std::to_string(size) + "/" + std::to_string(width) + "x" + std::to_string(height) + "/" + name)
              .c_str(),
          [=, family = family, size = size, width = width, height = height](benchmark::State& s) {
            family(s, room(size, width, height));
          }));
}

}  // namespace
}  // namespace langgs::benchmarks

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  langgs::benchmarks::register_all();
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
