// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <vector>

#include "langgs/core/rng.hpp"
#include "langgs/frame/synthetic_room.hpp"
#include "langgs/io/ply.hpp"
#include "langgs/map/gaussian_map.hpp"
#include "langgs/render/view.hpp"

/// @file What the rasteriser is timed on: a map and views that look at it.

namespace langgs::benchmarks {

struct Workload {
  GaussianMap<1> map;
  std::vector<View> views;
};

/// A folder with gs.ply (the usual layout of splats) and cameras.txt (a line a view: width, height, fx, fy, cx, cy and
/// the 3x4 matrix T_camera_world, row-major).
[[nodiscard]] inline Workload read_workload(const std::filesystem::path& folder) {
  Workload result;
  const SplatCloud cloud = read_ply(folder / "gs.ply");
  std::vector<Gaussian<1>> gaussians(cloud.size());
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    Gaussian<1>& g = gaussians[i];
    for (int a = 0; a < 3; ++a) {
      g.mean[a] = cloud.mean[i][a];
      g.log_scale[a] = cloud.log_scale[i][a];
      g.colour[a] = cloud.colour[i][a];
    }
    for (int a = 0; a < 4; ++a) g.rotation[a] = cloud.rotation[i][a];
    g.opacity_logit = cloud.opacity_logit[i];
  }
  result.map.append(gaussians, 0, 0);

  std::ifstream file(folder / "cameras.txt");
  Camera camera;
  while (file >> camera.width >> camera.height >> camera.fx >> camera.fy >> camera.cx >> camera.cy) {
    Pose T_camera_world = Pose::Identity();
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 4; ++c) file >> T_camera_world.matrix()(r, c);
    result.views.emplace_back(camera, T_camera_world.inverse());
  }
  LANGGS_EXPECTS(!result.views.empty(), (folder / "cameras.txt").string(),
                 " has no view; each line is W H fx fy cx cy and 12 numbers of T_camera_world");
  return result;
}

/// `size` flat Gaussians on the surfaces of the built-in room, as dense on the image as SLAM makes them: standard
/// deviations of 1 to 4 pixels of a 640x480 image in the surface, a fifth of that across, opacity 0.5 to 0.99.
[[nodiscard]] inline Workload room_workload(int size, int width, int height) {
  constexpr int kViews = 4, kStep = 15;
  const SyntheticRoom room({.width = 640, .height = 480}), seen({.width = width, .height = height});
  Workload result;
  std::vector<Gaussian<1>> gaussians;
  gaussians.reserve(static_cast<std::size_t>(size));
  for (int v = 0; v < kViews; ++v) {
    const RgbdFrame frame = room.frame(v * kStep);
    const Camera camera = room.camera();
    const Pose T_world_camera = room.ground_truth(v * kStep);
    const auto point = [&](int column, int row) {
      const float z = frame.depth.data()[row * camera.width + column];
      return Eigen::Vector3f((static_cast<float>(column) - camera.cx) / camera.fx * z,
                             (static_cast<float>(row) - camera.cy) / camera.fy * z, z);
    };
    const CounterRng rng{1, static_cast<std::uint64_t>(v)};
    for (std::uint64_t i = 0; static_cast<int>(gaussians.size()) < (v + 1) * static_cast<std::int64_t>(size) / kViews;
         ++i) {
      const int column = 1 + static_cast<int>(rng.below(8 * i, static_cast<std::uint32_t>(camera.width - 2)));
      const int row = 1 + static_cast<int>(rng.below(8 * i + 1, static_cast<std::uint32_t>(camera.height - 2)));
      const Eigen::Vector3f p = point(column, row);
      const Eigen::Vector3f normal =
          (point(column + 1, row) - point(column - 1, row)).cross(point(column, row + 1) - point(column, row - 1));
      if (!(normal.norm() > 1e-12f)) continue;
      const float pixel = p.z() / camera.fx;
      const auto draw = [&](int what, double low, double high) {
        return static_cast<float>(low + (high - low) * rng.uniform(8 * i + static_cast<std::uint64_t>(what)));
      };
      Gaussian<1> g;
      const float first = draw(2, 1, 4) * pixel, second = draw(3, 1, 4) * pixel;
      g.log_scale = {std::log(first), std::log(second), std::log(0.2f * std::min(first, second))};
      const Eigen::Quaternionf q(Eigen::Quaternionf(T_world_camera.linear().cast<float>()) *
                                 Eigen::Quaternionf::FromTwoVectors(Eigen::Vector3f::UnitZ(), normal));
      g.rotation = {q.w(), q.x(), q.y(), q.z()};
      g.mean = (T_world_camera * p.cast<double>()).cast<float>();
      const float opacity = draw(4, 0.5, 0.99);
      g.opacity_logit = std::log(opacity / (1 - opacity));
      for (int c = 0; c < 3; ++c)
        g.colour[c] = static_cast<float>(frame.colour.data()[3 * (row * camera.width + column) + c]) / 255.f;
      gaussians.push_back(g);
    }
    result.views.emplace_back(seen.camera(), T_world_camera);
  }
  result.map.append(gaussians, 0, 0);
  return result;
}

}  // namespace langgs::benchmarks
