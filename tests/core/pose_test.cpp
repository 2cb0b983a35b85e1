// SPDX-License-Identifier: Apache-2.0
#include "langgs/core/pose.hpp"

#include <doctest/doctest.h>

#include <limits>
#include <numbers>

#include "langgs/core/rng.hpp"

namespace {

using Eigen::Matrix3d, Eigen::Matrix4d, Eigen::Vector3d;
using langgs::Pose, langgs::Twist;

constexpr double kPi = std::numbers::pi;

Vector3d random_direction(const langgs::CounterRng& rng, std::uint64_t i) {
  return Vector3d(rng.normal(3 * i), rng.normal(3 * i + 1), rng.normal(3 * i + 2)).normalized();
}

/// exp of a 4x4 twist matrix by its definition: scaling, power series, squaring; no closed form shared with the code.
Matrix4d matrix_exponential(const Twist& xi) {
  Matrix4d generator = Matrix4d::Zero();
  generator.topLeftCorner<3, 3>() = langgs::skew(xi.tail<3>());
  generator.topRightCorner<3, 1>() = xi.head<3>();
  generator /= 1024;
  Matrix4d sum = Matrix4d::Identity(), term = Matrix4d::Identity();
  for (int k = 1; k < 20; ++k) {
    term = term * generator / k;
    sum += term;
  }
  for (int i = 0; i < 10; ++i) sum = sum * sum;
  return sum;
}

// Around the switch to the series (1e-4), around the tiny-angle branch (1e-12), and up to pi.
constexpr double kAngles[] = {0,    1e-300, 1e-15, 0.99e-12, 1.01e-12, 1e-9, 1e-6, 0.99e-4,    1.01e-4,    1e-3,
                              0.01, 0.5,    1,     2,        3,        3.1,  3.14, kPi - 1e-4, kPi - 1e-6, kPi - 1e-9};

}  // namespace

TEST_CASE("skew is the cross product") {
  const Vector3d a(1, -2, 3), b(0.5, 4, -1);
  CHECK((langgs::skew(a) * b - a.cross(b)).norm() == 0);
}

TEST_CASE("so3_exp gives rotations, and so3_log undoes it up to pi") {
  const langgs::CounterRng rng{3, 0};
  for (std::uint64_t i = 0; i < 20; ++i) {
    const Vector3d axis = i < 3 ? Vector3d(Vector3d::Unit(static_cast<int>(i))) : random_direction(rng, i);
    for (const double angle : kAngles) {
      CAPTURE(i);
      CAPTURE(angle);
      const Matrix3d rotation = langgs::so3_exp(angle * axis);
      CHECK((rotation * rotation.transpose() - Matrix3d::Identity()).norm() < 1e-14);
      CHECK(rotation.determinant() == doctest::Approx(1).epsilon(1e-14));
      const Vector3d log = langgs::so3_log(rotation);
      CHECK(log.norm() <= kPi + 1e-12);
      CHECK((log - angle * axis).norm() < 1e-13 + 1e-14 * angle);
    }
  }
}

TEST_CASE("so3_log of a rotation by pi is one of the two half turns") {
  for (const Vector3d& axis : {Vector3d(1, 0, 0), Vector3d(0, 1, 0), Vector3d(0, 0, 1), Vector3d(1, 1, 0).normalized(),
                               Vector3d(-1, 2, -3).normalized()}) {
    const Matrix3d rotation = 2 * axis * axis.transpose() - Matrix3d::Identity();
    const Vector3d log = langgs::so3_log(rotation);
    CHECK(log.norm() == doctest::Approx(kPi));
    CHECK(std::abs(log.normalized().dot(axis)) == doctest::Approx(1));
  }
}

TEST_CASE("se3_exp is the exponential of the twist's matrix") {
  const langgs::CounterRng rng{4, 0};
  for (std::uint64_t i = 0; i < 20; ++i) {
    for (const double angle : kAngles) {
      CAPTURE(angle);
      Twist xi;
      xi << 2 * random_direction(rng, 2 * i), angle * random_direction(rng, 2 * i + 1);
      // The reference squares ten times: its own rounding is of the order 1e-13.
      CHECK((langgs::se3_exp(xi).matrix() - matrix_exponential(xi)).norm() < 1e-11);
    }
  }
}

TEST_CASE("se3_log undoes se3_exp, at small angles and near pi") {
  const langgs::CounterRng rng{5, 0};
  for (std::uint64_t i = 0; i < 20; ++i) {
    for (const double angle : kAngles) {
      CAPTURE(angle);
      Twist xi;
      xi << 3 * random_direction(rng, 2 * i), angle * random_direction(rng, 2 * i + 1);
      const Twist back = langgs::se3_log(langgs::se3_exp(xi));
      CHECK(back.allFinite());
      CHECK((back - xi).norm() < 1e-11);
    }
  }
}

TEST_CASE("the identity has a zero logarithm") {
  CHECK(langgs::se3_log(Pose::Identity()).norm() == 0);
  CHECK(langgs::se3_exp(Twist::Zero()).isApprox(Pose::Identity(), 0));
}

TEST_CASE("renormalized removes the drift of many compositions and keeps the translation") {
  Twist step;
  step << 0.01, -0.02, 0.005, 0.1, 0.2, -0.05;
  Pose pose = Pose::Identity();
  const Pose drifting = Pose(langgs::se3_exp(step).matrix() * (1 + 1e-7));
  for (int i = 0; i < 1000; ++i) pose = Pose(drifting.matrix() * pose.matrix());
  CHECK((pose.linear() * pose.linear().transpose() - Matrix3d::Identity()).norm() > 1e-5);
  const Pose clean = langgs::renormalized(pose);
  CHECK((clean.linear() * clean.linear().transpose() - Matrix3d::Identity()).norm() < 1e-14);
  CHECK((clean.linear() - pose.linear()).norm() < 1e-3);
  CHECK(clean.translation() == pose.translation());
}

TEST_CASE("is_finite sees every element") {
  Pose pose = Pose::Identity();
  CHECK(langgs::is_finite(pose));
  pose.translation().y() = std::numeric_limits<double>::quiet_NaN();
  CHECK_FALSE(langgs::is_finite(pose));
  pose = Pose::Identity();
  pose.linear()(2, 0) = std::numeric_limits<double>::infinity();
  CHECK_FALSE(langgs::is_finite(pose));
}
