// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "langgs/track/gicp_tracker.hpp"
#include "support/sanitized.hpp"
#include "track/gicp_cases.hpp"

/// @file Ten thousand random alignments: none hangs, breaks, or ends without saying how.

using namespace langgs;

namespace {

enum class Kind { room, plane, line, point, empty, broken, duplicates, noise, kNumKinds };

/// `n` points as a camera at the identity may see them; few of the kinds fix a pose.
std::vector<Eigen::Vector3f> points_of(Kind kind, int n, std::uint64_t seed) {
  const CounterRng rng{seed, 5};
  if (kind == Kind::empty) return {};
  if (kind == Kind::room) return test::sample_box_room(n, seed);
  std::vector<Eigen::Vector3f> points;
  const float bad[] = {std::nanf(""), std::numeric_limits<float>::infinity(), -1e30f, 3e19f, 1e38f};
  for (int i = 0; i < n; ++i) {
    const auto u = [&](int a) { return static_cast<float>(2 * rng.uniform(5 * i + a) - 1); };
    Eigen::Vector3f p(u(0), u(1), 2 + u(2));
    if (kind == Kind::plane) p.z() = 2;
    if (kind == Kind::line) p = {u(0), 0, 2};
    if (kind == Kind::point) p = {0.1f, 0, 2};
    if (kind == Kind::broken) p[static_cast<int>(rng.below(5 * i + 3, 3))] = bad[rng.below(5 * i + 4, 5)];
    points.push_back(p);
  }
  if (kind == Kind::duplicates)
    for (std::size_t i = 0; i < points.size(); ++i) points[i] = points[i % 7];
  return points;
}

/// Points with the normals of the box that they lie on, as a frame would have them.
SourceCloud room_cloud(int n, std::uint64_t seed) {
  SourceCloud cloud = test::cloud_of(test::sample_box_room(n, seed));
  for (int i = 0; i < n; ++i) {
    const int axis = static_cast<int>(CounterRng{seed}.below(4 * i + 3, 6)) / 2;  // as sample_box_room chooses it
    cloud.covariances[i] = (Eigen::Vector3f::Ones() - (1 - 1e-3f) * Eigen::Vector3f::Unit(axis)).asDiagonal();
  }
  return cloud;
}

/// Values that no camera gives, here and there.
void spoil(SourceCloud& cloud, const CounterRng& rng) {
  const float nan = std::nanf("");
  for (int i = 0; i < cloud.size(); ++i) switch (rng.below(100 + i, 40)) {
      case 0:
        cloud.points[i].y() = nan;
        break;
      case 1:
        cloud.points[i].x() = std::numeric_limits<float>::infinity();
        break;
      case 2:
        cloud.covariances[i].setZero();
        break;
      case 3:
        cloud.covariances[i].setConstant(nan);
        break;
      case 4:
        cloud.covariances[i] *= -1;
        break;
      case 5:
        cloud.weights[i] = nan;
        break;
      case 6:
        cloud.weights[i] = -1;
        break;
      case 7:
        cloud.weights[i] = 1e38f;
        break;
      case 8:
        cloud.trackable[i] = 0;
        break;
      case 9:
        cloud.points[i].setConstant(1e18f);
        break;
      default:
        break;
    }
}

}  // namespace

TEST_CASE("fuzz: random alignments in a room" * doctest::skip(test::kSanitized)) {
  WorkerPool pool(1);
  const GridTarget target(test::isotropic_gaussians(test::sample_box_room(60000, 3)));
  const GicpTracker tracker;
  std::array<int, 5> count{};
  int wrong = 0, sure = 0, sure_wrong = 0, near = 0, near_wrong = 0;
  for (std::uint64_t seed = 0; seed < 4000; ++seed) {
    const CounterRng rng{seed, 9};
    const SourceCloud source = room_cloud(200 + static_cast<int>(rng.below(1, 200)), 100 + seed);
    // Perturbations of all sizes up to 30 cm and 30 degrees.
    const double size = rng.uniform(2);
    const Pose guess = test::random_motion(seed, 0.3 * size, 0.5236 * size);
    const GicpResult result = tracker.align(source, target, guess, pool);
    test::check_sane(result, source, guess, tracker.settings());
    ++count[static_cast<int>(result.status)];
    const bool is_wrong = result.status == GicpStatus::converged && result.T_world_camera.translation().norm() > 0.05;
    wrong += is_wrong;
    const bool is_sure = result.status == GicpStatus::converged && result.overlap > 0.75;
    sure += is_sure;
    sure_wrong += is_sure && is_wrong;
    const bool is_near = guess.translation().norm() < 0.05 && test::rotation_angle(guess) < 0.1;
    near += is_near;
    near_wrong += is_near && !(result.T_world_camera.translation().norm() < 0.05);
  }
  MESSAGE("converged ", count[0], ", iteration limit ", count[1], ", degenerate ", count[2], ", too few ", count[3],
          ", failed ", count[4], "; converged elsewhere ", wrong, "; with overlap ", sure, " of which elsewhere ",
          sure_wrong, "; of ", near, " near ones ", near_wrong);
  CHECK(near > 1000);
  CHECK(near_wrong == 0);
  // Point clouds have other minima: from farther away nine of a hundred that converge do so elsewhere, most of them
  // turned or slid along the box. None of them covers three quarters of its points.
  CHECK(count[0] > 2500);
  CHECK(wrong < count[0] / 10);
  CHECK(sure > 1500);
  CHECK(sure_wrong == 0);
}

TEST_CASE("fuzz: sources and targets of every kind") {
  WorkerPool pool(1);
  constexpr int kKinds = static_cast<int>(Kind::kNumKinds);
  std::vector<GridTarget> targets;
  for (int kind = 0; kind < kKinds; ++kind)
    for (const int n : {30, 3000}) {
      std::vector<TargetGaussian> gaussians = test::isotropic_gaussians(points_of(static_cast<Kind>(kind), n, kind));
      for (std::size_t i = 0; i < gaussians.size(); i += 17)
        gaussians[i].covariance.fill(i % 2 == 0 ? 0.f : -1e-3f);  // singular, or negative
      targets.emplace_back(gaussians);
    }
  const GicpTracker tracker;
  for (std::uint64_t seed = 0; seed < (test::kSanitized ? 400 : 6000); ++seed) {
    const CounterRng rng{seed, 13};
    const auto kind = static_cast<Kind>(rng.below(1, kKinds));
    SourceCloud source = test::cloud_of(points_of(kind, 200 + static_cast<int>(rng.below(2, 300)), seed));
    if (rng.below(3, 2) == 0) spoil(source, rng);
    const GridTarget& target = targets[rng.below(4, static_cast<std::uint32_t>(targets.size()))];
    const Pose guess = test::random_motion(seed, 0.3, 0.5236);
    const GicpResult result = tracker.align(source, target, guess, pool);
    test::check_sane(result, source, guess, tracker.settings());
    const bool shapeless = kind == Kind::empty || kind == Kind::point || kind == Kind::line || target.size() == 0;
    if (shapeless) CHECK(result.status != GicpStatus::converged);
    if (kind == Kind::empty || target.size() == 0) CHECK(result.status == GicpStatus::too_few_correspondences);
  }
}

TEST_CASE("fuzz: targets of a million" * doctest::skip(test::kSanitized)) {
  WorkerPool pool(1);
  const GridTarget target(test::isotropic_gaussians(test::sample_box_room(1000000, 3)));
  const GicpTracker tracker;
  for (std::uint64_t seed = 0; seed < 60; ++seed) {
    const SourceCloud source = room_cloud(500, 100 + seed);
    const Pose guess = test::random_motion(seed, 0.05, 0.05);
    const GicpResult result = tracker.align(source, target, guess, pool);
    test::check_sane(result, source, guess, tracker.settings());
    CHECK(result.status == GicpStatus::converged);
    CHECK(result.T_world_camera.translation().norm() < 2e-3);
  }
}
