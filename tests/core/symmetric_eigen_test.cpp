// SPDX-License-Identifier: Apache-2.0
#include "langgs/core/symmetric_eigen.hpp"

#include <doctest/doctest.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <cstdint>
#include <limits>

#include "langgs/core/rng.hpp"

using langgs::CounterRng, langgs::symmetric_eigen, langgs::SymmetricEigen;

namespace {

using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Vector6 = Eigen::Matrix<double, 6, 1>;

Matrix6 random_matrix(std::uint64_t seed) {
  Matrix6 m;
  for (int i = 0; i < 36; ++i) m.data()[i] = CounterRng{seed}.normal(i);
  return m;
}

/// A rotation times diag(values) times its transpose, symmetric to the bit.
Matrix6 with_eigenvalues(const Vector6& values, std::uint64_t seed) {
  const Matrix6 q =
      Eigen::SelfAdjointEigenSolver<Matrix6>(random_matrix(seed) * random_matrix(seed).transpose()).eigenvectors();
  const Matrix6 m = q * values.asDiagonal() * q.transpose();
  return 0.5 * (m + m.transpose());
}

/// Values as Eigen finds them, vectors that are orthonormal and rebuild the matrix, all to rounding.
void check(const Matrix6& m) {
  const SymmetricEigen<6> found = symmetric_eigen<6>(m);
  const double scale = m.norm();
  const Eigen::SelfAdjointEigenSolver<Matrix6> expected(m);
  for (int i = 0; i < 6; ++i) CHECK(std::abs(found.values[i] - expected.eigenvalues()[i]) <= 1e-14 * scale);
  for (int i = 1; i < 6; ++i) CHECK(found.values[i - 1] <= found.values[i]);
  CHECK((found.vectors.transpose() * found.vectors - Matrix6::Identity()).norm() < 1e-13);
  CHECK((found.vectors * found.values.asDiagonal() * found.vectors.transpose() - m).norm() <= 1e-14 * scale);
  // Directions are comparable where a value stands alone.
  for (int i = 0; i < 6; ++i) {
    double gap = std::numeric_limits<double>::infinity();
    for (int j = 0; j < 6; ++j)
      if (j != i) gap = std::min(gap, std::abs(expected.eigenvalues()[i] - expected.eigenvalues()[j]));
    if (gap > 1e-3 * scale)
      CHECK(std::abs(found.vectors.col(i).dot(expected.eigenvectors().col(i))) == doctest::Approx(1).epsilon(1e-12));
  }
}

}  // namespace

TEST_CASE("eigenvalues and eigenvectors of random matrices") {
  for (std::uint64_t seed = 0; seed < 500; ++seed) {
    const Matrix6 a = random_matrix(seed);
    check(a * a.transpose());  // positive
    check(a + a.transpose());  // of both signs
    check(1e-12 * (a * a.transpose()));
    check(1e12 * (a * a.transpose()));
  }
}

TEST_CASE("singular matrices and equal eigenvalues") {
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    Vector6 values;
    values << 0, 0, 0, 1, 2, 3;
    check(with_eigenvalues(values, seed));
    values << 1, 1, 1, 5, 5, 5;
    check(with_eigenvalues(values, seed));
    values << 2, 2, 2, 2, 2, 2;
    check(with_eigenvalues(values, seed));
    values << 1e-14, 1e-9, 1e-4, 1, 1, 1e4;
    check(with_eigenvalues(values, seed));
    values << -3, -3, 0, 0, 3, 3;
    check(with_eigenvalues(values, seed));
    const Vector6 v = random_matrix(seed).col(0);
    check(v * v.transpose());  // rank one
  }
}

TEST_CASE("matrices without anything to rotate") {
  check(Matrix6::Zero());
  check(Matrix6::Identity());
  check(Matrix6::Ones());
  Vector6 values;
  values << 3, -1, 2, 0, 1e9, 1e-9;
  check(values.asDiagonal());
}

TEST_CASE("other sizes, and small values beside large ones") {
  Eigen::Matrix2d two;
  two << 2, 1, 1, 2;
  CHECK(symmetric_eigen<2>(two).values.isApprox(Eigen::Vector2d(1, 3), 1e-15));
  CHECK(symmetric_eigen<1>(Eigen::Matrix<double, 1, 1>(-4.0)).values[0] == -4);
  // Jacobi keeps the relative accuracy that a graded matrix deserves.
  Eigen::Matrix3d graded = Eigen::Vector3d(1e-12, 1, 1e12).asDiagonal();
  graded(0, 1) = graded(1, 0) = 1e-8;
  CHECK(symmetric_eigen<3>(graded).values[0] == doctest::Approx(1e-12 - 1e-16).epsilon(1e-6));
}
