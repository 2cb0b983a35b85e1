// SPDX-License-Identifier: Apache-2.0
#include "langgs/track/target.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "langgs/track/kd_tree_target.hpp"
#include "track/box_room.hpp"

/// @file What holds for every target: what is left out, empty and duplicate input, shapes.

using namespace langgs;
using test::isotropic_gaussians;

TEST_CASE_TEMPLATE("targets leave out what is not finite or absurd", Target, GridTarget, KdTreeTarget) {
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  std::vector<TargetGaussian> gaussians =
      isotropic_gaussians({{1, 2, 3}, {nan, 0, 0}, {0, inf, 0}, {0, 0, 1e30f}, {4, 5, 6}, {7, 8, 9}, {-2e5f, 0, 0}});
  gaussians[5].covariance[4] = nan;
  const Target target(gaussians);
  REQUIRE(target.size() == 2);
  REQUIRE(target.nearest({4, 5, 6.01f}, 0.1f).gaussian != nullptr);
  CHECK(target.nearest({4, 5, 6.01f}, 0.1f).gaussian->mean == Eigen::Vector3f(4, 5, 6));
  CHECK(target.nearest({7, 8, 9}, 0.1f).gaussian == nullptr);
}

TEST_CASE_TEMPLATE("empty and duplicate targets", Target, GridTarget, KdTreeTarget) {
  const Target empty(std::vector<TargetGaussian>{});
  CHECK(empty.size() == 0);
  CHECK(empty.nearest({0, 0, 0}, 1).gaussian == nullptr);
  CHECK(empty.nearest({0, 0, 0}, 1).rest_beyond == 1);

  const Target duplicates(isotropic_gaussians(std::vector<Eigen::Vector3f>(100000, {1, 1, 1})));
  CHECK(duplicates.size() == 100000);
  const TargetMatch match = duplicates.nearest({1, 1, 1.5f}, 1);
  REQUIRE(match.gaussian != nullptr);
  CHECK(match.squared_distance == 0.25f);
  CHECK(match.rest_beyond <= 0.5f);
  // The bound is a strict one.
  CHECK(duplicates.nearest({1, 1, 1.5f}, 0.5f).gaussian == nullptr);
  CHECK(duplicates.nearest({1, 1, 1.5f}, std::nextafter(0.5f, 1.f)).gaussian != nullptr);
}

TEST_CASE("a grid target can be moved") {
  GridTarget moved(isotropic_gaussians({{1, 0, 0}, {0, 1, 0}}));
  const GridTarget target = std::move(moved);
  CHECK(target.nearest({0.9f, 0, 0}, 1).squared_distance == doctest::Approx(0.01));
}

TEST_CASE("target shapes: quaternions are w, x, y, z and axes are sorted before they are normalised") {
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    const Eigen::Matrix3f axes = test::random_motion(seed, 0, 3).linear().cast<float>();
    const Eigen::Quaternionf q(axes);
    const Eigen::Vector4f wxyz = 3.0f * Eigen::Vector4f(q.w(), q.x(), q.y(), q.z());  // any length
    const Eigen::Vector3f normal = axes.col(1);                                       // thin along the second axis
    const Eigen::Vector3f scales(0.05f, 0.001f, 0.02f);
    const Eigen::Matrix3f expected = Eigen::Matrix3f::Identity() - (1 - 0.0025f) * normal * normal.transpose();
    CHECK((target_covariance(wxyz, scales, TargetShape::anisotropic) - expected).norm() < 1e-5f);
    CHECK(target_covariance(wxyz, scales, TargetShape::isotropic) == kIsotropicTarget * Eigen::Matrix3f::Identity());
  }
  // Exactly flat is clamped; what has no surface is isotropic.
  const Eigen::Matrix3f flat = target_covariance({1, 0, 0, 0}, {0.1f, 0.1f, 0.0f}, TargetShape::anisotropic);
  CHECK(flat(2, 2) == doctest::Approx(kThinnestTarget));
  const float nan = std::numeric_limits<float>::quiet_NaN();
  for (const Eigen::Vector3f& scales : {Eigen::Vector3f(0, 0, 0), Eigen::Vector3f(1, 0, 0), Eigen::Vector3f(1, nan, 1)})
    CHECK(target_covariance({1, 0, 0, 0}, scales, TargetShape::anisotropic) ==
          kIsotropicTarget * Eigen::Matrix3f::Identity());
  CHECK(target_covariance({0, 0, 0, 0}, {1, 1, 1}, TargetShape::anisotropic).allFinite());
}
