// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "langgs/core/config.hpp"
#include "langgs/core/error.hpp"

/// @file The pinhole camera. Axes: x right, y down, z forward. Pixel centres lie at integer indices.

namespace langgs {

/// Pinhole intrinsics: u = fx X/Z + cx, v = fy Y/Z + cy, in pixels of a width x height image. Trivially copyable.
struct Camera {
  float fx = 0, fy = 0;  ///< focal lengths [px]
  float cx = 0, cy = 0;  ///< principal point [px]
  int width = 0, height = 0;

  friend bool operator==(const Camera&, const Camera&) = default;

  [[nodiscard]] LANGGS_HD int num_pixels() const { return width * height; }

  /// Pixel of a point in camera coordinates; z must be positive.
  [[nodiscard]] Eigen::Vector2d project(const Eigen::Vector3d& point) const {
    return {fx * point.x() / point.z() + cx, fy * point.y() / point.z() + cy};
  }

  /// Point in camera coordinates seen at pixel (u, v) at depth z [m] (along the optical axis, not along the ray).
  [[nodiscard]] Eigen::Vector3d back_project(double u, double v, double z) const {
    return {(u - cx) / fx * z, (v - cy) / fy * z, z};
  }

  /// The camera of the same lens with an image of another size; pixel centres stay at integer indices.
  [[nodiscard]] Camera resized(int new_width, int new_height) const {
    const float sx = static_cast<float>(new_width) / static_cast<float>(width);
    const float sy = static_cast<float>(new_height) / static_cast<float>(height);
    return {fx * sx, fy * sy, (cx + 0.5f) * sx - 0.5f, (cy + 0.5f) * sy - 0.5f, new_width, new_height};
  }
};

/// Throws InvalidArgument unless the intrinsics describe a usable camera.
inline void validate(const Camera& camera) {
  constexpr int kMaxSide = 16384;  // 16-bit pixel coordinates with head room
  LANGGS_EXPECTS(camera.width > 0 && camera.height > 0 && camera.width <= kMaxSide && camera.height <= kMaxSide,
                 "camera image is ", camera.width, "x", camera.height, "; each side must be in [1, ", kMaxSide, "]");
  LANGGS_EXPECTS(camera.fx > 0 && camera.fy > 0 && camera.fx < 1e6f && camera.fy < 1e6f, "focal length is (", camera.fx,
                 ", ", camera.fy, ") px; it must be positive: check fx fy of the calibration");
  LANGGS_EXPECTS(camera.cx > -1e6f && camera.cx < 1e6f && camera.cy > -1e6f && camera.cy < 1e6f, "principal point is (",
                 camera.cx, ", ", camera.cy, ") px; check cx cy of the calibration");
}

}  // namespace langgs
