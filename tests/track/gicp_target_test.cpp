// SPDX-License-Identifier: Apache-2.0
#include "langgs/track/gicp_target.hpp"

#include <doctest/doctest.h>

#include <limits>
#include <type_traits>

#include "track/box_room.hpp"

using namespace langgs;
using test::isotropic_target;

static_assert(!std::is_copy_constructible_v<GicpTarget> && std::is_move_constructible_v<GicpTarget>);

TEST_CASE("nearest is exact, with and without a bound") {
  const std::vector<Eigen::Vector3f> means = test::sample_box_room(2000, 3);
  const GicpTarget target = isotropic_target(means);
  const CounterRng rng{5};
  for (int i = 0; i < 500; ++i) {
    const Eigen::Vector3f query =
        Eigen::Vector3d(rng.normal(3 * i), rng.normal(3 * i + 1), 2 * rng.normal(3 * i + 2)).cast<float>();
    float best = std::numeric_limits<float>::infinity();
    for (const Eigen::Vector3f& mean : means) best = std::min(best, (mean - query).squaredNorm());
    const Neighbour free = target.nearest(query, {-1, 1e6f});
    REQUIRE(free.index >= 0);
    CHECK(free.squared_distance == doctest::Approx(best).epsilon(1e-5));
    CHECK((target.mean(free.index) - query).squaredNorm() == doctest::Approx(best).epsilon(1e-5));
    CHECK(target.nearest(query, {-1, 0.9f * best}).index == -1);
    CHECK(target.nearest(query, {-1, 1.1f * best + 1e-9f}).index == free.index);
    CHECK(target.nearest(query, free).index == free.index);
  }
  CHECK(target.nearest(Eigen::Vector3f::Constant(std::numeric_limits<float>::quiet_NaN()), {-1, 1.0f}).index == -1);
}

TEST_CASE("non-finite and absurd elements are left out") {
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  std::vector<Eigen::Vector3f> means = {{1, 2, 3}, {nan, 0, 0}, {0, inf, 0}, {0, 0, 1e30f}, {4, 5, 6}, {7, 8, 9}};
  std::vector<Eigen::Matrix3f> covariances(6, Eigen::Matrix3f::Identity());
  covariances[5](1, 2) = nan;
  const GicpTarget target(means, covariances);
  REQUIRE(target.size() == 2);
  CHECK(target.mean(1) == Eigen::Vector3f(4, 5, 6));
}

TEST_CASE("empty, duplicate and mismatched input") {
  CHECK(GicpTarget().size() == 0);
  CHECK(GicpTarget().nearest({0, 0, 0}, {-1, 1.0f}).index == -1);
  const GicpTarget duplicates = isotropic_target(std::vector<Eigen::Vector3f>(100000, {1, 1, 1}));
  CHECK(duplicates.nearest({1, 1, 1.5f}, {-1, 1.0f}).squared_distance == 0.25f);
  CHECK_THROWS_AS(GicpTarget({{0, 0, 0}}, {}), InvalidArgument);
  CHECK_THROWS_AS((void)GicpTarget::from_gaussians({{0, 0, 0}}, {}, {}, TargetShape::isotropic), InvalidArgument);
  GicpTarget moved = isotropic_target({{1, 0, 0}, {0, 1, 0}});
  const GicpTarget target = std::move(moved);
  CHECK(target.nearest({0.9f, 0, 0}, {-1, 1.0f}).squared_distance == doctest::Approx(0.01));
}

TEST_CASE("target shapes: quaternions are w, x, y, z and axes are sorted before they are normalised") {
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    const Eigen::Matrix3f axes = test::random_motion(seed, 0, 3).linear().cast<float>();
    const Eigen::Quaternionf q(axes);
    const Eigen::Vector4f wxyz = 3.0f * Eigen::Vector4f(q.w(), q.x(), q.y(), q.z());  // any length
    const Eigen::Vector3f normal = axes.col(1);                                       // thin along the second axis
    const Eigen::Vector3f scales(0.05f, 0.001f, 0.02f);
    const Eigen::Matrix3f expected = Eigen::Matrix3f::Identity() - (1 - 0.0025f) * normal * normal.transpose();
    CHECK((GicpTarget::target_covariance(wxyz, scales, TargetShape::anisotropic) - expected).norm() < 1e-5f);
    CHECK(GicpTarget::target_covariance(wxyz, scales, TargetShape::isotropic) ==
          kIsotropicTarget * Eigen::Matrix3f::Identity());
  }
  // Exactly flat is clamped; what has no surface is isotropic.
  const Eigen::Matrix3f flat =
      GicpTarget::target_covariance({1, 0, 0, 0}, {0.1f, 0.1f, 0.0f}, TargetShape::anisotropic);
  CHECK(flat(2, 2) == doctest::Approx(kThinnestTarget));
  const float nan = std::numeric_limits<float>::quiet_NaN();
  for (const Eigen::Vector3f& scales : {Eigen::Vector3f(0, 0, 0), Eigen::Vector3f(1, 0, 0), Eigen::Vector3f(1, nan, 1)})
    CHECK(GicpTarget::target_covariance({1, 0, 0, 0}, scales, TargetShape::anisotropic) ==
          kIsotropicTarget * Eigen::Matrix3f::Identity());
  CHECK(GicpTarget::target_covariance({0, 0, 0, 0}, {1, 1, 1}, TargetShape::anisotropic).allFinite());
}
