// SPDX-License-Identifier: Apache-2.0
// Times registration: a frame of 8000 points to 150 000 map Gaussians in either kind of target, from poses that are 3
// cm and 2 degrees off (far) or 5 mm and 0.3 degrees (near), the grid cloud of a frame, and making and renewing a
// target. Needs no data. Counters of `align`: the error against the truth, root mean square over the starts, and the
// mean number of iterations.
#include <benchmark/benchmark.h>

#include <cstddef>
#include <vector>

#include "alignment_scene.hpp"
#include "langgs/track/gicp_tracker.hpp"
#include "langgs/track/kd_tree_target.hpp"

namespace langgs::benchmarks {
namespace {

const AlignmentScene& scene() {
  static const AlignmentScene kept = [] {
    WorkerPool pool(1);
    return make_alignment_scene(pool);
  }();
  return kept;
}

template <RegistrationTarget Target>
void align(benchmark::State& state, const StartDistance& distance) {
  const AlignmentScene& s = scene();
  const std::vector<Pose> starts = starts_around(s.T_world_camera, distance);
  WorkerPool pool(static_cast<int>(state.range(0)));
  const Target target(s.target);
  const GicpTracker tracker;
  std::size_t next = 0;
  for (auto _ : state)
    benchmark::DoNotOptimize(tracker.align(s.source, target, starts[next++ % starts.size()], pool).T_world_camera);

  MeanPoseError error;
  int iterations = 0;
  for (const Pose& start : starts) {
    const GicpResult result = tracker.align(s.source, target, start, pool);
    if (result.status != GicpStatus::converged) state.SkipWithError("a registration did not converge");
    error.add(pose_error(result.T_world_camera, s.T_world_camera));
    iterations += result.iterations;
  }
  state.counters["translation_mm"] = error.rms().translation_mm;
  state.counters["rotation_mrad"] = error.rms().rotation_mrad;
  state.counters["iterations"] = iterations / static_cast<double>(starts.size());
  state.counters["points"] = s.source.num_trackable();
}

/// Grid spacing 5, the default.
void source_cloud(benchmark::State& state) {
  const AlignmentScene& s = scene();
  WorkerPool pool(static_cast<int>(state.range(0)));
  for (auto _ : state) benchmark::DoNotOptimize(make_source_cloud(s.frame, s.camera, {}, pool).points.data());
}

template <class Target>
void make_target(benchmark::State& state) {
  for (auto _ : state) benchmark::DoNotOptimize(Target(scene().target).size());
}

/// Nothing has changed: what every renewal costs at least.
void renew_target(benchmark::State& state) {
  const GridTarget former(scene().target);
  for (auto _ : state) benchmark::DoNotOptimize(former.renewed(scene().target).size());
  const GridTarget renewed = former.renewed(scene().target);
  if (renewed.num_shared_with(former) != former.num_blocks()) state.SkipWithError("a block was not shared");
}

template <class... Arguments>
benchmark::internal::Benchmark* add(const char* name, Arguments&&... arguments) {
  return benchmark::RegisterBenchmark(name, arguments...)->Unit(benchmark::kMillisecond)->UseRealTime();
}
void on_threads(benchmark::internal::Benchmark* b) { b->ArgName("threads")->Arg(1)->Arg(2); }

}  // namespace
}  // namespace langgs::benchmarks

int main(int argc, char** argv) {
  using namespace langgs::benchmarks;
  using namespace langgs;
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  add("align/grid/far", align<GridTarget>, kFar)->Apply(on_threads);
  add("align/grid/near", align<GridTarget>, kNear)->Apply(on_threads);
  add("align/kd_tree/far", align<KdTreeTarget>, kFar)->Apply(on_threads);
  add("align/kd_tree/near", align<KdTreeTarget>, kNear)->Apply(on_threads);
  add("source_cloud", source_cloud)->Apply(on_threads);
  add("make_target/grid", make_target<GridTarget>);
  add("make_target/kd_tree", make_target<KdTreeTarget>);
  add("renew_target", renew_target);
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
