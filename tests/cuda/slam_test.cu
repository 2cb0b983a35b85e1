// SPDX-License-Identifier: Apache-2.0
// A whole run on CUDA against the same run on the host. Exponentials differ in their last bits, and a run carries that
// on: the two end up near each other, not equal.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <memory>
#include <utility>
#include <vector>

#include "cuda/counted_memory.hpp"
#include "cuda/slam_run.hpp"
#include "langgs/optimize/feature_adam.hpp"

namespace langgs {
namespace {

using test::SlamRun;

TEST_CASE("A run on CUDA is that of the host, and itself again bit for bit") {
  const SlamRun host = test::slam_run_on_host(), run = test::slam_run<Cuda>();
  CHECK(run.keyframes == host.keyframes);
  CHECK(host.pruned > 0);
  CHECK(std::abs(run.pruned - host.pruned) <= host.gaussians / 50);
  CHECK(std::abs(run.gaussians - host.gaussians) <= host.gaussians / 50);
  REQUIRE(run.trajectory.size() == host.trajectory.size());
  double farthest = 0;
  for (std::size_t i = 0; i < run.trajectory.size(); ++i)
    farthest = std::max(
        farthest,
        (run.trajectory[i].T_world_camera.translation() - host.trajectory[i].T_world_camera.translation()).norm());
  CHECK(farthest < 1e-3);
  CHECK(std::abs(run.psnr - host.psnr) < 0.1);
  CHECK(std::abs(run.cosine - host.cosine) < 0.002);
  CHECK(run.loss == doctest::Approx(host.loss).epsilon(0.01));
  REQUIRE(run.features.size() == host.features.size());
  double difference = 0;
  for (std::size_t i = 0; i < run.features.size(); ++i)
    difference += static_cast<double>(std::abs(run.features[i] - host.features[i]));
  CHECK(difference / static_cast<double>(run.features.size()) < 0.002);
  REQUIRE(run.labels.size() == host.labels.size());
  std::size_t other_labels = 0;
  for (std::size_t i = 0; i < run.labels.size(); ++i) other_labels += run.labels[i] != host.labels[i] ? 1 : 0;
  CHECK(other_labels < run.labels.size() / 100);
  MESSAGE("Gaussians ", run.gaussians, " / ", host.gaussians, ", pruned ", run.pruned, " / ", host.pruned,
          ", farthest ", farthest, " m, PSNR ", run.psnr, " / ", host.psnr, ", cosine ", run.cosine, " / ", host.cosine,
          ", loss ", run.loss, " / ", host.loss, ", features ", difference / static_cast<double>(run.features.size()),
          ", labels ", other_labels);
  CHECK(test::slam_run<Cuda>().bytes == run.bytes);
}

template <int K, class Optimizer, class Coupling>
using CudaSlam = LangGsSlam<test::kDim, K, PruningPolicy, HybridSchedule, Optimizer, Coupling, Cuda>;
using Decoupled = CudaSlam<3, FeatureAverage<>, DecoupledFields>;
using Coupled = CudaSlam<2, FeatureAdam<>, CoupledFields>;

TEST_CASE_TEMPLATE("A run on CUDA neither waits nor takes memory between the iterations on keyframes that it knows",
                   Slam, Decoupled, Coupled) {
  const SyntheticRoom room = test::small_room(3);
  SlamSettings settings = test::small_settings();
  settings.final_iterations = 8;
  settings.mapping.pose_refinement.start_after_visits = 0;
  const auto memory = std::make_shared<test::CountedMemory>();
  const Executor<Cuda> executor(gpu::Stream(), memory);
  Slam slam(room.camera(), settings, executor);
  slam.pruning.backbone_period = slam.pruning.consistency_period = 0;
  slam.schedule.feature_every = 2;
  slam.keyframe_policy = test::often();
  auto features = test::label_features(room);
  (void)test::run(slam, test::frames_of(room), features);
  REQUIRE(slam.keyframes().size() >= 2);
  const SlamStatistics then = slam.statistics();
  const int allocations = memory->allocations, waits = executor.num_waits();
  const Pose before = slam.keyframes().back().T_world_camera;
  slam.finish();
  CHECK(executor.num_waits() == waits);
  CHECK(memory->allocations == allocations);
  CHECK(slam.statistics().geometry_iterations == then.geometry_iterations + settings.final_iterations);
  CHECK(slam.statistics().feature_iterations == then.feature_iterations + settings.final_iterations / 2);
  CHECK(slam.keyframes().back().T_world_camera.matrix() != before.matrix());  // poses are refined nevertheless
}

TEST_CASE("A run on CUDA does an iteration without room for its lists again, and its features once") {
  const SyntheticRoom room = test::small_room(3);
  SlamSettings settings = test::small_settings();
  settings.iterations_per_frame = 1;  // no list has room before the first
  Decoupled slam(room.camera(), settings);
  auto features = test::label_features(room);
  (void)slam.process(test::frames_of(room).front(), features, {.is_last = true});
  slam.finish();
  REQUIRE(slam.statistics().feature_iterations == 1);
  const auto map = slam.map().on_host(slam.executor());
  double pixels = 0;  // what features know beyond their prior: the weights of each taught pixel sum to one
  for (int i = 0; i < map.size(); ++i) {
    const float confidence = map.feature_state.confidence.data()[i];
    if (confidence > 0) pixels += static_cast<double>(confidence - slam.feature_optimizer.prior);
  }
  const double all = 40 * 30;
  CHECK(pixels > 0.9 * all);
  CHECK(pixels < 1.001 * all);
}

TEST_CASE("A run on CUDA may have mapping in a thread of its own") {
  const SyntheticRoom room = test::small_room(3);
  Coupled slam(room.camera(), test::small_settings());
  slam.keyframe_policy = test::often();
  auto features = test::label_features(room);
  const std::vector<RgbdFrame> frames = test::frames_of(room);
  struct Source {
    Camera intrinsics;
    const std::vector<RgbdFrame>& frames;
    std::size_t index = 0;
    [[nodiscard]] const Camera& camera() const { return intrinsics; }
    bool next(RgbdFrame& frame) {
      if (index < frames.size()) frame = frames[index];
      return index++ < frames.size();
    }
  } source{room.camera(), frames};
  slam.run_realtime(source, features, [](const FrameReport&) { return true; });
  CHECK(slam.statistics().frames == 3);
  CHECK(slam.statistics().lost_frames == 0);
  CHECK(slam.statistics().feature_iterations > 0);
  CHECK(slam.map().size() > 500);
  CHECK(std::isfinite(slam.teacher_cosine().mean()));
}

}  // namespace
}  // namespace langgs
