// SPDX-License-Identifier: Apache-2.0
// Times everything about features: contributions from Top-K records, compositing, full blending, and the steps of the
// optimisers with the recording that each needs. LANGGS_WORKLOAD names a folder with gs.ply and cameras.txt; without it
// the built-in room is used. Names: STAGE/D/K/RESOLUTION, K = blend for full blending; full and quarter are 640x480 and
// 320x240 samples of a 640x480 view. The counter `sum` is over the result: streamed and both images must agree on it.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cstdlib>
#include <functional>
#include <iterator>
#include <memory>
#include <numeric>
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

/// Which samples of the first view: K = 0 for full blending, every divisor-th pixel in both directions.
struct Sampling {
  int k, divisor;
};

/// The contributions of the first view. K is a value here, so that the kernels of a D are compiled once for all K.
class Samples {
 public:
  Samples(int num_threads, const Sampling& s) : executor(num_threads) {
    const Camera& camera = workload().views.front().camera;
    grid = {camera.width / s.divisor, camera.height / s.divisor, camera};
    if (s.k == 0) prepare<0>();
    if (s.k == 1) prepare<1>();
    if (s.k == 3) prepare<3>();
    if (s.k == 5) prepare<5>();
    if (s.k == 10) prepare<10>();
  }
  Samples(const Samples&) = delete;  // `record` refers to this

  const Executor<Host> executor;
  SampleGrid grid;
  Contributions<Host> contributions;
  std::function<void()> record;

 private:
  template <int K>
  void prepare() {
    const auto rasterizer = std::make_shared<TopKRasterizer<K == 0 ? 1 : K>>();
    rasterizer->render(executor, workload().map.geometry(), workload().views.front());
    record = [this, rasterizer] {
      if constexpr (K == 0)
        contributions.from_blending(executor, rasterizer->splats(), grid);
      else
        contributions.from_topk(executor, *rasterizer, grid);
    };
    record();
  }
};

/// Patches of one unit vector each, as an encoder sees objects.
template <int D>
FeatureMap<D> make_teacher(int width, int height) {
  constexpr int kPatch = 16, kClasses = 29;
  std::vector<float> classes(kClasses * D);
  for (std::size_t i = 0; i < classes.size(); ++i) classes[i] = static_cast<float>(CounterRng{7, 0}.uniform(i) - 0.5);
  FeatureMap<D> teacher(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      teacher.set_pixel(x, y, classes.data() + (y / kPatch * 7 + x / kPatch) % kClasses * D);
  return teacher;
}

/// A map with as many Gaussians as the workload's, and features.
template <int D, class Storage>
void fill(GaussianMap<D, Host, Storage>& map) {
  constexpr int kAtOnce = 1000;
  for (int left = workload().map.size(); left > 0; left -= kAtOnce) {
    std::vector<Gaussian<D>> some(std::min(left, kAtOnce));
    for (std::size_t i = 0; i < some.size(); ++i)
      for (int c = 0; c < D; ++c)
        some[i].feature[c] = static_cast<float>((i * 31 + static_cast<std::size_t>(c) * 17) % 101) * 1e-3f - 0.04f;
    map.append(some, 0, 0);
  }
}

/// Runs `body` once for its buffers to exist and be touched, then times it. `bytes`: of what it must read and write,
/// with each row of features counted once, as if a cache held them all.
template <class Body>
void measure(benchmark::State& state, const Samples& samples, double bytes, const Body& body) {
  body();
  for (auto _ : state) body();
  const int size = samples.contributions.view().size.most;
  state.counters["contributions"] = size;
  state.counters["MB"] = (bytes + size * 12.) * 1e-6;
}

template <class T>
double sum_of(const T* values, std::size_t size) {
  return std::accumulate(values, values + size, 0., [](double sum, T v) { return sum + static_cast<float>(v); });
}

void record(benchmark::State& state, const Sampling& sampling) {
  const Samples samples(static_cast<int>(state.range(0)), sampling);
  measure(state, samples, 0, samples.record);
  const ContributionView view = samples.contributions.view();
  double sum = 0;
  for (int i = 0; i < view.size.most; ++i) sum += static_cast<double>(view.contribution[i].weight);
  state.counters["sum"] = sum;
}

/// Looks at the rendered features and forgets them, all but the sum of each pixel's channels.
struct Forget {
  float* out;  ///< [num_pixels]
  template <class Warp, class Values>
  void operator()(const Warp& warp, int p, int c, const Values& values) const {
    auto sum = values.vector[0];
    for (int v = 1; v < static_cast<int>(std::size(values.vector)); ++v) sum += values.vector[v];
    out[p] = (c == 0 ? 0.f : out[p]) + warp.sum(sum);
  }
};
template <int D>
void streamed(benchmark::State& state, const Sampling& sampling) {
  const Samples samples(static_cast<int>(state.range(0)), sampling);
  const ContributionView view = samples.contributions.view();
  GaussianMap<D> map;
  fill(map);
  Buffer<float, Host> seen(view.num_pixels());
  measure(state, samples, static_cast<double>(map.features().bytes()),
          [&] { stream_features<D>(samples.executor, view, map.features().data(), Forget{seen.data()}); });
  state.counters["sum"] = sum_of(seen.data(), seen.size());
}

/// The image written as T.
template <int D, class T>
void image(benchmark::State& state, const Sampling& sampling) {
  const Samples samples(static_cast<int>(state.range(0)), sampling);
  const ContributionView view = samples.contributions.view();
  GaussianMap<D> map;
  fill(map);
  Buffer<T, Host> written(static_cast<std::size_t>(view.num_pixels()) * D);
  measure(state, samples, static_cast<double>(map.features().bytes() + written.bytes()),
          [&] { composite_features<D>(samples.executor, view, map.features().data(), written.data()); });
  state.counters["sum"] = sum_of(written.data(), written.size());
}

/// All that a feature step does once the view is rendered: record and learn.
template <int D, class Optimizer>
void step(benchmark::State& state, const Sampling& sampling) {
  const Samples samples(static_cast<int>(state.range(0)), sampling);
  GaussianMap<D, Host, Optimizer> map;
  fill(map);
  std::size_t bytes = 0;
  map.for_each_feature_array([&](const auto& array) { bytes += 2 * array.bytes(); });
  const FeatureMap<D> teacher = make_teacher<D>(samples.grid.width, samples.grid.height);
  FeatureStep<D, Optimizer> feature_step;
  measure(state, samples, static_cast<double>(bytes + teacher.bytes()), [&] {
    samples.record();
    feature_step.step(samples.executor, Optimizer(), map, samples.contributions.view(), teacher);
  });
  state.counters["sum"] = sum_of(map.features().data(), static_cast<std::size_t>(map.size()) * D);
}

/// For all samplings.
void add(const std::string& stage, void (*body)(benchmark::State&, const Sampling&)) {
  for (const int k : {1, 3, 5, 10, 0})
    for (const int divisor : {1, 2}) {
      const std::string name =
          stage + "/" + (k == 0 ? "blend" : std::to_string(k)) + (divisor == 1 ? "/full" : "/quarter");
      benchmark::RegisterBenchmark(name.c_str(), body, Sampling{k, divisor})
          ->ArgName("threads")
          ->Arg(1)
          ->Arg(2)
          ->Unit(benchmark::kMillisecond)
          ->UseRealTime();
    }
}

template <int D>
void add_dimension() {
  const std::string d = "/" + std::to_string(D);
  add("streamed" + d, streamed<D>);
  add("half_image" + d, image<D, Half>);
  add("float_image" + d, image<D, float>);
  add("average" + d, step<D, FeatureAverage<>>);
  add("adam_half" + d, step<D, FeatureAdam<Half>>);
  add("adam" + d, step<D, FeatureAdam<>>);
}

}  // namespace
}  // namespace langgs::benchmarks

int main(int argc, char** argv) {
  using namespace langgs::benchmarks;
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  add("record", record);
  add_dimension<16>();
  add_dimension<64>();
  add_dimension<128>();
  add_dimension<512>();
  add_dimension<768>();
  add_dimension<1152>();
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
