// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "langgs/eval/image_metrics.hpp"
#include "slam/small_run.hpp"

/// @file The same small run on any backend. host_slam.cpp is compiled by the host's compiler, slam_test.cu by nvcc;
/// only values cross.

namespace langgs::test {

/// What a run left behind.
struct SlamRun {
  int keyframes = 0, gaussians = 0, pruned = 0;
  std::vector<StampedPose> trajectory;
  double psnr = 0;                    ///< of the last frame [dB]
  double cosine = 0;                  ///< of rendered features to their teachers, over all keyframes
  double loss = 0;                    ///< geometric, of the last iteration
  std::vector<float> features;        ///< of the last view [15, 20, kDim]
  std::vector<std::uint16_t> labels;  ///< of the last view [60, 80]
  Bytes bytes;
};

/// Tracks and maps the small room, prunes it, and looks at it in every way that there is.
template <class Backend>
[[nodiscard]] SlamRun slam_run() {
  const SyntheticRoom room = small_room(8);
  SlamSettings settings = small_settings();
  settings.iterations_per_frame = 2;
  LangGsSlam<kDim, 3, PruningPolicy, HybridSchedule, FeatureAverage<>, DecoupledFields, Backend> slam(room.camera(),
                                                                                                      settings);
  slam.keyframe_policy = often();
  slam.pruning.backbone_period = 3;
  slam.pruning.consistency_period = 6;
  auto features = label_features(room);
  const std::vector<RgbdFrame> frames = frames_of(room);
  std::vector<RgbdFrame> without_poses = frames;
  for (RgbdFrame& frame : without_poses) frame.T_world_camera.reset();
  const std::vector<FrameReport> reports = run(slam, without_poses, features);

  SlamRun result;
  const SlamStatistics statistics = slam.statistics();
  result.keyframes = statistics.keyframes;
  result.gaussians = slam.map().size();
  result.pruned = statistics.pruned;
  result.trajectory = slam.trajectory();
  const Pose last = result.trajectory.back().T_world_camera;
  const Image<std::uint8_t>& seen = frames.back().colour;
  Image<float> colour(seen.width(), seen.height(), 3);
  for (std::size_t i = 0; i < seen.size(); ++i) colour.data()[i] = static_cast<float>(seen.data()[i]) / 255.f;
  result.psnr = psnr_all(slam.render(room.camera(), last).colour, colour);
  result.cosine = slam.teacher_cosine().mean();
  result.loss = reports.back().loss;
  result.features = slam.feature_image(room.camera(), last, 20, 15);
  const Image<std::uint16_t> labels = slam.label_image(room.camera(), last, SyntheticRoom::class_vectors(kDim));
  result.labels.assign(labels.data(), labels.data() + labels.size());
  result.bytes = bytes_of(slam);
  return result;
}

[[nodiscard]] SlamRun slam_run_on_host();

}  // namespace langgs::test
