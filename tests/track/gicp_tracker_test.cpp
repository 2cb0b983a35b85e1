// SPDX-License-Identifier: Apache-2.0
#include "langgs/track/gicp_tracker.hpp"

#include <doctest/doctest.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cstdint>
#include <cstring>
#include <numeric>
#include <vector>

#include "langgs/track/measured_surface.hpp"
#include "track/gicp_cases.hpp"

/// @file The tracker finds the pose, to the bit whatever the number of threads.

using namespace langgs;
using test::cloud_of, test::isotropic_target, test::room_source, test::room_target;

namespace {

/// All points of a cloud seen from `T_world_camera`, as keyframes add them to the map.
void append_measured(const SourceCloud& cloud, const Pose& T_world_camera, TargetShape shape,
                     std::vector<TargetGaussian>& gaussians) {
  std::vector<std::int32_t> all(cloud.size());
  std::iota(all.begin(), all.end(), 0);
  const std::vector<TargetGaussian> added = measured(cloud, all, test::small_camera(), T_world_camera, shape);
  gaussians.insert(gaussians.end(), added.begin(), added.end());
}

}  // namespace

TEST_CASE("known offsets in a room are recovered") {
  WorkerPool pool(1);
  const GridTarget target = room_target();
  const GicpTracker tracker;
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const Pose truth = test::random_motion(seed, 0.3, 0.4);
    const Pose guess = truth * test::random_motion(seed + 100, 0.01, 0.0175);
    const SourceCloud source = room_source(truth, pool);
    const GicpResult result = tracker.align(source, target, guess, pool);
    CHECK(result.status == GicpStatus::converged);
    const Pose error = truth.inverse() * result.T_world_camera;
    CHECK(error.translation().norm() < 1e-3);
    CHECK(test::rotation_angle(error) < 2e-3);
    test::check_sane(result, source, guess, tracker.settings());

    CHECK((result.information - result.information.transpose()).norm() == 0);
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 6, 6>> solver(result.information);
    CHECK(solver.eigenvalues()[0] > 0);
    CHECK(result.conditioning > 0.01);
    CHECK(result.overlap > 0.5);
  }
}

TEST_CASE("without corners and edges the pose is exact to 0.1 mm") {
  // Three orthogonal walls met at their middles only, shapes given exactly.
  WorkerPool pool(1);
  std::vector<Eigen::Vector3f> samples, map;
  std::vector<Eigen::Matrix3f> shapes;
  const CounterRng rng{4};
  for (int i = 0; i < 60000; ++i) {
    const int axis = i % 3;
    Eigen::Vector3d p(rng.uniform(3 * i) - 0.5, rng.uniform(3 * i + 1) - 0.5, rng.uniform(3 * i + 2) - 0.5);
    p[axis] = -1;
    map.push_back(p.cast<float>());
    if (i >= 6000) continue;
    Eigen::Vector3d q(0.9 * (rng.uniform(3 * i + 7) - 0.5), 0.9 * (rng.uniform(3 * i + 8) - 0.5),
                      0.9 * (rng.uniform(3 * i + 9) - 0.5));
    q[axis] = -1;
    samples.push_back(q.cast<float>());
    shapes.push_back((Eigen::Vector3f::Ones() - (1 - 1e-3f) * Eigen::Vector3f::Unit(axis)).asDiagonal());
  }
  SourceCloud source = cloud_of(samples);
  source.covariances = shapes;
  const GridTarget target = isotropic_target(map);
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const Pose guess = test::random_motion(seed, 0.01, 0.0175);
    const GicpResult result = GicpTracker().align(source, target, guess, pool);
    CHECK(result.status == GicpStatus::converged);
    CHECK(result.T_world_camera.translation().norm() < 1e-4);
    CHECK(test::rotation_angle(result.T_world_camera) < 1e-4);
    CHECK(result.inlier_rms < 1e-3);
  }
}

TEST_CASE("larger motion, noise, and both target shapes") {
  WorkerPool pool(1);
  for (const TargetShape shape : {TargetShape::isotropic, TargetShape::anisotropic}) {
    // A map as tracking makes it: the points of frames seen from the truth, with their shapes.
    std::vector<TargetGaussian> map;
    for (std::uint64_t seed = 50; seed < 53; ++seed) {
      const Pose pose = test::random_motion(seed, 0.2, 0.2);
      append_measured(room_source(pose, pool, 0.001), pose, shape, map);
    }
    const GridTarget target(map);
    for (std::uint64_t seed = 0; seed < 15; ++seed) {
      const Pose truth = test::random_motion(seed, 0.1, 0.1);
      const Pose guess = truth * test::random_motion(seed + 200, 0.08, 0.05);
      const GicpResult result = GicpTracker().align(room_source(truth, pool, 0.001), target, guess, pool);
      const Pose error = truth.inverse() * result.T_world_camera;
      CHECK(has_pose(result.status));
      CHECK(error.translation().norm() < 0.02);
      CHECK(test::rotation_angle(error) < 0.01);
    }
  }
}

TEST_CASE("odometry through the room: points of keyframes are the map") {
  WorkerPool pool(2);
  const GicpTracker tracker;
  std::vector<TargetGaussian> map;
  GridTarget target;
  Pose T = Pose::Identity();
  double worst = 0;
  int num_keyframes = 0;
  for (int frame = 0; frame < 60; ++frame) {
    const double s = frame / 60.0 * 6.28;
    Pose truth = Pose::Identity();
    truth.translation() = Eigen::Vector3d(0.3 * std::sin(s), 0.1 * (1 - std::cos(s)), 0.2 * std::sin(2 * s));
    truth.linear() = so3_exp({0.1 * std::sin(2 * s), 0.4 * std::sin(s), 0.05 * (1 - std::cos(s))});
    const SourceCloud source =
        make_source_cloud(test::render_box_room(test::small_camera(), truth, 0.0015, 1000 + frame),
                          test::small_camera(), {.stride = 3}, pool);
    GicpResult result;
    if (frame > 0) {
      result = tracker.align(source, target, T, pool);
      REQUIRE(has_pose(result.status));
      T = result.T_world_camera;
      worst = std::max(worst, (T.translation() - truth.translation()).norm());
      if (result.overlap >= 0.8) continue;
    }
    std::vector<std::int32_t> chosen;
    for (int i = 0; i < source.size(); ++i)
      if (source.trackable[i] && (frame == 0 || !(result.squared_distance[i] < 1e-3f))) chosen.push_back(i);
    const std::vector<TargetGaussian> added =
        measured(source, chosen, test::small_camera(), T, TargetShape::anisotropic);
    map.insert(map.end(), added.begin(), added.end());
    target = target.renewed(map);
    ++num_keyframes;
  }
  CHECK(worst < 0.03);
  CHECK(num_keyframes > 1);
  CHECK(num_keyframes < 30);
  MESSAGE("worst position error ", worst, " m over 60 frames, ", num_keyframes, " keyframes");
}

TEST_CASE("the same bits for any number of threads") {
  WorkerPool one(1), two(2), five(5);
  const GridTarget target = room_target();
  const Pose truth = test::random_motion(5, 0.2, 0.3);
  const Pose guess = truth * test::random_motion(6, 0.05, 0.05);
  const SourceCloud source = room_source(truth, one, 0.002);
  const GicpResult a = GicpTracker().align(source, target, guess, one);
  for (WorkerPool* pool : {&one, &two, &five}) {
    const GicpResult b = GicpTracker().align(source, target, guess, *pool);
    CHECK(a.T_world_camera.matrix() == b.T_world_camera.matrix());
    CHECK(a.information == b.information);
    CHECK(a.iterations == b.iterations);
    CHECK(a.inlier_rms == b.inlier_rms);
    CHECK(std::memcmp(a.squared_distance.data(), b.squared_distance.data(), a.squared_distance.size() * 4) == 0);
  }
}
