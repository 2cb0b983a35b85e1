// SPDX-License-Identifier: Apache-2.0
#include "langgs/track/gicp_tracker.hpp"

#include <doctest/doctest.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cstring>
#include <limits>
#include <vector>

#include "track/box_room.hpp"

using namespace langgs;

namespace {

constexpr float kInf = std::numeric_limits<float>::infinity();

GicpTarget isotropic_target(std::vector<Eigen::Vector3f> means) {
  const std::size_t n = means.size();
  return GicpTarget(std::move(means), std::vector<Eigen::Matrix3f>(n, kIsotropicTarget * Eigen::Matrix3f::Identity()));
}

GicpTarget room_target() { return isotropic_target(test::sample_box_room(40000, 9)); }

SourceCloud room_source(const Pose& T_world_camera, WorkerPool& pool, double noise_z2 = 0) {
  SourceCloudSettings settings;
  settings.stride = 3;
  return make_source_cloud(test::render_box_room(test::small_camera(), T_world_camera, noise_z2), test::small_camera(),
                           settings, pool);
}

/// Points of a wall of [-1, 1]^2 m at z = 2 m, random.
std::vector<Eigen::Vector3f> wall(int n, std::uint64_t seed) {
  std::vector<Eigen::Vector3f> points;
  const CounterRng rng{seed};
  for (int i = 0; i < n; ++i)
    points.push_back(Eigen::Vector3d(2 * rng.uniform(2 * i) - 1, 2 * rng.uniform(2 * i + 1) - 1, 2).cast<float>());
  return points;
}

/// A cloud of hand-made points whose shape is a plane facing the camera.
SourceCloud cloud_of(const std::vector<Eigen::Vector3f>& points) {
  SourceCloud cloud;
  cloud.resize(static_cast<int>(points.size()));
  cloud.points = points;
  for (int i = 0; i < cloud.size(); ++i) {
    cloud.covariances[i] = Eigen::Vector3f(1, 1, 1e-3f).asDiagonal();
    cloud.weights[i] = 1;
    cloud.trackable[i] = 1;
  }
  return cloud;
}

void append_in_world(const SourceCloud& cloud, int i, const Pose& T_world_camera, std::vector<Eigen::Vector3f>& means,
                     std::vector<Eigen::Vector4f>& quaternions, std::vector<Eigen::Vector3f>& scales) {
  means.push_back((T_world_camera * cloud.points[i].cast<double>()).cast<float>());
  const Eigen::Vector4f q = cloud.rotations[i];
  const Eigen::Quaternionf world =
      Eigen::Quaterniond(T_world_camera.linear()).cast<float>() * Eigen::Quaternionf(q[0], q[1], q[2], q[3]);
  quaternions.emplace_back(world.w(), world.x(), world.y(), world.z());
  scales.push_back(cloud.scales[i]);
}

void check_sane(const GicpResult& result, const SourceCloud& source, const Pose& initial,
                const GicpSettings& settings) {
  CHECK(is_finite(result.T_world_camera));
  CHECK(std::abs(result.T_world_camera.linear().determinant() - 1) < 1e-6);
  CHECK(result.iterations <= settings.max_iterations);
  CHECK(result.overlap >= 0);
  CHECK(result.overlap <= 1);
  CHECK(std::isfinite(result.inlier_rms));
  CHECK(std::isfinite(result.conditioning));
  CHECK(result.information.allFinite());
  CHECK(result.squared_distance.size() == source.points.size());
  CHECK(std::none_of(result.squared_distance.begin(), result.squared_distance.end(),
                     [](float d) { return std::isnan(d); }));
  if (!has_pose(result.status)) CHECK(result.T_world_camera.matrix() == initial.matrix());
}

}  // namespace

TEST_CASE("known offsets in a room are recovered") {
  WorkerPool pool(1);
  const GicpTarget target = room_target();
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
    check_sane(result, source, guess, tracker.settings());

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
  const GicpTarget target = isotropic_target(map);
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
  // A map as tracking makes it: the points of frames seen from the truth, with their shapes.
  std::vector<Eigen::Vector3f> means, scales;
  std::vector<Eigen::Vector4f> quaternions;
  for (std::uint64_t seed = 50; seed < 53; ++seed) {
    const Pose pose = test::random_motion(seed, 0.2, 0.2);
    const SourceCloud cloud = room_source(pose, pool, 0.001);
    for (int i = 0; i < cloud.size(); ++i) {
      append_in_world(cloud, i, pose, means, quaternions, scales);
    }
  }
  for (const TargetShape shape : {TargetShape::isotropic, TargetShape::anisotropic}) {
    const GicpTarget target = GicpTarget::from_gaussians(means, quaternions, scales, shape);
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

TEST_CASE("a bare wall fixes three directions and leaves the others at the guess") {
  WorkerPool pool(1);
  const GicpTarget target = isotropic_target(wall(20000, 1));
  const SourceCloud source = cloud_of(wall(3000, 2));
  Pose guess = Pose::Identity();
  guess.translation() = Eigen::Vector3d(0.03, -0.02, 0.02);
  guess.linear() = so3_exp({0.01, -0.01, 0.0});
  const GicpResult result = GicpTracker().align(source, target, guess, pool);
  CHECK(result.status == GicpStatus::degenerate);
  CHECK(result.conditioning < 3e-3);
  const Pose& T = result.T_world_camera;
  CHECK(std::abs((T * Eigen::Vector3d(0, 0, 2)).z() - 2) < 1e-3);  // back on the wall
  CHECK(so3_log(T.linear()).head<2>().norm() < 1e-3);              // and parallel to it
  // Along the wall nothing was learnt.
  const Eigen::Vector3d along = T * Eigen::Vector3d(0, 0, 2) - guess * Eigen::Vector3d(0, 0, 2);
  CHECK(along.head<2>().norm() < 2e-3);

  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 6, 6>> solver(result.information);
  CHECK(solver.eigenvalues()[2] < 2e-2 * solver.eigenvalues()[3]);  // three small, three large
  CHECK(solver.eigenvalues()[3] > 0.02 * solver.eigenvalues()[5]);
}

TEST_CASE("distances are those of the final pose and match brute force") {
  WorkerPool pool(1);
  const std::vector<Eigen::Vector3f> map = test::sample_box_room(8000, 9);
  const Pose truth = test::random_motion(3, 0.2, 0.3);
  SourceCloud source = room_source(truth, pool);
  source.trackable[7] = 0;
  const GicpTracker tracker;
  const GicpResult result =
      tracker.align(source, isotropic_target(map), truth * test::random_motion(4, 0.03, 0.02), pool);
  REQUIRE(has_pose(result.status));
  int covered = 0;
  for (int i = 0; i < source.size(); i += 1) {
    if (!source.trackable[i]) {
      CHECK(result.squared_distance[i] == kInf);
      continue;
    }
    const Eigen::Vector3f query = (result.T_world_camera * source.points[i].cast<double>()).cast<float>();
    float best = kInf;
    for (const Eigen::Vector3f& mean : map) best = std::min(best, (mean - query).squaredNorm());
    if (best >= 0.0099f)
      CHECK(result.squared_distance[i] >= 0.0099f);
    else
      CHECK(result.squared_distance[i] == doctest::Approx(best).epsilon(1e-4));
    covered += best < tracker.settings().overlap_squared_distance;
  }
  CHECK(std::abs(result.overlap * source.num_trackable() - covered) < 3);
}

TEST_CASE("overlap falls as the camera turns away from the map") {
  WorkerPool pool(1);
  const SourceCloud first = room_source(Pose::Identity(), pool);
  const GicpTarget target = isotropic_target(first.points);
  double last = 1.01;
  for (int step = 0; step <= 8; ++step) {
    Pose truth = Pose::Identity();
    truth.linear() = so3_exp({0, 0.08 * step, 0});
    GicpSettings settings;
    settings.overlap_squared_distance = 4e-3;
    const GicpResult result = GicpTracker(settings).align(room_source(truth, pool), target, truth, pool);
    REQUIRE(has_pose(result.status));
    CHECK(result.overlap < last);
    last = result.overlap;
  }
  CHECK(last < 0.7);
}

TEST_CASE("the same bits for any number of threads") {
  WorkerPool one(1), two(2), five(5);
  const GicpTarget target = room_target();
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

TEST_CASE("bad clouds and targets end with a status and a finite pose") {
  WorkerPool pool(1);
  const GicpTracker tracker;
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const SourceCloud room = room_source(Pose::Identity(), pool);

  std::vector<std::vector<Eigen::Vector3f>> sets;
  sets.push_back({});
  sets.push_back({{0, 0, 2}});
  sets.emplace_back(500, Eigen::Vector3f(0, 0, 2));  // all the same
  sets.push_back(wall(2000, 3));
  sets.emplace_back();  // a line
  for (int i = 0; i < 500; ++i) sets.back().emplace_back(static_cast<float>(i) * 0.002f, 0.0f, 2.0f);
  sets.emplace_back(500, Eigen::Vector3f(nan, 0, 2));
  sets.emplace_back(500, Eigen::Vector3f(kInf, 1e30f, -kInf));
  sets.emplace_back(500, Eigen::Vector3f(3e19f, 0, 0));
  sets.push_back(room.points);

  std::vector<Pose> guesses(4, Pose::Identity());
  guesses[1] = test::random_motion(8, 0.3, 0.5);
  guesses[2].translation().setConstant(1e300);
  guesses[3].translation().setConstant(1e4);
  for (const auto& source_points : sets)
    for (const auto& target_points : sets)
      for (const Pose& guess : guesses) {
        const SourceCloud source = cloud_of(source_points);
        const GicpResult result = tracker.align(source, isotropic_target(target_points), guess, pool);
        check_sane(result, source, guess, tracker.settings());
        if (target_points.empty() || source_points.size() < 2 || &guess == &guesses[2])
          CHECK_FALSE(has_pose(result.status));
        if (&source_points != &sets.back()) CHECK(result.status != GicpStatus::converged);
      }

  SourceCloud broken = room;
  for (int i = 0; i < broken.size(); i += 3) broken.points[i].x() = nan;
  for (int i = 1; i < broken.size(); i += 3) broken.covariances[i].setZero();
  for (int i = 2; i < broken.size(); i += 9) broken.weights[i] = nan;
  const GicpTarget pointlike(room.points, std::vector<Eigen::Matrix3f>(room.points.size(), Eigen::Matrix3f::Zero()));
  check_sane(tracker.align(broken, pointlike, guesses[1], pool), broken, guesses[1], tracker.settings());

  Pose not_finite = Pose::Identity();
  not_finite.translation().x() = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_AS((void)tracker.align(room, room_target(), not_finite, pool), InvalidArgument);
  broken.weights.pop_back();
  CHECK_THROWS_AS((void)tracker.align(broken, pointlike, guesses[0], pool), InvalidArgument);
  CHECK_THROWS_AS(GicpTracker({.max_distance = 0}), InvalidArgument);
  CHECK_THROWS_AS(GicpTracker({.max_iterations = 0}), InvalidArgument);
}

TEST_CASE("random alignments up to 30 cm and 30 degrees never break") {
  WorkerPool pool(1);
  const GicpTarget target = room_target();
  const GicpTracker tracker;
  const SourceCloud source = room_source(Pose::Identity(), pool, 0.002);
  int near = 0, found = 0;
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    const Pose guess = test::random_motion(seed, 0.3, 0.52);
    const GicpResult result = tracker.align(source, target, guess, pool);
    check_sane(result, source, guess, tracker.settings());
    const bool is_near = guess.translation().norm() < 0.1 && test::rotation_angle(guess) < 0.1;
    near += is_near;
    found += is_near && result.T_world_camera.translation().norm() < 0.01;
  }
  CHECK(near > 5);
  CHECK(found == near);
}

TEST_CASE("odometry through the room: points of keyframes are the map") {
  WorkerPool pool(2);
  const GicpTracker tracker;
  std::vector<Eigen::Vector3f> means, scales;
  std::vector<Eigen::Vector4f> quaternions;
  GicpTarget target;
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
    for (int i = 0; i < source.size(); ++i) {
      if (!source.trackable[i] || (frame > 0 && result.squared_distance[i] < 1e-3f)) continue;
      append_in_world(source, i, T, means, quaternions, scales);
    }
    target = GicpTarget::from_gaussians(means, quaternions, scales, TargetShape::anisotropic);
    ++num_keyframes;
  }
  CHECK(worst < 0.03);
  CHECK(num_keyframes > 1);
  CHECK(num_keyframes < 30);
  MESSAGE("worst position error ", worst, " m over 60 frames, ", num_keyframes, " keyframes");
}
