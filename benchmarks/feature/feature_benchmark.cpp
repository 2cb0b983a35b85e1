// SPDX-License-Identifier: Apache-2.0
// Times everything about features: contributions from Top-K records, compositing, full blending, and the steps of the
// optimisers. LANGGS_WORKLOAD names a folder with gs.ply and cameras.txt; without it the built-in room is used.
// Names: STAGE/D/K/RESOLUTION, K = 0 for full blending.
#include <benchmark/benchmark.h>

#include <cstdlib>
#include <iterator>
#include <memory>
#include <string>
#include <vector>

#include "langgs/optimize/feature_adam.hpp"
#include "langgs/optimize/feature_average.hpp"
#include "langgs/optimize/feature_step.hpp"
#include "langgs/render/feature_compositor.hpp"
#include "langgs/render/topk_rasterizer.hpp"
#include "workload.hpp"

namespace langgs::benchmarks {
namespace {

const Workload& workload() {
  static const Workload kept =
      std::getenv("LANGGS_WORKLOAD") ? read_workload(std::getenv("LANGGS_WORKLOAD")) : room_workload(100'000, 640, 480);
  return kept;
}

/// Features are sampled at the image's resolution divided by this.
enum Resolution { kFull = 1, kQuarter = 2 };

/// The contributions of the first view; recorded once for each K and resolution, since the map does not move.
template <int K>
class View0 {
 public:
  View0(const Executor<Host>& executor, Resolution resolution) {
    const View& view = workload().views.front();
    rasterizer.render(executor, workload().map.geometry(), view);
    grid = {view.camera.width / resolution, view.camera.height / resolution, view.camera};
    record(executor);
  }
  void record(const Executor<Host>& executor) {
    if constexpr (K == 0)
      contributions.from_blending(executor, rasterizer.splats(), grid);
    else
      contributions.from_topk(executor, rasterizer, grid);
  }

  TopKRasterizer<K == 0 ? 1 : K> rasterizer;
  SampleGrid grid;
  Contributions<Host> contributions;
};

/// Smooth unit vectors with noise, as an encoder gives them.
template <int D>
FeatureMap<D> make_teacher(int width, int height) {
  constexpr int kPatch = 16, kClasses = 29;
  FeatureMap<D> teacher(width, height);
  std::vector<float> feature(D);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const CounterRng rng{7, static_cast<std::uint64_t>((y / kPatch * 7 + x / kPatch) % kClasses)};
      for (int c = 0; c < D; ++c)
        feature[c] =
            static_cast<float>(rng.uniform(static_cast<std::uint64_t>(c)) - 0.5 + 0.01 * ((x * 5 + y + c) % 7));
      teacher.set_pixel(x, y, feature.data());
    }
  return teacher;
}

template <int D, class Optimizer>
using MapOf = GaussianMap<D, Host, Optimizer>;

template <int D, class Optimizer>
void fill(MapOf<D, Optimizer>& map) {
  constexpr int kAtOnce = 1000;
  for (int left = workload().map.size(); left > 0; left -= kAtOnce) {
    std::vector<Gaussian<D>> some(std::min(left, kAtOnce));
    for (std::size_t i = 0; i < some.size(); ++i)
      for (int c = 0; c < D; ++c) some[i].feature[c] = static_cast<float>((i * 31 + c * 17) % 101) * 1e-3f - 0.05f;
    map.append(some, 0, 0);
  }
}

void count(benchmark::State& state, const ContributionView& contributions, double bytes) {
  state.counters["contributions"] = contributions.size;
  state.counters["MB"] = bytes * 1e-6;
}

template <int K, Resolution R>
void record(benchmark::State& state) {
  const Executor<Host> executor(static_cast<int>(state.range(0)));
  View0<K> view(executor, R);
  for (auto _ : state) view.record(executor);
  count(state, view.contributions.view(), view.contributions.view().size * 12.);
}

/// The image written as T, or, with T void, looked at and forgotten: the sum of each pixel's channels.
struct Forget {
  float* out;  ///< [num_pixels]
  template <class Warp, class Values>
  void operator()(const Warp& warp, int p, int c, const Values& values) const {
    auto sum = values.vector[0];
    for (int v = 1; v < static_cast<int>(std::size(values.vector)); ++v) sum += values.vector[v];
    out[p] = (c == 0 ? 0.f : out[p]) + warp.sum(sum);
  }
};
template <int D, int K, Resolution R, class T>
void composite(benchmark::State& state) {
  const Executor<Host> executor(static_cast<int>(state.range(0)));
  const View0<K> view(executor, R);
  const ContributionView contributions = view.contributions.view();
  MapOf<D, PlainFeatures<>> map;
  fill<D, PlainFeatures<>>(map);
  Buffer<float, Host> seen(contributions.num_pixels());
  using Image = std::conditional_t<std::is_void_v<T>, float, T>;
  Buffer<Image, Host> image(std::is_void_v<T> ? 1 : static_cast<std::size_t>(contributions.num_pixels()) * D);
  for (auto _ : state)
    if constexpr (std::is_void_v<T>)
      stream_features<D>(executor, contributions, map.features().data(), Forget{seen.data()});
    else
      composite_features<D>(executor, contributions, map.features().data(), image.data());
  // Rows are counted once, as if a cache held them.
  count(state, contributions, 2. * D * map.size() + 12. * contributions.size + static_cast<double>(image.bytes()));
}

template <int D, int K, Resolution R, class Optimizer>
void step(benchmark::State& state) {
  const Executor<Host> executor(static_cast<int>(state.range(0)));
  View0<K> view(executor, R);
  MapOf<D, Optimizer> map;
  fill<D, Optimizer>(map);
  const FeatureMap<D> teacher = make_teacher<D>(view.grid.width, view.grid.height);
  FeatureStep<D, Optimizer> feature_step;
  const Optimizer optimizer;
  for (auto _ : state) {
    view.record(executor);
    feature_step.step(executor, optimizer, map, view.contributions.view(), teacher);
  }
  count(state, view.contributions.view(), static_cast<double>(teacher.bytes()) + 4. * D * map.size());
}

void add(const std::string& name, void (*body)(benchmark::State&)) {
  benchmark::RegisterBenchmark(name.c_str(), body)
      ->ArgName("threads")
      ->Arg(1)
      ->Arg(2)
      ->Unit(benchmark::kMillisecond)
      ->UseRealTime();
}

template <int D, int K>
void add_both(const std::string& name) {
  const std::string full = "/" + name + "/full", quarter = "/" + name + "/quarter";
  if constexpr (K > 0) {
    add("average" + full, step<D, K, kFull, FeatureAverage<>>);
    add("average" + quarter, step<D, K, kQuarter, FeatureAverage<>>);
  }
  add("streamed" + full, composite<D, K, kFull, void>);
  add("streamed" + quarter, composite<D, K, kQuarter, void>);
}

template <int D>
void add_dimension() {
  const std::string d = std::to_string(D);
  add_both<D, 3>(d + "/3");
  add_both<D, 0>(d + "/blend");
}

void add_all() {
  add("record/1/full", record<1, kFull>);
  add("record/3/full", record<3, kFull>);
  add("record/10/full", record<10, kFull>);
  add("record/3/quarter", record<3, kQuarter>);
  add("record/blend/full", record<0, kFull>);
  add_dimension<16>();
  add_dimension<64>();
  add_dimension<128>();
  add_dimension<512>();
  add_dimension<768>();
  add_dimension<1152>();
  add_both<512, 1>("512/1");
  add_both<512, 5>("512/5");
  add_both<512, 10>("512/10");
  add("half_image/512/3/full", composite<512, 3, kFull, Half>);
  add("half_image/512/blend/full", composite<512, 0, kFull, Half>);
  add("float_image/512/3/full", composite<512, 3, kFull, float>);
  add("float_image/512/blend/full", composite<512, 0, kFull, float>);
  add("adam_half/512/3/full", step<512, 3, kFull, FeatureAdam<Half>>);
  add("adam_half/512/3/quarter", step<512, 3, kQuarter, FeatureAdam<Half>>);
  add("adam/512/3/full", step<512, 3, kFull, FeatureAdam<float>>);
  add("adam/512/3/quarter", step<512, 3, kQuarter, FeatureAdam<float>>);
}

}  // namespace
}  // namespace langgs::benchmarks

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  langgs::benchmarks::add_all();
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
