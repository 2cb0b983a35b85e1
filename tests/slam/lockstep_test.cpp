// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <set>
#include <vector>

#include "langgs/eval/image_metrics.hpp"
#include "langgs/eval/trajectory.hpp"
#include "slam/small_run.hpp"

using namespace langgs;
using test::kDim;

namespace {

Image<float> unit_image(const Image<std::uint8_t>& image) {
  Image<float> result(image.width(), image.height(), image.channels());
  for (std::size_t i = 0; i < image.size(); ++i) result.data()[i] = static_cast<float>(image.data()[i]) / 255.f;
  return result;
}

std::vector<StampedPose> truth(const SyntheticRoom& room) {
  std::vector<StampedPose> poses;
  for (int i = 0; i < room.size(); ++i) poses.push_back({i / room.settings().frames_per_second, room.ground_truth(i)});
  return poses;
}

std::vector<RgbdFrame> without_poses(std::vector<RgbdFrame> frames) {
  for (RgbdFrame& frame : frames) frame.T_world_camera.reset();
  return frames;
}

}  // namespace

TEST_CASE("a small room is tracked, rendered and labelled") {
  const SyntheticRoom room = test::small_room(14);
  SlamSettings settings = test::small_settings();
  settings.iterations_per_frame = 8;
  LangGsSlam<kDim> slam(room.camera(), settings);
  slam.keyframe_policy = test::often();
  auto features = test::label_features(room);
  const std::vector<FrameReport> reports = test::run(slam, without_poses(test::frames_of(room)), features);

  const SlamStatistics s = slam.statistics();
  CHECK(s.frames == 14);
  CHECK(s.lost_frames == 0);
  CHECK(s.skipped_frames == 0);
  CHECK(s.keyframes == static_cast<int>(slam.keyframes().size()));
  CHECK(s.keyframes >= 3);
  CHECK(s.geometry_iterations == 14 * 8);
  CHECK(s.inserted == s.gaussians + s.pruned);
  CHECK(s.track_ms.size() == 14);
  CHECK(reports[0].keyframe == KeyframeKind::tracking);
  CHECK(reports[0].T_world_camera.matrix() == Pose::Identity().matrix());
  CHECK(reports.back().keyframe == KeyframeKind::tracking);
  CHECK(reports.back().num_gaussians == slam.map().size());
  CHECK(reports.back().loss < reports[0].loss);
  CHECK(test::all_finite(slam));

  const AteResult ate = ate_umeyama_se3(slam.trajectory(), truth(room));
  MESSAGE("ATE rmse ", 1000 * ate.rmse_m, " mm");
  CHECK(ate.matched == 14);
  CHECK(ate.rmse_m < 0.004);

  double psnr = 0, equal = 0, total = 0;
  for (const auto& keyframe : slam.keyframes()) {
    const RenderedImages images = slam.render(room.camera(), keyframe.T_world_camera);
    psnr += psnr_all(images.colour, unit_image(keyframe.colour)) / static_cast<double>(slam.keyframes().size());
    const Image<std::uint16_t> labels =
        slam.label_image(room.camera(), keyframe.T_world_camera, SyntheticRoom::class_vectors<kDim>());
    const Image<std::uint16_t> expected = room.labels(keyframe.frame_index);
    for (std::size_t i = 0; i < labels.size(); ++i) equal += labels.data()[i] == expected.data()[i];
    total += static_cast<double>(labels.size());
  }
  MESSAGE("PSNR ", psnr, " dB, labels ", equal / total);
  CHECK(psnr > 20);
  CHECK(equal / total > 0.85);
}

TEST_CASE("the same frames give the same bits for any number of threads and again") {
  const SyntheticRoom room = test::small_room(9);
  const std::vector<RgbdFrame> frames = test::frames_of(room);
  const auto bytes = [&](int threads) {
    SlamSettings settings = test::small_settings();
    settings.num_threads = threads;
    settings.iterations_per_frame = 4;
    settings.final_iterations = 3;
    LangGsSlam<kDim> slam(room.camera(), settings);
    slam.keyframe_policy = test::often();
    slam.pruning.backbone_period = 10;
    slam.pruning.consistency_period = 15;
    auto features = test::label_features(room);
    test::run(slam, frames, features);
    CHECK(slam.statistics().pruned > 0);
    CHECK(slam.statistics().geometry_iterations == 39);
    return test::bytes_of(slam);
  };
  const test::Bytes first = bytes(1);
  REQUIRE(first.parts[0].size() > 1000 * sizeof(float));
  CHECK(bytes(1) == first);
  CHECK(bytes(2) == first);
  CHECK(bytes(3) == first);
}

TEST_CASE("a tracked run reads no given pose") {
  const SyntheticRoom room = test::small_room(6);
  std::vector<RgbdFrame> frames = test::frames_of(room);
  std::vector<test::Bytes> results;
  for (int variant = 0; variant < 3; ++variant) {
    for (std::size_t i = 0; i < frames.size(); ++i) {
      if (variant == 1) frames[i].T_world_camera.reset();
      if (variant == 2) {
        frames[i].T_world_camera = Pose::Identity();
        frames[i].T_world_camera->translation() << 5, static_cast<double>(i), std::nan("");
      }
    }
    LangGsSlam<kDim> slam(room.camera(), test::small_settings());
    auto features = test::label_features(room);
    test::run(slam, frames, features);
    results.push_back(test::bytes_of(slam));
  }
  CHECK(results[1] == results[0]);
  CHECK(results[2] == results[0]);
}

TEST_CASE("given poses are kept as they are") {
  const SyntheticRoom room = test::small_room(6);
  SlamSettings settings = test::small_settings();
  settings.tracking.poses = PoseSource::given;
  LangGsSlam<kDim> slam(room.camera(), settings);
  slam.keyframe_policy = test::often();
  auto features = test::label_features(room);
  test::run(slam, test::frames_of(room), features);
  const std::vector<StampedPose> poses = slam.trajectory();
  REQUIRE(poses.size() == 6);
  for (int i = 0; i < 6; ++i) CHECK(poses[i].T_world_camera.isApprox(room.ground_truth(i), 1e-12));
  CHECK(slam.keyframes().size() >= 2);
}

TEST_CASE("held-out frames are tracked and never mapped") {
  const SyntheticRoom room = test::small_room(10);
  LangGsSlam<kDim> slam(room.camera(), test::small_settings());
  KeyframeSettings every;
  every.overlap_threshold = 1;  // every frame would become a keyframe
  slam.keyframe_policy = KeyframePolicy(every);
  auto features = test::label_features(room);
  const std::vector<FrameReport> reports = test::run(slam, test::frames_of(room), features, 3);
  CHECK(slam.keyframes().size() >= 4);
  for (const auto& keyframe : slam.keyframes()) CHECK((keyframe.frame_index == 0 || keyframe.frame_index % 3 != 0));
  for (int i = 3; i < 10; i += 3) {
    CHECK(reports[i].keyframe == KeyframeKind::none);
    CHECK_FALSE(reports[i].skipped);
    CHECK((reports[i].T_world_camera.translation() - room.ground_truth(i).translation()).norm() < 0.01);
  }
}

TEST_CASE("a first frame that is held out does not pretend to a pose") {
  const SyntheticRoom room = test::small_room(5);
  const std::vector<RgbdFrame> frames = test::frames_of(room);
  LangGsSlam<kDim> slam(room.camera(), test::small_settings());
  auto features = test::label_features(room);
  const FrameReport report = slam.process(frames[0], features, {false, true});
  CHECK(report.skipped);
  CHECK_FALSE(report.reason.empty());
  for (int i = 1; i < 5; ++i) slam.process(frames[i], features);
  CHECK(slam.keyframes().front().frame_index == 1);
  CHECK(slam.statistics().skipped_frames == 1);
}

TEST_CASE("in the refined trajectory frames move with the keyframe before them; the other is as tracked") {
  const SyntheticRoom room = test::small_room(8);
  SlamSettings settings = test::small_settings();
  settings.iterations_per_frame = 12;
  LangGsSlam<kDim> slam(room.camera(), settings);
  slam.keyframe_policy = test::often();
  auto features = test::label_features(room);
  const std::vector<FrameReport> reports = test::run(slam, test::frames_of(room), features);
  const std::vector<StampedPose> poses = slam.refined_trajectory();
  bool refined = false;
  std::size_t k = 0;
  for (int i = 0; i < 8; ++i) {
    while (k + 1 < slam.keyframes().size() && slam.keyframes()[k + 1].frame_index <= i) ++k;
    const auto& reference = slam.keyframes()[k];
    const Pose expected =
        reference.T_world_camera * reference.T_world_camera_tracked.inverse() * reports[i].T_world_camera;
    CHECK(poses[i].T_world_camera.isApprox(expected, 1e-9));
    CHECK(slam.trajectory()[i].T_world_camera.isApprox(reports[i].T_world_camera, 1e-12));
    refined = refined || !poses[i].T_world_camera.isApprox(reports[i].T_world_camera, 1e-9);
  }
  CHECK(refined);
  CHECK(poses[0].T_world_camera.isApprox(Pose::Identity()));
}

TEST_CASE("a mapping keyframe leaves the registration target as it is") {
  const SyntheticRoom room = test::small_room(8);
  SlamSettings settings = test::small_settings();
  settings.iterations_per_frame = 0;
  std::vector<std::vector<FrameReport>> runs;
  for (const int interval : {0, 2}) {
    LangGsSlam<kDim> slam(room.camera(), settings);
    KeyframeSettings keyframes;
    keyframes.overlap_threshold = 0;
    keyframes.mapping_interval = interval;
    slam.keyframe_policy = KeyframePolicy(keyframes);
    auto features = test::label_features(room);
    runs.push_back(test::run(slam, test::frames_of(room), features));
    CHECK(slam.keyframes().size() == (interval == 0 ? 2 : 5));
  }
  for (int i = 0; i < 8; ++i) CHECK(runs[0][i].T_world_camera.matrix() == runs[1][i].T_world_camera.matrix());
  CHECK(runs[1][2].keyframe == KeyframeKind::mapping);
  CHECK(runs[1][2].num_gaussians > runs[0][2].num_gaussians);
}

TEST_CASE("prompts need not be unit vectors, but finite and of the map's dimension") {
  const SyntheticRoom room = test::small_room(4);
  LangGsSlam<kDim> slam(room.camera(), test::small_settings());
  auto features = test::label_features(room);
  test::run(slam, test::frames_of(room), features);
  const std::vector<float> vectors = SyntheticRoom::class_vectors<kDim>();
  const Image<std::uint16_t> labels = slam.label_image(room.camera(), Pose::Identity(), vectors);
  std::vector<float> scaled = vectors;
  for (std::size_t i = 0; i < scaled.size(); ++i) scaled[i] *= static_cast<float>(1 + i / kDim % 7);  // by row
  const Image<std::uint16_t> same = slam.label_image(room.camera(), Pose::Identity(), scaled);
  int different = 0;
  for (std::size_t i = 0; i < labels.size(); ++i) different += labels.data()[i] != same.data()[i];
  CHECK(different <= 2);  // ties within rounding

  scaled[kDim] = std::nanf("");
  CHECK_THROWS_AS(static_cast<void>(slam.label_image(room.camera(), Pose::Identity(), scaled)), InvalidArgument);
  CHECK_THROWS_AS(static_cast<void>(slam.label_image(room.camera(), Pose::Identity(), {1.f, 2.f})), InvalidArgument);
  CHECK_THROWS_AS(static_cast<void>(slam.feature_image(room.camera(), Pose::Identity(), 0, 4)), InvalidArgument);
  CHECK_THROWS_AS(static_cast<void>(slam.feature_image(room.camera(), Pose::Identity(), 4, -4)), InvalidArgument);
  CHECK(slam.feature_image(room.camera(), Pose::Identity(), 5, 3).size() == 5 * 3 * kDim);
}
