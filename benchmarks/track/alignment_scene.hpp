// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <vector>

#include "langgs/core/error.hpp"
#include "langgs/core/pose.hpp"
#include "langgs/core/rng.hpp"
#include "langgs/frame/synthetic_room.hpp"
#include "langgs/host/worker_pool.hpp"
#include "langgs/manage/insertion.hpp"
#include "langgs/track/measured_surface.hpp"
#include "langgs/track/source_cloud.hpp"

/// @file What registration is timed on: a frame of the built-in room, a map of it, and poses to start from.

namespace langgs::benchmarks {

/// How far a pose is from the true one.
struct PoseError {
  double translation_mm, rotation_mrad;
};

[[nodiscard]] inline PoseError pose_error(const Pose& estimate, const Pose& truth) {
  return {1e3 * (estimate.translation() - truth.translation()).norm(),
          1e3 * so3_log(truth.linear().transpose() * estimate.linear()).norm()};
}

/// Root mean square of what was added.
class MeanPoseError {
 public:
  void add(const PoseError& e) {
    squares_ += Eigen::Array2d(e.translation_mm, e.rotation_mrad).square();
    ++count_;
  }
  [[nodiscard]] PoseError rms() const {
    const Eigen::Array2d result = (squares_ / count_).sqrt();
    return {result[0], result[1]};
  }

 private:
  Eigen::Array2d squares_ = Eigen::Array2d::Zero();
  int count_ = 0;
};

/// How far from the truth a registration starts.
struct StartDistance {
  double translation_m, rotation_rad;
};
inline constexpr StartDistance kFar{0.03, 2 * std::numbers::pi / 180};      // of a frame without a motion model
inline constexpr StartDistance kNear{0.005, 0.3 * std::numbers::pi / 180};  // of one with it

/// Poses so far from `truth`, in random directions, the same every time.
[[nodiscard]] inline std::vector<Pose> starts_around(const Pose& truth, const StartDistance& distance) {
  constexpr std::uint64_t kStarts = 8;
  const CounterRng rng{7, 0};
  std::vector<Pose> starts(kStarts, truth);
  for (std::uint64_t s = 0; s < kStarts; ++s) {
    Twist away;
    for (std::uint64_t a = 0; a < 6; ++a) away[static_cast<int>(a)] = rng.normal(6 * s + a);
    // Turned about the camera, not about the world's origin.
    starts[s].translation() += distance.translation_m * away.head<3>().normalized();
    starts[s].linear() = so3_exp(distance.rotation_rad * away.tail<3>().normalized()) * truth.linear();
  }
  return starts;
}

struct AlignmentScene {
  Camera camera;
  RgbdFrame frame;                     ///< to be registered
  SourceCloud source;                  ///< its grid cloud
  std::vector<TargetGaussian> target;  ///< the map: other frames of the walk, before and after this one
  Pose T_world_camera;                 ///< the true pose
  RgbdFrame neighbour;                 ///< a frame of the map, for registration from frame to frame
  Pose T_world_neighbour;              ///< its true pose
};

/// The map of `target_size` Gaussians is as the system makes it, but at the true poses: every sixth frame of a long
/// walk adds what the redundancy filter lets in. Frame and map have the depth errors of a Kinect: a map of exact points
/// would flatter everybody.
[[nodiscard]] inline AlignmentScene make_alignment_scene(WorkerPool& pool, int target_size = 150'000) {
  constexpr int kSource = 63, kStep = 6;
  const SyntheticRoom room({.width = 640, .height = 480, .frames = 1200, .depth_noise = true}, &pool);
  AlignmentScene scene{room.camera(), room.frame(kSource), {}, {}, room.ground_truth(kSource), {}, {}};
  SourceCloudSettings grid;
  grid.stride = 6;  // 8000 points
  scene.source = make_source_cloud(scene.frame, scene.camera, grid, pool);

  RedundancyFilter filter;
  const std::size_t size = static_cast<std::size_t>(target_size);
  for (int i = 0; i < room.size() && scene.target.size() < size; i += kStep) {
    const RgbdFrame frame = room.frame(i);
    const Pose T_world_camera = room.ground_truth(i);
    const SourceCloud cloud = make_source_cloud(frame, scene.camera, {}, pool);
    std::vector<Eigen::Vector3f> means;
    for (const Eigen::Vector3f& p : cloud.points) means.push_back((T_world_camera * p.cast<double>()).cast<float>());
    std::vector<std::int32_t> chosen;
    filter.select({means, {}}, chosen);
    const auto added = measured(cloud, chosen, scene.camera, T_world_camera, TargetShape::anisotropic);
    scene.target.insert(scene.target.end(), added.begin(), added.end());
    if (i + kStep / 2 == kSource) {
      scene.neighbour = frame;
      scene.T_world_neighbour = T_world_camera;
    }
  }
  LANGGS_EXPECTS(scene.target.size() >= size && !scene.neighbour.depth.empty(), "the room gave ", scene.target.size(),
                 " Gaussians, ", target_size, " were asked for; walk farther, or ask for fewer");
  scene.target.resize(size);
  return scene;
}

}  // namespace langgs::benchmarks
