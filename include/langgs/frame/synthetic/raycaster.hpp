// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "langgs/core/camera.hpp"
#include "langgs/core/image.hpp"
#include "langgs/core/pose.hpp"
#include "langgs/frame/synthetic/lighting.hpp"
#include "langgs/frame/synthetic/scene.hpp"
#include "langgs/host/worker_pool.hpp"

namespace langgs::detail {

/// What an ideal camera sees.
struct CastView {
  Image<std::uint8_t> colour;   ///< [H, W, 3], RGB, antialiased
  Image<float> depth;           ///< [H, W], exact along the optical axis at pixel centres [m]
  Image<std::uint16_t> labels;  ///< [H, W], of the surface at the pixel centre
  Image<float> facing;          ///< [H, W], cosine between the surface normal and the line of sight, in [0, 1]
};

/// Casts one ray per pixel for geometry, and four more for colour where neighbouring pixels see different surfaces;
/// elsewhere the filtered textures need no more than one.
class RayCaster {
 public:
  explicit RayCaster(Scene scene) : scene_(std::move(scene)), lighting_(scene_) {}

  [[nodiscard]] const Scene& scene() const { return scene_; }

  /// Renders from a pose in room coordinates; the pool may be null.
  [[nodiscard]] CastView render(const Camera& camera, const Pose& T_room_camera, bool with_colour,
                                WorkerPool* pool) const {
    const Job job{camera, T_room_camera, (camera.width + kTile - 1) / kTile, (camera.height + kTile - 1) / kTile};
    CastView view;
    view.depth = Image<float>(camera.width, camera.height);
    view.labels = Image<std::uint16_t>(camera.width, camera.height);
    view.facing = Image<float>(camera.width, camera.height);
    const Candidates visible = visible_shapes(job);
    std::vector<Candidates> candidates(static_cast<std::size_t>(job.tiles_x) * job.tiles_y);
    Image<SurfaceHit> hits(camera.width, camera.height);
    for_each_tile(pool, job, [&](int tile) {
      candidates[tile] = candidates_of(job, visible, tile);
      for_each_pixel(job, tile, [&](int x, int y) {
        const Ray ray = job.ray(x, y);
        const SurfaceHit hit = trace(ray, {x, y}, candidates[tile]);
        const Eigen::Vector3d point = ray.origin + hit.t * ray.direction;
        view.depth(x, y) = static_cast<float>(hit.t);
        view.labels(x, y) = scene_.label(hit);
        view.facing(x, y) = static_cast<float>(std::abs(scene_.normal(hit, point).dot(ray.direction.normalized())));
        hits(x, y) = hit;
      });
    });
    if (!with_colour) return view;
    view.colour = Image<std::uint8_t>(camera.width, camera.height, 3);
    for_each_tile(pool, job, [&](int tile) {
      for_each_pixel(job, tile, [&](int x, int y) {
        const Rgb colour = pixel_colour(job, candidates[tile], hits, {x, y});
        for (int c = 0; c < 3; ++c) view.colour(x, y, c) = display(colour[c]);
      });
    });
    return view;
  }

 private:
  static constexpr int kTile = 16;

  struct Job {
    Camera camera;
    Pose T_room_camera;
    int tiles_x, tiles_y;

    /// Through pixel (u, v); t is the depth along the optical axis.
    [[nodiscard]] Ray ray(double u, double v) const {
      return {T_room_camera.translation(), T_room_camera.linear() * camera.back_project(u, v, 1)};
    }
  };

  struct Candidate {
    double nearest;  ///< no part of the shape is less deep
    int shape;
    double x0, x1, y0, y1;  ///< pixels that it may cover
  };
  using Candidates = std::vector<Candidate>;

  template <class F>
  static void for_each_tile(WorkerPool* pool, const Job& job, const F& f) {
    const auto row = [&](int ty) {
      for (int tx = 0; tx < job.tiles_x; ++tx) f(ty * job.tiles_x + tx);
    };
    if (pool) {
      pool->run(job.tiles_y, row);
    } else {
      for (int ty = 0; ty < job.tiles_y; ++ty) row(ty);
    }
  }

  template <class F>
  static void for_each_pixel(const Job& job, int tile, const F& f) {
    const int x0 = tile % job.tiles_x * kTile, y0 = tile / job.tiles_x * kTile;
    for (int y = y0; y < std::min(y0 + kTile, job.camera.height); ++y) {
      for (int x = x0; x < std::min(x0 + kTile, job.camera.width); ++x) f(x, y);
    }
  }

  /// Shapes in the image, nearest first.
  [[nodiscard]] Candidates visible_shapes(const Job& job) const {
    const Camera& camera = job.camera;
    Candidates result;
    for (int i = 0; i < static_cast<int>(scene_.shapes.size()); ++i) {
      const ViewExtent extent =
          view_extent(scene_.shapes[i], 1e-4, job.T_room_camera.translation(), job.T_room_camera.linear());
      if (extent.u0 > extent.u1) continue;
      result.push_back({extent.nearest, i, camera.fx * extent.u0 + camera.cx, camera.fx * extent.u1 + camera.cx,
                        camera.fy * extent.v0 + camera.cy, camera.fy * extent.v1 + camera.cy});
    }
    std::sort(result.begin(), result.end(), [](const Candidate& a, const Candidate& b) {
      return a.nearest != b.nearest ? a.nearest < b.nearest : a.shape < b.shape;
    });
    return result;
  }

  [[nodiscard]] static Candidates candidates_of(const Job& job, const Candidates& visible, int tile) {
    const int x0 = tile % job.tiles_x * kTile, y0 = tile / job.tiles_x * kTile;
    Candidates result;
    for (const Candidate& c : visible) {
      const bool apart = c.x0 > x0 + kTile || c.x1 < x0 - 1 || c.y0 > y0 + kTile || c.y1 < y0 - 1;
      if (!apart) result.push_back(c);
    }
    return result;
  }

  [[nodiscard]] SurfaceHit trace(const Ray& ray, const Eigen::Vector2d& pixel, const Candidates& candidates) const {
    SurfaceHit hit = scene_.leave_shell(ray);
    for (const Candidate& c : candidates) {
      if (c.nearest > hit.t) break;
      if (pixel.x() < c.x0 || pixel.x() > c.x1 || pixel.y() < c.y0 || pixel.y() > c.y1) continue;
      if (scene_.shapes[c.shape].intersect(ray, hit)) hit.shape = c.shape;
    }
    return hit;
  }

  [[nodiscard]] Rgb pixel_colour(const Job& job, const Candidates& candidates, const Image<SurfaceHit>& hits,
                                 const Eigen::Vector2i& p) const {
    const SurfaceHit& centre = hits(p.x(), p.y());
    const auto same = [&](int dx, int dy) {
      const SurfaceHit& other =
          hits(std::clamp(p.x() + dx, 0, hits.width() - 1), std::clamp(p.y() + dy, 0, hits.height() - 1));
      return other.shape == centre.shape && other.face == centre.face;
    };
    if (same(-1, 0) && same(1, 0) && same(0, -1) && same(0, 1)) {
      return hit_colour(job, job.ray(p.x(), p.y()), centre, Lighting::kWholeLamp);
    }
    Rgb sum = Rgb::Zero();
    for (int i = 0; i < 4; ++i) {
      // A rotated grid: four different heights and four different columns.
      constexpr double kU[4] = {-0.125, 0.375, -0.375, 0.125}, kV[4] = {-0.375, -0.125, 0.125, 0.375};
      const Eigen::Vector2d sample{p.x() + kU[i], p.y() + kV[i]};
      const Ray ray = job.ray(sample.x(), sample.y());
      sum += hit_colour(job, ray, trace(ray, sample, candidates), i);
    }
    return sum / 4;
  }

  [[nodiscard]] Rgb hit_colour(const Job& job, const Ray& ray, const SurfaceHit& hit, int lamp_point) const {
    const Eigen::Vector3d point = ray.origin + hit.t * ray.direction;
    const Eigen::Vector3d normal = scene_.normal(hit, point);
    const double cosine = std::max(0.2, std::abs(normal.dot(ray.direction.normalized())));
    const Rgb albedo = scene_.albedo(hit, point, hit.t / (job.camera.fx * cosine));
    if (scene_.material(hit).glows) return albedo;
    return albedo.cwiseProduct(lighting_.at(scene_, point, normal, lamp_point));
  }

  /// Linear light to an 8-bit display value with a soft shoulder.
  static std::uint8_t display(float linear) {
    const float value = std::sqrt(linear * (1 + 0.12f * linear) / (1 + 0.25f * linear));
    return static_cast<std::uint8_t>(std::clamp(255 * value + 0.5f, 0.f, 255.f));
  }

  Scene scene_;
  Lighting lighting_;
};

}  // namespace langgs::detail
