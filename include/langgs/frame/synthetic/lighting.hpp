// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <vector>

#include "langgs/frame/synthetic/scene.hpp"

/// @file Light in the synthetic room: matt surfaces only, so that colour does not depend on where one looks from.

namespace langgs::detail {

/// A lamp of four points with shadows, a window without, and ambient light that fades in corners.
class Lighting {
 public:
  static constexpr int kWholeLamp = -1;

  explicit Lighting(const Scene& scene) : cells_(6 * kCells * kCells) {
    const auto cell_of = [](double slope) { return (slope + 1) * 0.5 * kCells; };
    for (int face = 0; face < 6; ++face) {
      Eigen::Matrix3d axes = Eigen::Matrix3d::Zero();
      axes((face / 2 + 1) % 3, 0) = axes((face / 2 + 2) % 3, 1) = 1;
      axes(face / 2, 2) = face % 2 ? 1 : -1;
      for (int i = 0; i < static_cast<int>(scene.shapes.size()); ++i) {
        const Shape& shape = scene.shapes[i];
        if (!shape.casts_shadow) continue;
        // A shadow ray starts off the centre: growing the solids by as much makes one list serve all points.
        const ViewExtent extent = view_extent(shape, 1.5 * kSpread, scene.light, axes);
        for (int v = 0; v < kCells; ++v) {
          for (int u = 0; u < kCells; ++u) {
            const bool apart = cell_of(extent.u0) > u + 1 || cell_of(extent.u1) < u || cell_of(extent.v0) > v + 1 ||
                               cell_of(extent.v1) < v;
            if (!apart) cells_[(face * kCells + v) * kCells + u].push_back(i);
          }
        }
      }
    }
  }

  /// Light that falls on a surface point from the window, the surroundings, and one of the lamp's four points or all.
  [[nodiscard]] Rgb at(const Scene& scene, const Eigen::Vector3d& point, const Eigen::Vector3d& normal,
                       int lamp_point) const {
    const Eigen::Vector3d to_window = Eigen::Vector3d{scene.size.x() - 0.05, 2.35, 1.6} - point;
    const double distance2 = to_window.squaredNorm();
    const double window = std::max(0.0, 0.15 + 0.85 * normal.dot(to_window) / std::sqrt(distance2)) / (distance2 + 2.5);
    const double ambient = (0.36 + 0.07 * normal.z()) * openness(scene, point, normal);
    const Rgb light = Rgb{0.78f, 0.92f, 1.1f} * static_cast<float>(1.2 * window) +
                      Rgb{1.f, 0.97f, 0.93f} * static_cast<float>(ambient);
    return light + Rgb{1.f, 0.92f, 0.78f} * static_cast<float>(2.6 * lamp(scene, point, normal, lamp_point));
  }

 private:
  static constexpr int kCells = 24;        // per side of a cube face: cells of about four degrees
  static constexpr double kSpread = 0.11;  // of the lamp's points [m]; gives shadows soft edges

  static const std::vector<int>& cell(const std::vector<std::vector<int>>& cells, const Eigen::Vector3d& d) {
    int axis = 0;
    const double largest = d.cwiseAbs().maxCoeff(&axis);
    const auto index = [&](double v) {
      return std::clamp(static_cast<int>((v / largest + 1) * 0.5 * kCells), 0, kCells - 1);
    };
    const int face = 2 * axis + (d[axis] > 0 ? 1 : 0);
    return cells[(face * kCells + index(d[(axis + 2) % 3])) * kCells + index(d[(axis + 1) % 3])];
  }

  [[nodiscard]] double lamp(const Scene& scene, const Eigen::Vector3d& point, const Eigen::Vector3d& normal,
                            int lamp_point) const {
    if (lamp_point != kWholeLamp) return lamp_from(scene, point, normal, lamp_point);
    // Where opposite points are both hidden or both in sight, so is nearly always the rest of the lamp.
    const double first = lamp_from(scene, point, normal, 0), last = lamp_from(scene, point, normal, 3);
    if ((first > 0) == (last > 0)) return 0.5 * (first + last);
    return 0.25 * (first + last + lamp_from(scene, point, normal, 1) + lamp_from(scene, point, normal, 2));
  }

  [[nodiscard]] double lamp_from(const Scene& scene, const Eigen::Vector3d& point, const Eigen::Vector3d& normal,
                                 int i) const {
    const Eigen::Vector3d source =
        scene.light + Eigen::Vector3d{i % 2 ? kSpread : -kSpread, i / 2 ? kSpread : -kSpread, 0};
    const Eigen::Vector3d to_lamp = source - point;
    const double facing = normal.dot(to_lamp);
    if (facing <= 0) return 0;
    const Ray ray{source, point + 1e-4 * normal - source};  // outwards: solids are entered from outside
    SurfaceHit hit;
    hit.t = 1;
    for (const int shape : cell(cells_, point - scene.light)) {
      if (scene.shapes[shape].intersect(ray, hit)) return 0;
    }
    const double distance2 = to_lamp.squaredNorm();
    return facing / (std::sqrt(distance2) * (distance2 + 1.3));
  }

  /// Darkens what is close to the shell of the room, except for what faces away from it.
  static double openness(const Scene& scene, const Eigen::Vector3d& point, const Eigen::Vector3d& normal) {
    double open = 1;
    for (int axis = 0; axis < 3; ++axis) {
      for (const bool far : {false, true}) {
        const double distance = std::max(0.0, far ? scene.size[axis] - point[axis] : point[axis]);
        const double facing = std::max(0.0, far ? -normal[axis] : normal[axis]);
        open *= 1 - 0.34 * (1 - facing) * std::exp(-distance / 0.28);
      }
    }
    return open;
  }

  std::vector<std::vector<int>> cells_;  // shapes that may stand between the lamp and a direction
};

}  // namespace langgs::detail
