// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "langgs/eval/image_metrics.hpp"
#include "langgs/eval/trajectory.hpp"
#include "slam/small_run.hpp"

/// @file The orderings of the paper's ablation tables, on eight frames of the small room (A.19, item 15).

using namespace langgs;
using test::kDim;

namespace {

/// What a table's row reports.
struct Outcome {
  SlamStatistics statistics;
  double psnr = 0;      ///< dB, mean over the frames
  double cosine = 0;    ///< of rendered features to the features of the true labels, mean
  double accuracy = 0;  ///< of labels
  double ate_m = 0;
  double feature_ms = 0;  ///< the fastest feature step
  std::vector<float> means_x, features;
};

/// Tracks and maps without given poses, 5 mapping iterations a frame.
SlamSettings row_settings() {
  SlamSettings settings = test::small_settings();
  settings.iterations_per_frame = 5;
  return settings;
}

void score(const SyntheticRoom& room, auto& slam, Outcome& out) {
  const std::vector<RgbdFrame> frames = test::frames_of(room);
  const std::vector<float> classes = SyntheticRoom::class_vectors<kDim>();
  const std::vector<StampedPose> trajectory = slam.trajectory();
  std::vector<StampedPose> truth;
  double labels_right = 0, num_labels = 0, num_features = 0;
  for (int i = 0; i < room.size(); ++i) {
    truth.push_back({frames[i].timestamp, room.ground_truth(i)});
    const Pose& pose = trajectory[i].T_world_camera;
    Image<float> seen(room.camera().width, room.camera().height, 3);
    for (std::size_t k = 0; k < seen.size(); ++k) seen.data()[k] = static_cast<float>(frames[i].colour.data()[k]) / 255;
    out.psnr += psnr_all(slam.render(room.camera(), pose).colour, seen) / room.size();

    const Image<std::uint16_t> expected = room.labels(i), labels = slam.label_image(room.camera(), pose, classes);
    for (std::size_t k = 0; k < labels.size(); ++k) labels_right += labels.data()[k] == expected.data()[k];
    num_labels += static_cast<double>(labels.size());

    const int w = seen.width() / 2, h = seen.height() / 2;
    const std::vector<float> rendered = slam.feature_image(room.camera(), pose, w, h);
    using Feature = Eigen::Map<const Eigen::Vector<float, kDim>>;
    for (int v = 0; v < h; ++v)
      for (int u = 0; u < w; ++u, ++num_features) {
        const Feature is(&rendered[static_cast<std::size_t>(v * w + u) * kDim]);
        const Feature should(&classes[static_cast<std::size_t>(expected(2 * u, 2 * v)) * kDim]);
        out.cosine += is.normalized().dot(should.normalized());
      }
  }
  out.accuracy = labels_right / num_labels;
  out.cosine /= num_features;
  out.ate_m = ate_umeyama_se3(trajectory, truth).rmse_m;
}

/// One row: Slam with the settings, its schedule and pruning changed by `change`.
template <class Slam, class Change>
Outcome row(const char* name, const SlamSettings& settings, Change&& change) {
  const SyntheticRoom room = test::small_room(8);
  std::vector<RgbdFrame> frames = test::frames_of(room);
  for (RgbdFrame& frame : frames) frame.T_world_camera.reset();
  Slam slam(room.camera(), settings);
  slam.keyframe_policy = test::often();
  change(slam);
  LabelFeatures<kDim> features = test::label_features(room);
  test::run(slam, frames, features);

  Outcome out;
  const SlamStatistics& s = out.statistics = slam.statistics();
  score(room, slam, out);
  if (!s.feature_ms.empty()) out.feature_ms = *std::min_element(s.feature_ms.begin(), s.feature_ms.end());
  const float* x = slam.map().geometry().plane(kMeanX);
  out.means_x.assign(x, x + s.gaussians);
  for (int i = 0; i < s.gaussians * kDim; ++i)
    out.features.push_back(static_cast<float>(slam.map().features().data()[i]));
  MESSAGE(std::string(name), ": ", s.gaussians, " Gaussians, ", out.psnr, " dB, cosine ", out.cosine, ", accuracy ",
          out.accuracy, ", ATE ", 1000 * out.ate_m, " mm, feature step ", out.feature_ms, " ms");

  CHECK(s.lost_frames == 0);
  CHECK(test::all_finite(slam));
  // What was kept is whose it was: every uid once, ascending.
  const std::uint32_t* uid = slam.map().statistics.uid.data();
  CHECK(std::is_sorted(uid, uid + s.gaussians));
  CHECK(std::adjacent_find(uid, uid + s.gaussians) == uid + s.gaussians);
  return out;
}

template <class Slam>
Outcome row(const char* name, const SlamSettings& settings = row_settings()) {
  return row<Slam>(name, settings, [](Slam&) {});
}

/// Redundancy control, no pruning, Top-3, the hybrid schedule: the row that the others are compared with.
const Outcome& top3() {
  static const Outcome outcome = row<LangGsSlam<kDim, 3, NoPruning>>("Top-3");
  return outcome;
}

}  // namespace

TEST_CASE("map management: either policy thins the map, both together most, at the same quality") {
  // Paper, Replica: 912 595 Gaussians without, 281 927 with redundancy control, 215 857 with both; 36.30 dB become
  // 35.94 dB by the second step.
  const auto prune = [](LangGsSlam<kDim>& slam) {
    slam.pruning.consistency_period = 15;
    slam.pruning.backbone_period = 0;
  };
  SlamSettings unfiltered = row_settings();
  unfiltered.mapping.redundancy.squared_distance = 0;
  const Outcome none = row<LangGsSlam<kDim, 3, NoPruning>>("no management", unfiltered);
  const Outcome pruned = row<LangGsSlam<kDim>>("pruning", unfiltered, prune);
  const Outcome both = row<LangGsSlam<kDim>>("redundancy control and pruning", row_settings(), prune);
  const Outcome& filtered = top3();

  CHECK(filtered.statistics.gaussians < 0.8 * none.statistics.gaussians);
  CHECK(pruned.statistics.gaussians < none.statistics.gaussians);
  CHECK(both.statistics.gaussians < 0.9 * filtered.statistics.gaussians);
  CHECK(both.statistics.gaussians < 0.9 * pruned.statistics.gaussians);
  for (const Outcome* outcome : {&filtered, &pruned, &both}) {
    CHECK(outcome->psnr > none.psnr - 0.4);
    CHECK(outcome->cosine > none.cosine - 0.01);
    CHECK(outcome->ate_m < none.ate_m + 0.001);
  }
  // Who is counted where.
  CHECK(none.statistics.suppressed == 0);
  CHECK(none.statistics.gaussians == 40 * 30 * none.statistics.keyframes);  // every grid point of every keyframe
  CHECK(filtered.statistics.suppressed > 0);
  CHECK(filtered.statistics.pruned == 0);
  CHECK(filtered.statistics.gaussians == filtered.statistics.inserted);
  for (const Outcome* outcome : {&pruned, &both}) {
    CHECK(outcome->statistics.pruned > 0);
    CHECK(outcome->statistics.gaussians == outcome->statistics.inserted - outcome->statistics.pruned);
  }
}

TEST_CASE("Top-K: speed falls with K, three Gaussians describe a ray best") {
  // Paper, Replica: accuracy .882, .886, .885, .883 at K = 1, 3, 5, 10 and .874 for full blending, at 135, 122, 103, 90
  // and 7 frames per second.
  SlamSettings blending = row_settings();
  blending.mapping.feature_rendering = FeatureRendering::blend;
  const Outcome top1 = row<LangGsSlam<kDim, 1, NoPruning>>("Top-1"),
                top5 = row<LangGsSlam<kDim, 5, NoPruning>>("Top-5");
  const Outcome top10 = row<LangGsSlam<kDim, 10, NoPruning>>("Top-10");
  const Outcome blend = row<LangGsSlam<kDim, 3, NoPruning>>("full blending", blending);

  // Neighbouring K differ by less than a busy machine's noise. Here a ray meets about as many Gaussians as K = 10
  // keeps, so that blending them all costs a few times as much, not the paper's thirteen times.
  CHECK(top1.feature_ms < top10.feature_ms);
  CHECK(2 * top10.feature_ms < blend.feature_ms);

  // The paper's order: one is worst of all in accuracy, three are best, and more mix objects at their borders.
  for (const Outcome* outcome : {&top3(), &top5, &top10, &blend}) CHECK(top1.accuracy < outcome->accuracy);
  for (const Outcome* outcome : {&top10, &blend}) CHECK(outcome->accuracy < top3().accuracy);
  CHECK(top1.cosine < top3().cosine);
  CHECK(top5.cosine < top3().cosine);
  CHECK(top10.cosine < top5.cosine);
  CHECK(blend.cosine < top5.cosine);

  // The paper's fall of PSNR with K (34.94 to 32.24 dB) is time lost as well: the fields are decoupled, so that
  // geometry is the same to the bit.
  for (const Outcome* outcome : {&top1, &top5, &top10, &blend}) {
    CHECK(outcome->statistics.feature_iterations == top3().statistics.feature_iterations);
    CHECK(outcome->means_x == top3().means_x);
    CHECK(outcome->psnr == top3().psnr);
    CHECK(outcome->features != top3().features);
  }
}

TEST_CASE("hybrid schedule: better images than joint steps in the same time, features as good") {
  // Paper: +1.44 dB on Replica, +1.65 dB on TUM at a fixed time, accuracy .886 to .883. Here time is counted: a
  // feature step of the paper's optimiser at 512 dimensions takes about half of a geometry step.
  const auto time = [](const Outcome& o) {
    return o.statistics.geometry_iterations + 0.5 * o.statistics.feature_iterations;
  };
  const Outcome joint = row<LangGsSlam<kDim, 3, NoPruning, JointSchedule>>("joint");
  SlamSettings longer = row_settings();
  longer.iterations_per_frame = 6;
  const Outcome hybrid = row<LangGsSlam<kDim, 3, NoPruning, HybridSchedule>>("hybrid, 6 a frame", longer);
  CHECK(time(hybrid) <= time(joint));
  CHECK(hybrid.psnr > joint.psnr + 0.2);
  CHECK(hybrid.accuracy > joint.accuracy - 0.01);
  CHECK(hybrid.cosine > joint.cosine - 0.01);

  // At the same number of geometry steps, joint and hybrid differ in features alone, and more steps fit them better.
  CHECK(joint.psnr == top3().psnr);
  CHECK(joint.cosine > top3().cosine);
  CHECK(joint.statistics.feature_iterations > 2 * top3().statistics.feature_iterations);
}
