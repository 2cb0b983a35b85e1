// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <utility>

namespace langgs {

/// Eigenvalues, ascending, and unit eigenvectors (columns, in the same order) of a symmetric matrix.
template <int N>
struct SymmetricEigen {
  Eigen::Matrix<double, N, 1> values;
  Eigen::Matrix<double, N, N> vectors;
};

/// Cyclic Jacobi rotations, to rounding. Eigen's own solver of a fixed 6 x 6 matrix takes the compiler ten seconds.
template <int N>
[[nodiscard]] SymmetricEigen<N> symmetric_eigen(Eigen::Matrix<double, N, N> a) {
  constexpr int kMaxSweeps = 30;  // six are usual
  SymmetricEigen<N> result;
  result.vectors.setIdentity();
  for (int sweep = 0; sweep < kMaxSweeps; ++sweep) {
    double off_diagonal = 0, diagonal = 0;
    for (int i = 0; i < N; ++i) {
      diagonal += a(i, i) * a(i, i);
      for (int j = 0; j < i; ++j) off_diagonal += a(i, j) * a(i, j);
    }
    if (!(off_diagonal > 1e-32 * diagonal)) break;
    for (int p = 0; p < N; ++p)
      for (int q = p + 1; q < N; ++q) {
        if (a(p, q) == 0) continue;
        const double theta = (a(q, q) - a(p, p)) / (2 * a(p, q));
        const double t = (theta >= 0 ? 1 : -1) / (std::abs(theta) + std::sqrt(theta * theta + 1));
        const double c = 1 / std::sqrt(t * t + 1), s = t * c;
        for (int k = 0; k < N; ++k) {
          const double kp = a(k, p), kq = a(k, q);
          a(k, p) = c * kp - s * kq;
          a(k, q) = s * kp + c * kq;
        }
        for (int k = 0; k < N; ++k) {
          const double pk = a(p, k), qk = a(q, k);
          a(p, k) = c * pk - s * qk;
          a(q, k) = s * pk + c * qk;
        }
        for (int k = 0; k < N; ++k) {
          const double kp = result.vectors(k, p), kq = result.vectors(k, q);
          result.vectors(k, p) = c * kp - s * kq;
          result.vectors(k, q) = s * kp + c * kq;
        }
      }
  }
  for (int i = 0; i < N; ++i) {
    int least = i;
    for (int j = i + 1; j < N; ++j)
      if (a(j, j) < a(least, least)) least = j;
    if (least != i) {
      std::swap(a(i, i), a(least, least));
      result.vectors.col(i).swap(result.vectors.col(least));
    }
    result.values[i] = a(i, i);
  }
  return result;
}

}  // namespace langgs
