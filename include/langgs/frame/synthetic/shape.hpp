// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>

/// @file Solids of the synthetic room and where a ray meets them.

namespace langgs::detail {

struct Ray {
  Eigen::Vector3d origin;
  Eigen::Vector3d direction;  ///< any length; hits are reported as multiples of it
};

enum class Solid : std::uint8_t { kBox, kEllipsoid, kFrustum };

/// Where a ray meets a surface. `face` tells the sides of a solid apart; t is infinite when nothing was met.
struct SurfaceHit {
  double t = INFINITY;
  int shape = -1;  ///< -1: the shell of the room
  int face = 0;
};

/// A unit solid under an affine map: the box [-1, 1]^3, the unit ball, or the upright frustum of radius 1 at z = -1
/// and `taper` at z = 1. The map keeps the ray parameter, so one intersection routine serves every size and attitude.
struct Shape {
  Solid solid = Solid::kBox;
  bool casts_shadow = true;
  std::uint16_t label = 0;
  int material = 0;
  double taper = 1;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  Eigen::Vector3d half = Eigen::Vector3d::Ones();  ///< half extents along the local axes [m]
  Eigen::Matrix3d world_to_unit = Eigen::Matrix3d::Identity();
  double bounding_radius = 0;

  static Shape make(Solid solid, const Eigen::Vector3d& centre, const Eigen::Matrix3d& R_world_local,
                    const Eigen::Vector3d& half) {
    Shape shape;
    shape.solid = solid;
    shape.centre = centre;
    shape.half = half;
    shape.world_to_unit = half.cwiseInverse().asDiagonal() * R_world_local.transpose();
    shape.bounding_radius = solid == Solid::kEllipsoid ? half.maxCoeff() : half.norm();
    return shape;
  }

  [[nodiscard]] Eigen::Vector3d to_unit(const Eigen::Vector3d& point) const { return world_to_unit * (point - centre); }

  /// Replaces `hit` (t and face) if the ray enters this solid from outside before it.
  [[nodiscard]] bool intersect(const Ray& ray, SurfaceHit& hit) const {
    const Eigen::Vector3d offset = centre - ray.origin;
    const double length2 = ray.direction.squaredNorm(), along = offset.dot(ray.direction);
    const double radius2 = bounding_radius * bounding_radius;
    if ((offset.squaredNorm() - radius2) * length2 > along * along) return false;  // passes the bounding ball by
    const Eigen::Vector3d o = to_unit(ray.origin);
    const Eigen::Vector3d d = world_to_unit * ray.direction;
    switch (solid) {
      case Solid::kBox:
        return enter_box(o, d, hit);
      case Solid::kEllipsoid:
        return enter_ball(o, d, hit);
      case Solid::kFrustum:
        return enter_frustum(o, d, hit);
    }
    return false;
  }

  /// Outward unit normal in the world at a point on side `face`, given in unit coordinates.
  [[nodiscard]] Eigen::Vector3d normal(const Eigen::Vector3d& unit_point, int face) const {
    Eigen::Vector3d n = unit_point;
    if (solid == Solid::kBox) {
      n.setZero();
      n[face / 2] = face % 2 ? 1 : -1;
    } else if (solid == Solid::kFrustum) {
      const double slope = 0.5 * (taper - 1);
      const double radius = 0.5 * (taper + 1) + slope * unit_point.z();
      n = face == 0 ? Eigen::Vector3d{unit_point.x(), unit_point.y(), -slope * radius}
                    : Eigen::Vector3d{0, 0, face == 1 ? -1.0 : 1.0};
    }
    return (world_to_unit.transpose() * n).normalized();
  }

 private:
  static constexpr double kMinT = 1e-6;  // a ray that starts on a surface does not meet it again

  static bool accept(double t, int face, SurfaceHit& hit) {
    if (!(t > kMinT && t < hit.t)) return false;
    hit.t = t;
    hit.face = face;
    return true;
  }

  static bool enter_box(const Eigen::Vector3d& o, const Eigen::Vector3d& d, SurfaceHit& hit) {
    double enter = -INFINITY, leave = INFINITY;
    int face = 0;
    for (int axis = 0; axis < 3; ++axis) {
      const double inverse = 1 / d[axis];
      const bool from_above = inverse < 0;
      const double near = ((from_above ? 1 : -1) - o[axis]) * inverse;
      const double far = ((from_above ? -1 : 1) - o[axis]) * inverse;
      if (near > enter) {
        enter = near;
        face = 2 * axis + (from_above ? 1 : 0);
      }
      leave = std::min(leave, far);
    }
    return enter <= leave && accept(enter, face, hit);
  }

  static bool enter_ball(const Eigen::Vector3d& o, const Eigen::Vector3d& d, SurfaceHit& hit) {
    const double a = d.squaredNorm(), b = o.dot(d), c = o.squaredNorm() - 1;
    const double discriminant = b * b - a * c;
    return discriminant > 0 && accept((-b - std::sqrt(discriminant)) / a, 0, hit);
  }

  bool enter_frustum(const Eigen::Vector3d& o, const Eigen::Vector3d& d, SurfaceHit& hit) const {
    const double slope = 0.5 * (taper - 1);
    const double radius = 0.5 * (taper + 1) + slope * o.z();  // of the cone at the height of the origin
    bool entered = false;
    const double a = d.x() * d.x() + d.y() * d.y() - slope * slope * d.z() * d.z();
    const double b = o.x() * d.x() + o.y() * d.y() - radius * slope * d.z();
    const double c = o.x() * o.x() + o.y() * o.y() - radius * radius;
    const double discriminant = b * b - a * c;
    if (discriminant > 0 && std::abs(a) > 1e-12) {
      const double root = std::sqrt(discriminant);
      for (const double t : {(-b - root) / a, (-b + root) / a}) {
        const bool on_side = std::abs(o.z() + t * d.z()) <= 1 && radius + slope * t * d.z() >= 0;
        if (on_side && accept(t, 0, hit)) entered = true;
      }
    }
    for (int cap = 0; cap < 2; ++cap) {
      const double t = ((cap ? 1 : -1) - o.z()) / d.z();
      const double x = o.x() + t * d.x(), y = o.y() + t * d.y(), limit = cap ? taper : 1;
      if (x * x + y * y <= limit * limit && accept(t, 1 + cap, hit)) entered = true;
    }
    return entered;
  }
};

/// What a viewer can see of a solid, in the plane at distance 1: u = x/z, v = y/z. Empty if u0 > u1.
struct ViewExtent {
  double u0 = 1, u1 = -1, v0 = 1, v1 = -1;
  double nearest = 0;  ///< smallest z of the solid
};

/// Extent of a solid whose local box is grown by `margin` [m], seen from `eye`; the columns of `axes` are the viewer's
/// x, y and z in the world. Never too small.
[[nodiscard]] inline ViewExtent view_extent(const Shape& shape, double margin, const Eigen::Vector3d& eye,
                                            const Eigen::Matrix3d& axes) {
  constexpr double kNear = 1e-6;
  const double widest = std::max(1.0, shape.taper);
  const Eigen::Vector3d half = shape.half.cwiseProduct(Eigen::Vector3d{widest, widest, 1}).array() + margin;
  const Eigen::Matrix3d local_axes = (shape.half.asDiagonal() * shape.world_to_unit).transpose();
  ViewExtent extent{INFINITY, -INFINITY, INFINITY, -INFINITY, INFINITY};
  Eigen::Vector3d low = Eigen::Vector3d::Constant(INFINITY), high = -low;
  for (int corner = 0; corner < 8; ++corner) {
    const Eigen::Vector3d sign{corner & 1 ? 1.0 : -1.0, corner & 2 ? 1.0 : -1.0, corner & 4 ? 1.0 : -1.0};
    const Eigen::Vector3d p = axes.transpose() * (shape.centre + local_axes * sign.cwiseProduct(half) - eye);
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
    if (p.z() <= kNear) continue;
    extent.u0 = std::min(extent.u0, p.x() / p.z());
    extent.u1 = std::max(extent.u1, p.x() / p.z());
    extent.v0 = std::min(extent.v0, p.y() / p.z());
    extent.v1 = std::max(extent.v1, p.y() / p.z());
  }
  extent.nearest = low.z();
  if (high.z() <= kNear) return {};
  if (low.z() <= kNear) {
    // The image of a box that reaches behind the viewer runs to infinity on the sides where the box is.
    if (low.x() <= 0) extent.u0 = -INFINITY;
    if (high.x() >= 0) extent.u1 = INFINITY;
    if (low.y() <= 0) extent.v0 = -INFINITY;
    if (high.y() >= 0) extent.v1 = INFINITY;
  }
  return extent;
}

}  // namespace langgs::detail
