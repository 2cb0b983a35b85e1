// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "langgs/core/camera.hpp"
#include "langgs/core/image.hpp"
#include "langgs/core/pose.hpp"
#include "langgs/track/source_cloud.hpp"

/// @file Depth that was taken at another moment than colour, brought to the place from where colour was taken.
///
/// A hand moves the camera by a centimetre in the 20 to 40 ms that lie between the two images of a Kinect: several
/// pixels. Tracking finds the pose of the depth image; everything behind it wants both images from one pose.

namespace langgs {

namespace detail {

/// Nearest pixel of a camera point; false where it lies outside of the image or behind the camera.
[[nodiscard]] inline bool pixel_of(const Camera& camera, const Eigen::Vector3d& point, Eigen::Vector2i& pixel) {
  if (!(point.z() > 0)) return false;
  const double u = camera.fx * point.x() / point.z() + camera.cx, v = camera.fy * point.y() / point.z() + camera.cy;
  if (!(u > -0.5 && u < camera.width - 0.5 && v > -0.5 && v < camera.height - 0.5)) return false;
  pixel = {static_cast<int>(std::lround(u)), static_cast<int>(std::lround(v))};
  return true;
}

}  // namespace detail

/// The depth image [H, W] as seen from the colour camera: every reading moved to the pixel where it appears, the nearer
/// one where two meet; 0 where none arrives.
[[nodiscard]] inline Image<float> depth_from_colour(const Image<float>& depth, const Camera& camera,
                                                    const Pose& T_colour_depth) {
  Image<float> result(depth.width(), depth.height());
  for (int v = 0; v < depth.height(); ++v)
    for (int u = 0; u < depth.width(); ++u) {
      const float z = depth(u, v);
      if (!(z > 0 && std::isfinite(z))) continue;
      const Eigen::Vector3d point = T_colour_depth * camera.back_project(u, v, z);
      Eigen::Vector2i pixel;
      if (!detail::pixel_of(camera, point, pixel)) continue;
      float& there = result(pixel.x(), pixel.y());
      const auto seen = static_cast<float>(point.z());
      if (there == 0 || seen < there) there = seen;
    }
  return result;
}

/// The cloud in the frame of the colour camera. Points that leave the image keep the pixel nearest to them.
inline void move_to_colour(SourceCloud& cloud, const Camera& camera, const Pose& T_colour_depth) {
  const Eigen::Quaternionf turn(T_colour_depth.linear().cast<float>());
  const Eigen::Matrix3f rotation = T_colour_depth.linear().cast<float>();
  for (int i = 0; i < cloud.size(); ++i) {
    const Eigen::Vector3d point = T_colour_depth * cloud.points[i].cast<double>();
    cloud.points[i] = point.cast<float>();
    Eigen::Vector2i pixel = cloud.pixels[i];
    if (detail::pixel_of(camera, point, pixel)) cloud.pixels[i] = pixel;
    const Eigen::Vector4f& q = cloud.rotations[i];
    const Eigen::Quaternionf turned = (turn * Eigen::Quaternionf(q[0], q[1], q[2], q[3])).normalized();
    cloud.rotations[i] = {turned.w(), turned.x(), turned.y(), turned.z()};
    cloud.covariances[i] = rotation * cloud.covariances[i] * rotation.transpose();
  }
  cloud.T_colour_depth.setIdentity();
}

}  // namespace langgs
