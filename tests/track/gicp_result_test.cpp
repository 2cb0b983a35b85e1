// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "track/gicp_cases.hpp"

/// @file What a result says about itself: directions left open, distances, overlap; and that it is sane for any input.

using namespace langgs;
using test::check_sane, test::cloud_of, test::isotropic_target, test::room_source, test::room_target;

namespace {

constexpr float kInf = std::numeric_limits<float>::infinity();

/// Points of a wall of [-1, 1]^2 m at z = 2 m, random.
std::vector<Eigen::Vector3f> wall(int n, std::uint64_t seed) {
  std::vector<Eigen::Vector3f> points;
  const CounterRng rng{seed};
  for (int i = 0; i < n; ++i)
    points.push_back(Eigen::Vector3d(2 * rng.uniform(2 * i) - 1, 2 * rng.uniform(2 * i + 1) - 1, 2).cast<float>());
  return points;
}

}  // namespace

TEST_CASE("a bare wall fixes three directions and leaves the others at the guess") {
  WorkerPool pool(1);
  const GridTarget target = isotropic_target(wall(20000, 1));
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

  // Every open direction moves the points of the wall within the wall.
  REQUIRE(result.open_directions.size() == 3);
  for (const Twist& direction : result.open_directions) {
    CHECK(direction.norm() == doctest::Approx(1));
    for (const Eigen::Vector3d& x :
         {Eigen::Vector3d(0.9, 0.3, 2), Eigen::Vector3d(-0.5, 0.8, 2), Eigen::Vector3d(0, -1, 2)})
      CHECK(std::abs((direction.head<3>() + direction.tail<3>().cross(x)).z()) < 0.02);
  }
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
  const GridTarget target = isotropic_target(first.points);
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
  std::vector<TargetGaussian> points = test::isotropic_gaussians(room.points);
  for (TargetGaussian& point : points) point.covariance.fill(0);
  const GridTarget pointlike(points);
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
  const GridTarget target = room_target();
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
