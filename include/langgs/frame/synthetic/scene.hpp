// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <numbers>
#include <vector>

#include "langgs/frame/synthetic/classes.hpp"
#include "langgs/frame/synthetic/material.hpp"
#include "langgs/frame/synthetic/shape.hpp"

/// @file A room and the solids in it.

namespace langgs::detail {

/// The shell is the box [0, size]; its faces are numbered 2 * axis + (1 on the far side) and have materials of their
/// own.
struct Scene {
  Eigen::Vector3d size{5.0, 4.2, 2.6};
  int shell_materials[6] = {};
  std::vector<Material> materials;
  std::vector<Shape> shapes;
  Eigen::Vector3d light{2.3, 1.9, 2.1};
  std::uint64_t seed = 0;

  int add_material(const Material& material) {
    materials.push_back(material);
    return static_cast<int>(materials.size()) - 1;
  }

  [[nodiscard]] std::uint16_t label(const SurfaceHit& hit) const {
    if (hit.shape >= 0) return shapes[hit.shape].label;
    return hit.face == 4 ? kFloor : hit.face == 5 ? kCeiling : kWall;
  }

  /// Where a ray from inside leaves the shell.
  [[nodiscard]] SurfaceHit leave_shell(const Ray& ray) const {
    SurfaceHit hit;
    for (int axis = 0; axis < 3; ++axis) {
      const bool upward = ray.direction[axis] > 0;
      const double t = ((upward ? size[axis] : 0.0) - ray.origin[axis]) / ray.direction[axis];
      if (t < hit.t) {
        hit.t = t;
        hit.face = 2 * axis + (upward ? 1 : 0);
      }
    }
    return hit;
  }

  [[nodiscard]] Eigen::Vector3d normal(const SurfaceHit& hit, const Eigen::Vector3d& point) const {
    if (hit.shape >= 0) return shapes[hit.shape].normal(shapes[hit.shape].to_unit(point), hit.face);
    Eigen::Vector3d n = Eigen::Vector3d::Zero();
    n[hit.face / 2] = hit.face % 2 ? -1 : 1;
    return n;
  }

  [[nodiscard]] const Material& material(const SurfaceHit& hit) const {
    return materials[hit.shape >= 0 ? shapes[hit.shape].material : shell_materials[hit.face]];
  }

  /// Linear colour of a surface before lighting.
  [[nodiscard]] Rgb albedo(const SurfaceHit& hit, const Eigen::Vector3d& point, double footprint) const {
    Eigen::Vector3d local = point;
    if (hit.shape >= 0) local = shapes[hit.shape].to_unit(point).cwiseProduct(shapes[hit.shape].half);
    // Each solid is cut from its own place of the noise.
    const Eigen::Vector3d solid = local + Eigen::Vector3d{3.7, 1.9, 5.3} * (hit.shape + 1);
    return surface_colour(material(hit), surface_coordinates(hit, local), solid, footprint, seed);
  }

 private:
  [[nodiscard]] Eigen::Vector2d surface_coordinates(const SurfaceHit& hit, const Eigen::Vector3d& p) const {
    const bool round = hit.shape >= 0 && shapes[hit.shape].solid != Solid::kBox;
    if (round && hit.face == 0) {
      const double around = std::atan2(p.y(), p.x()) * shapes[hit.shape].half.x();
      return {around, p.z()};
    }
    const int axis = round ? 2 : hit.face / 2;
    if (axis == 0) return {p.y(), p.z()};
    if (axis == 1) return {p.x(), p.z()};
    return {p.x(), p.y()};
  }
};

/// Puts the parts of one thing into the scene: coordinates are those of the thing, whose foot stands at `place`.
class Placer {
 public:
  Placer(Scene& scene, Label label, const Eigen::Vector3d& place, double yaw_degrees = 0)
      : scene_(scene), label_(label), place_(place), turn_(about_z(yaw_degrees)) {}

  Placer& as(Label label) {
    label_ = label;
    return *this;
  }
  Placer& box(const Eigen::Vector3d& centre, const Eigen::Vector3d& size, int material, double yaw_degrees = 0) {
    return add(Solid::kBox, centre, 0.5 * size, material, about_z(yaw_degrees));
  }
  Placer& ellipsoid(const Eigen::Vector3d& centre, const Eigen::Vector3d& radii, int material,
                    const Eigen::Matrix3d& attitude = Eigen::Matrix3d::Identity()) {
    return add(Solid::kEllipsoid, centre, radii, material, attitude);
  }
  /// An upright cylinder or frustum standing on `foot`.
  Placer& frustum(const Eigen::Vector3d& foot, double radius, double height, int material, double taper = 1) {
    const Eigen::Vector3d centre = foot + Eigen::Vector3d{0, 0, 0.5 * height};
    add(Solid::kFrustum, centre, {radius, radius, 0.5 * height}, material, Eigen::Matrix3d::Identity());
    scene_.shapes.back().taper = taper;
    if (taper > 1) scene_.shapes.back().bounding_radius = Eigen::Vector2d{radius * taper, 0.5 * height}.norm();
    return *this;
  }
  Placer& solid(Solid kind, const Eigen::Vector3d& centre, const Eigen::Vector3d& half, int material,
                const Eigen::Matrix3d& attitude) {
    return add(kind, centre, half, material, attitude);
  }
  /// The part added last lets light through.
  Placer& shadowless() {
    scene_.shapes.back().casts_shadow = false;
    return *this;
  }

  static Eigen::Matrix3d about_z(double degrees) {
    return Eigen::AngleAxisd(degrees * std::numbers::pi / 180, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  }

 private:
  Placer& add(Solid kind, const Eigen::Vector3d& centre, const Eigen::Vector3d& half, int material,
              const Eigen::Matrix3d& attitude) {
    Shape shape = Shape::make(kind, place_ + turn_ * centre, turn_ * attitude, half);
    shape.label = label_;
    shape.material = material;
    scene_.shapes.push_back(shape);
    return *this;
  }

  Scene& scene_;
  Label label_;
  Eigen::Vector3d place_;
  Eigen::Matrix3d turn_;
};

}  // namespace langgs::detail
