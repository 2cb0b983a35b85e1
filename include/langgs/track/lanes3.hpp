// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "langgs/core/pose.hpp"
#include "langgs/host/varying.hpp"

/// @file Vectors and symmetric matrices of 32 points, one per lane.

namespace langgs::detail {

struct Lanes3 {
  using Float = host::Varying<float>;
  Float x, y, z;

  LANGGS_HOST_INLINE friend Lanes3 operator-(const Lanes3& a, const Lanes3& b) {
    return {a.x - b.x, a.y - b.y, a.z - b.z};
  }
  LANGGS_HOST_INLINE friend Lanes3 select(const host::Mask& mask, const Lanes3& a, const Lanes3& b) {
    return {select(mask, a.x, b.x), select(mask, a.y, b.y), select(mask, a.z, b.z)};
  }
};

LANGGS_HOST_INLINE Lanes3::Float dot(const Lanes3& a, const Lanes3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
LANGGS_HOST_INLINE Lanes3 cross(const Lanes3& a, const Lanes3& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
struct SymmetricLanes3 {
  using Float = host::Varying<float>;
  Float xx, xy, xz, yy, yz, zz;

  LANGGS_HOST_INLINE friend SymmetricLanes3 operator+(const SymmetricLanes3& a, const SymmetricLanes3& b) {
    return {a.xx + b.xx, a.xy + b.xy, a.xz + b.xz, a.yy + b.yy, a.yz + b.yz, a.zz + b.zz};
  }
  LANGGS_HOST_INLINE friend SymmetricLanes3 operator*(const Float& s, const SymmetricLanes3& m) {
    return {s * m.xx, s * m.xy, s * m.xz, s * m.yy, s * m.yz, s * m.zz};
  }
  LANGGS_HOST_INLINE friend Lanes3 operator*(const SymmetricLanes3& m, const Lanes3& v) {
    return {m.xx * v.x + m.xy * v.y + m.xz * v.z, m.xy * v.x + m.yy * v.y + m.yz * v.z,
            m.xz * v.x + m.yz * v.y + m.zz * v.z};
  }
  LANGGS_HOST_INLINE friend SymmetricLanes3 select(const host::Mask& mask, const SymmetricLanes3& a,
                                                   const SymmetricLanes3& b) {
    return {select(mask, a.xx, b.xx), select(mask, a.xy, b.xy), select(mask, a.xz, b.xz),
            select(mask, a.yy, b.yy), select(mask, a.yz, b.yz), select(mask, a.zz, b.zz)};
  }
  [[nodiscard]] LANGGS_HOST_INLINE Float trace() const { return xx + yy + zz; }
};

/// Not finite where the matrix has none.
LANGGS_HOST_INLINE SymmetricLanes3 inverse(const SymmetricLanes3& a) {
  const Lanes3::Float xx = a.yy * a.zz - a.yz * a.yz, xy = a.xz * a.yz - a.xy * a.zz, xz = a.xy * a.yz - a.xz * a.yy;
  const Lanes3::Float one_over_determinant = 1.f / (a.xx * xx + a.xy * xy + a.xz * xz);
  return one_over_determinant *
         SymmetricLanes3{xx, xy, xz, a.xx * a.zz - a.xz * a.xz, a.xy * a.xz - a.xx * a.yz, a.xx * a.yy - a.xy * a.xy};
}
/// A pose in single precision, the same for all lanes.
struct PlacementLanes3 {
  float r[3][3], t[3];

  explicit PlacementLanes3(const Pose& T) {
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) r[i][j] = static_cast<float>(T.linear()(i, j));
      t[i] = static_cast<float>(T.translation()[i]);
    }
  }
  /// Coordinate i of R p.
  [[nodiscard]] LANGGS_HOST_INLINE Lanes3::Float turned(int i, const Lanes3& p) const {
    return r[i][0] * p.x + r[i][1] * p.y + r[i][2] * p.z;
  }
  /// R p + t.
  LANGGS_HOST_INLINE friend Lanes3 operator*(const PlacementLanes3& T, const Lanes3& p) {
    return {T.turned(0, p) + T.t[0], T.turned(1, p) + T.t[1], T.turned(2, p) + T.t[2]};
  }
  /// R C R^T.
  [[nodiscard]] LANGGS_HOST_INLINE SymmetricLanes3 rotate(const SymmetricLanes3& c) const {
    Lanes3 rc[3];  // rows of R C
    for (int i = 0; i < 3; ++i)
      rc[i] = c * Lanes3{Lanes3::Float(r[i][0]), Lanes3::Float(r[i][1]), Lanes3::Float(r[i][2])};
    return {turned(0, rc[0]), turned(1, rc[0]), turned(2, rc[0]), turned(1, rc[1]), turned(2, rc[1]), turned(2, rc[2])};
  }
};

}  // namespace langgs::detail
