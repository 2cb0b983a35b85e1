// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "slam/small_run.hpp"

using namespace langgs;
using test::kDim;

namespace {

struct Scene {
  SyntheticRoom room = test::small_room(8);
  std::vector<RgbdFrame> frames = test::frames_of(room);
  LabelFeatures<kDim> features = test::label_features(room);
};

const Scene& scene() {
  static const Scene instance;
  return instance;
}

template <class Slam>
SlamStatistics run(Slam& slam) {
  slam.keyframe_policy = test::often();
  LabelFeatures<Slam::Map::kFeatDim> features = test::label_features<Slam::Map::kFeatDim>(scene().room);
  test::run(slam, scene().frames, features);
  CHECK(test::all_finite(slam));
  return slam.statistics();
}

/// A user's own policies, written against the public concepts.
struct OldGoFirst {
  int* calls;
  [[nodiscard]] bool due(std::int64_t iteration) const { return iteration == 10; }
  PruningReport select(std::int64_t, const PruningStatistics& s, std::vector<std::int32_t>& keep) const {
    ++*calls;
    keep.assign(s.size, 1);
    std::fill_n(keep.begin(), 100, 0);
    PruningReport report;
    report.num_inconsistent = report.num_candidates = 100;
    return report;
  }
};
struct FeaturesAtTheEnd {
  int* calls;
  [[nodiscard]] OptimizationStep operator()(const MappingVisit& visit) const {
    ++*calls;
    return {visit.iteration < 20, visit.iteration >= 20};
  }
};

}  // namespace

TEST_CASE("the schedule says how often features are stepped") {
  SlamSettings settings = test::small_settings();  // 8 frames of 3 iterations
  LangGsSlam<kDim, 3, NoPruning, JointSchedule> joint(scene().room.camera(), settings);
  LangGsSlam<kDim, 3, NoPruning, HybridSchedule> hybrid(scene().room.camera(), settings);
  LangGsSlam<kDim, 3, NoPruning, GeometrySchedule> geometry(scene().room.camera(), settings);
  hybrid.schedule.features_at_first_visit = false;
  const SlamStatistics j = run(joint), h = run(hybrid), g = run(geometry);
  for (const SlamStatistics& s : {j, h, g}) CHECK(s.geometry_iterations == 24);
  CHECK(j.feature_iterations == 24);
  CHECK(h.feature_iterations == 6);
  CHECK(g.feature_iterations == 0);

  LangGsSlam<kDim, 3, NoPruning, HybridSchedule> eager(scene().room.camera(), settings);
  eager.schedule.feature_every = 1000;
  const SlamStatistics e = run(eager);
  CHECK(e.feature_iterations == e.keyframes);  // each at its first visit; iteration 0 is one
}

TEST_CASE("a user's own pruning and schedule are called") {
  int pruned = 0, scheduled = 0;
  LangGsSlam<kDim, 2, OldGoFirst, FeaturesAtTheEnd> slam{scene().room.camera(), test::small_settings()};
  slam.pruning.calls = &pruned;
  slam.schedule.calls = &scheduled;
  const SlamStatistics s = run(slam);
  CHECK(pruned == 1);
  CHECK(s.pruned == 100);
  CHECK(scheduled == 24);
  CHECK(s.geometry_iterations == 20);
  CHECK(s.feature_iterations == 4);
  CHECK(slam.map().statistics.uid.data()[0] == 100);
}

TEST_CASE("another K and another feature dimension make another system") {
  LangGsSlam<96, 5> slam(scene().room.camera(), test::small_settings());
  CHECK(run(slam).feature_iterations > 0);
  const auto labels = slam.label_image(scene().room.camera(), Pose::Identity(), SyntheticRoom::class_vectors<96>());
  CHECK(std::any_of(labels.data(), labels.data() + labels.size(), [](std::uint16_t l) { return l > 0; }));
}

TEST_CASE("without pose refinement keyframes stay where they were tracked") {
  SlamSettings settings = test::small_settings();
  settings.iterations_per_frame = 10;
  settings.mapping.refine_poses = false;
  LangGsSlam<kDim> slam(scene().room.camera(), settings);
  run(slam);
  for (const auto& keyframe : slam.keyframes())
    CHECK(keyframe.T_world_camera.matrix() == keyframe.T_world_camera_tracked.matrix());
}

TEST_CASE("a map without features learns none") {
  LangGsSlam<1> slam(scene().room.camera(), test::small_settings());
  NoFeatures features;
  test::run(slam, scene().frames, features);
  CHECK(slam.statistics().feature_iterations == 0);
  CHECK(slam.statistics().geometry_iterations == 24);
}
