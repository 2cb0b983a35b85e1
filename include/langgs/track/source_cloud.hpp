// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "langgs/core/camera.hpp"
#include "langgs/core/error.hpp"
#include "langgs/core/pose.hpp"
#include "langgs/frame/rgbd_frame.hpp"
#include "langgs/host/worker_pool.hpp"
#include "langgs/track/intensity_image.hpp"

/// @file Depth image -> grid cloud with the local surface shape of every point.

namespace langgs {

/// The smallest standard deviation of a local shape [m]: an exactly flat patch must keep a finite logarithm.
inline constexpr float kMinShapeScale = 1e-5f;

struct SourceCloudSettings {
  int stride = 5;            ///< grid spacing [px]
  float depth_trunc = 4.0f;  ///< deeper points become Gaussians but are not tracked against [m]
  float max_depth = 50.0f;   ///< deeper readings are taken for sensor errors and dropped [m]
  /// A neighbour belongs to the same surface if its depth differs by less than this fraction of the depth. At a stride
  /// of 5 px and f = 520 px, 0.05 keeps surfaces up to 79 degrees from frontal.
  float edge_depth_ratio = 0.05f;
  int min_neighbours = 8;         ///< fewer samples on the same surface (itself included): not trackable
  float plane_thickness = 1e-3f;  ///< variance across the surface relative to along it, in the G-ICP covariance
  /// Standard deviation of depth noise_floor + noise_z z + noise_z2 z^2 [m]: points weigh as its inverse square. The
  /// floor is the noise of the map itself, which does not grow. The defaults are those of structured light (Nguyen et
  /// al. 2012); see time_of_flight.
  float noise_floor = 0.003f;
  float noise_z = 0;         ///< [1]
  float noise_z2 = 0.0019f;  ///< [1/m]
  int intensity_square = 4;  ///< grey values are averages over squares of this side [px]
};

/// For a time-of-flight camera, whose noise grows with the distance, not with its square.
[[nodiscard]] inline SourceCloudSettings time_of_flight(SourceCloudSettings settings = {}) {
  settings.noise_z = 0.001f;
  settings.noise_z2 = 0;
  return settings;
}

/// A frame's grid cloud, structure of arrays, all of length N. Camera frame, metres.
struct SourceCloud {
  std::vector<Eigen::Vector3f> points;       ///< [N, 3]
  std::vector<Eigen::Vector2i> pixels;       ///< [N, 2] (u, v) in the image
  std::vector<Eigen::Vector4f> rotations;    ///< [N, 4] unit quaternions w, x, y, z; axes by descending scale
  std::vector<Eigen::Vector3f> scales;       ///< [N, 3] standard deviations, descending, >= kMinShapeScale
  std::vector<Eigen::Matrix3f> covariances;  ///< [N, 3, 3] regularised for G-ICP: (1, 1, plane_thickness), no unit
  std::vector<float> weights;                ///< [N] weight in the registration, in (0, 1]
  std::vector<std::uint8_t> trackable;       ///< [N] 1 where the point takes part in the registration
  IntensityImage intensity;                  ///< of the frame's colour; empty without
  Pose T_colour_depth = Pose::Identity();    ///< where depth was taken, seen from where colour was

  [[nodiscard]] int size() const { return static_cast<int>(points.size()); }
  [[nodiscard]] int num_trackable() const {
    return static_cast<int>(std::count(trackable.begin(), trackable.end(), std::uint8_t{1}));
  }

  void resize(int n) {
    points.resize(n);
    pixels.resize(n);
    rotations.resize(n);
    scales.resize(n);
    covariances.resize(n);
    weights.resize(n);
    trackable.resize(n);
  }
};

inline void validate(const SourceCloudSettings& s) {
  LANGGS_EXPECTS(s.stride >= 1 && s.stride <= 1024, "stride is ", s.stride, " px; it must be in [1, 1024]");
  LANGGS_EXPECTS(s.depth_trunc > 0 && s.max_depth > 0 && s.max_depth <= 1e4f, "depth limits are ", s.depth_trunc,
                 " and ", s.max_depth, " m; they must be positive, max_depth at most 10000");
  LANGGS_EXPECTS(s.edge_depth_ratio > 0, "edge_depth_ratio is ", s.edge_depth_ratio, "; it must be positive");
  LANGGS_EXPECTS(s.min_neighbours >= 3 && s.min_neighbours <= 25, "min_neighbours is ", s.min_neighbours,
                 "; it must be in [3, 25], a plane needs three points and the window has 25");
  LANGGS_EXPECTS(s.plane_thickness > 0 && s.plane_thickness <= 1, "plane_thickness is ", s.plane_thickness,
                 "; it must be in (0, 1]");
  LANGGS_EXPECTS(s.noise_floor > 0 && s.noise_z >= 0 && s.noise_z2 >= 0, "depth noise is ", s.noise_floor, " + ",
                 s.noise_z, " z + ", s.noise_z2, " z^2; the floor must be positive, the growth not negative");
  LANGGS_EXPECTS(s.intensity_square >= 1 && s.intensity_square <= 64, "intensity_square is ", s.intensity_square,
                 " px; it must be in [1, 64]");
}

namespace detail {

/// Local surface shape: axes (columns, proper rotation, largest variance first) and variances [m^2].
struct LocalShape {
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();
  Eigen::Vector3d variances = Eigen::Vector3d::Zero();
};

/// Principal axes of a covariance. The third axis is the cross product of the first two, so that the axes are a proper
/// rotation: a reflection has no quaternion.
[[nodiscard]] inline LocalShape principal_shape(const Eigen::Matrix3d& covariance) {
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
  solver.computeDirect(covariance);
  LocalShape shape;
  if (!solver.eigenvectors().allFinite() || !solver.eigenvalues().allFinite()) return shape;
  const Eigen::Vector3d x = solver.eigenvectors().col(2).normalized();
  Eigen::Vector3d y = solver.eigenvectors().col(1);
  y -= x.dot(y) * x;
  y = y.squaredNorm() > 1e-6 ? y.normalized() : x.unitOrthogonal();
  shape.axes << x, y, x.cross(y);
  shape.variances = solver.eigenvalues().reverse().cwiseMax(0.0);
  return shape;
}

[[nodiscard]] inline bool is_usable_depth(float z, float max_depth) { return z > 0 && z <= max_depth; }  // NaN: false

/// Covariance of the points seen in the 5x5 window around (u, v) that lie on the same surface; returns how many. The
/// window reaches one grid step each way, as far as the nearest neighbours in the grid cloud would.
[[nodiscard]] inline int window_covariance(const Image<float>& depth, const Camera& camera, Eigen::Vector2i pixel,
                                           const SourceCloudSettings& settings, Eigen::Matrix3d& covariance) {
  const int half = std::max(1, settings.stride / 2);
  const int full = std::max(2, settings.stride);
  const int offsets[5] = {-full, -half, 0, half, full};
  const float z0 = depth(pixel.x(), pixel.y());
  const float tolerance = settings.edge_depth_ratio * z0;
  const double x0 = pixel.x() - static_cast<double>(camera.cx), y0 = pixel.y() - static_cast<double>(camera.cy);
  // Sums relative to the centre, in units where x and y still lack their focal lengths: variances of 1e-7 m^2 must
  // survive the subtraction of the mean, and a division for each sample would cost half of the time.
  double x = 0, y = 0, z = 0, xx = 0, xy = 0, xz = 0, yy = 0, yz = 0, zz = 0;
  int count = 0;
  for (const int dv : offsets) {
    const int v = pixel.y() + dv;
    if (v < 0 || v >= camera.height) continue;
    for (const int du : offsets) {
      const int u = pixel.x() + du;
      if (u < 0 || u >= camera.width) continue;
      const float sample = depth(u, v);
      if (!(std::abs(sample - z0) <= tolerance)) continue;  // NaN fails too
      const double dz = sample - z0;
      const double dx = (x0 + du) * dz + du * static_cast<double>(z0);
      const double dy = (y0 + dv) * dz + dv * static_cast<double>(z0);
      x += dx, y += dy, z += dz;
      xx += dx * dx, xy += dx * dy, xz += dx * dz, yy += dy * dy, yz += dy * dz, zz += dz * dz;
      ++count;
    }
  }
  const Eigen::Vector3d unit(1.0 / camera.fx, 1.0 / camera.fy, 1.0);
  const Eigen::Vector3d mean = Eigen::Vector3d(x, y, z) / count;  // the centre itself always counts
  Eigen::Matrix3d moment;
  moment << xx, xy, xz, xy, yy, yz, xz, yz, zz;
  covariance = unit.asDiagonal() * (moment / count - mean * mean.transpose()) * unit.asDiagonal();
  return count;
}

inline void describe_point(const Image<float>& depth, const Camera& camera, const SourceCloudSettings& settings, int i,
                           SourceCloud& cloud) {
  const Eigen::Vector2i pixel = cloud.pixels[i];
  const float z = depth(pixel.x(), pixel.y());
  cloud.points[i] = camera.back_project(pixel.x(), pixel.y(), z).cast<float>();
  Eigen::Matrix3d covariance;
  const int count = window_covariance(depth, camera, pixel, settings, covariance);
  LocalShape shape = principal_shape(covariance);
  const double spacing = static_cast<double>(z) * settings.stride / camera.fx;
  // Two directions must be spanned, else the normal means nothing.
  const bool surface = count >= settings.min_neighbours && shape.variances[1] > 1e-2 * spacing * spacing;
  if (!surface) {
    shape.axes.setIdentity();
    shape.variances.setConstant(spacing * spacing);
  }
  const Eigen::Quaterniond q = Eigen::Quaterniond(shape.axes).normalized();
  cloud.rotations[i] = Eigen::Vector4d(q.w(), q.x(), q.y(), q.z()).cast<float>();
  cloud.scales[i] = shape.variances.cwiseSqrt().cast<float>().cwiseMax(kMinShapeScale);
  const Eigen::Vector3d normal = shape.axes.col(2);
  cloud.covariances[i] =
      (Eigen::Matrix3d::Identity() - (1.0 - settings.plane_thickness) * normal * normal.transpose()).cast<float>();
  const float relative_noise =
      settings.noise_floor / (settings.noise_floor + z * (settings.noise_z + z * settings.noise_z2));
  cloud.weights[i] = relative_noise * relative_noise;
  cloud.trackable[i] = surface && z <= settings.depth_trunc;
}

}  // namespace detail

/// Grid cloud of a frame (A.4, A.5). Pixels without a usable depth (0, negative, NaN, infinite, beyond max_depth) are
/// left out. Throws InvalidArgument if the depth image is not [camera.height, camera.width].
[[nodiscard]] inline SourceCloud make_source_cloud(const RgbdFrame& frame, const Camera& camera,
                                                   const SourceCloudSettings& settings, WorkerPool& pool) {
  validate(camera);
  validate(settings);
  const Image<float>& depth = frame.depth;
  LANGGS_EXPECTS(depth.width() == camera.width && depth.height() == camera.height && depth.channels() == 1,
                 "depth image is [", depth.height(), ", ", depth.width(), ", ", depth.channels(),
                 "]; the camera expects [", camera.height, ", ", camera.width, ", 1]");
  SourceCloud cloud;
  for (int v = settings.stride / 2; v < camera.height; v += settings.stride)
    for (int u = settings.stride / 2; u < camera.width; u += settings.stride)
      if (detail::is_usable_depth(depth(u, v), settings.max_depth)) cloud.pixels.emplace_back(u, v);

  const int n = static_cast<int>(cloud.pixels.size());
  cloud.resize(n);
  constexpr int kChunk = 512;
  pool.run((n + kChunk - 1) / kChunk, [&](int chunk) {
    for (int i = chunk * kChunk; i < std::min(n, (chunk + 1) * kChunk); ++i)
      detail::describe_point(depth, camera, settings, i, cloud);
  });
  cloud.intensity = make_intensity_image(frame.colour, camera, settings.intensity_square, pool);
  return cloud;
}

}  // namespace langgs
