// SPDX-License-Identifier: Apache-2.0
// How the system's features are stored, learnt, compared with their teachers, and bounded in memory.
#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <vector>

#include "langgs/optimize/feature_adam.hpp"
#include "langgs/optimize/field_coupling.hpp"
#include "slam/small_run.hpp"

using namespace langgs;
using test::kDim;

namespace {

constexpr int kFrames = 12;

template <class Optimizer, class Coupling = DecoupledFields>
using Slam = LangGsSlam<kDim, 3, PruningPolicy, HybridSchedule, Optimizer, Coupling>;

template <class System>
void map_small_room(System& slam) {
  const SyntheticRoom room = test::small_room(kFrames);
  LabelFeatures<kDim> features = test::label_features(room);
  slam.keyframe_policy = test::often();
  test::run(slam, test::frames_of(room), features);
}

std::vector<float> means_of(const auto& slam) {
  const float* x = slam.map().geometry().plane(kMeanX);
  return std::vector<float>(x, x + slam.map().size());
}

}  // namespace

TEST_CASE("geometry does not depend on how features learn or are stored") {
  const SyntheticRoom room = test::small_room(kFrames);
  Slam<FeatureAverage<>> halves(room.camera(), test::small_settings());
  Slam<FeatureAverage<float>> floats(room.camera(), test::small_settings());
  Slam<FeatureAdam<>> adam(room.camera(), test::small_settings());
  map_small_room(halves);
  map_small_room(floats);
  map_small_room(adam);
  CHECK(means_of(floats) == means_of(halves));
  CHECK(means_of(adam) == means_of(halves));
  // Half precision costs nothing that shows.
  CHECK(std::abs(halves.teacher_cosine().mean() - floats.teacher_cosine().mean()) < 1e-4);
  CHECK(halves.teacher_cosine().mean() > 0.97);
  CHECK(halves.teacher_cosine().mean() > adam.teacher_cosine().mean() - 0.002);
}

TEST_CASE("coupled fields let the feature loss move geometry") {
  const SyntheticRoom room = test::small_room(kFrames);
  Slam<FeatureAdam<>> apart(room.camera(), test::small_settings());
  Slam<FeatureAdam<>, CoupledFields> silent(room.camera(), test::small_settings());
  Slam<FeatureAdam<>, CoupledFields> coupled(room.camera(), test::small_settings());
  silent.coupling.weight = 0;
  map_small_room(apart);
  map_small_room(silent);
  map_small_room(coupled);
  CHECK(means_of(coupled) != means_of(apart));
  CHECK(silent.map().size() == apart.map().size());
  CHECK(test::all_finite(coupled));
  CHECK(coupled.teacher_cosine().mean() > 0.95);
}

TEST_CASE("the teacher cosine is that of the rendered feature images") {
  const SyntheticRoom room = test::small_room(kFrames);
  Slam<FeatureAverage<>> slam(room.camera(), test::small_settings());
  map_small_room(slam);
  double sum = 0;
  int pixels = 0;
  for (const Keyframe<kDim>& k : slam.keyframes()) {
    const FeatureMap<kDim>& teacher = k.features;
    const std::vector<float> image =
        slam.feature_image(room.camera(), k.T_world_camera, teacher.width(), teacher.height());
    for (int p = 0; p < teacher.width() * teacher.height(); ++p) {
      double product = 0, own = 0, other = 0;
      for (int c = 0; c < kDim; ++c) {
        const double f = image[static_cast<std::size_t>(p) * kDim + c],
                     t = static_cast<float>(teacher.pixel(0, 0)[p * kDim + c]);
        product += f * t;
        own += f * f;
        other += t * t;
      }
      if (own == 0 || other == 0) continue;
      sum += product / std::sqrt(own * other);
      ++pixels;
    }
  }
  const TeacherCosine cosine = slam.teacher_cosine();
  CHECK(cosine.pixels == pixels);
  CHECK(cosine.mean() == doctest::Approx(sum / pixels).epsilon(1e-5));
}

TEST_CASE("keyframes stay within their budget, and the map keeps what they taught") {
  const SyntheticRoom room = test::small_room(kFrames);
  SlamSettings settings = test::small_settings();
  Slam<FeatureAverage<>> whole(room.camera(), settings);
  map_small_room(whole);
  const auto part = [](const auto& slam, const std::string& name) {
    for (const auto& [of, bytes] : slam.memory_report())
      if (of == name) return bytes;
    FAIL("no part ", name);
    return std::size_t{0};
  };
  const std::size_t needed = part(whole, "keyframe_features") + part(whole, "keyframe_images");
  settings.mapping.keyframe_bytes = needed / 2;
  Slam<FeatureAverage<>> bounded(room.camera(), settings);
  map_small_room(bounded);
  REQUIRE(bounded.keyframes().size() == whole.keyframes().size());
  CHECK(part(bounded, "keyframe_features") + part(bounded, "keyframe_images") <= needed / 2);
  CHECK(!bounded.keyframes().back().features.empty());
  CHECK(bounded.statistics().geometry_iterations == whole.statistics().geometry_iterations);
  CHECK(test::all_finite(bounded));

  // Judged by the teachers that the other run has kept.
  const std::vector<float> classes = SyntheticRoom::class_vectors<kDim>();
  int equal = 0, all = 0;
  for (const Keyframe<kDim>& k : whole.keyframes()) {
    const auto a = whole.label_image(room.camera(), k.T_world_camera, classes);
    const auto b = bounded.label_image(room.camera(), k.T_world_camera, classes);
    for (std::size_t i = 0; i < a.size(); ++i, ++all) equal += a.data()[i] == b.data()[i] ? 1 : 0;
  }
  CHECK(equal > 0.9 * all);
}

TEST_CASE("memory stops growing once the room is covered") {
  const SyntheticRoom room = test::small_room(kFrames);
  SlamSettings settings = test::small_settings();
  settings.mapping.keyframe_bytes = 200'000;
  Slam<FeatureAverage<>> slam(room.camera(), settings);
  slam.keyframe_policy = test::often();
  LabelFeatures<kDim> features = test::label_features(room);
  features.labels_of = [&](const RgbdFrame&) { return room.labels(0); };  // of no matter here
  std::vector<std::size_t> held;
  for (int lap = 0; lap < 5; ++lap) {
    for (RgbdFrame frame : test::frames_of(room)) {
      frame.timestamp += lap;
      slam.process(frame, features);
    }
    std::size_t bytes = 0;
    for (const auto& [part, of_part] : slam.memory_report()) bytes += of_part;
    held.push_back(bytes);
  }
  CHECK(slam.statistics().keyframes > 12);
  CHECK(slam.statistics().lost_frames == 0);
  CHECK(100 * held[4] < 102 * held[2]);
}
