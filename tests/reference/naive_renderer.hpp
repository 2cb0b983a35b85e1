// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "langgs/core/camera.hpp"
#include "langgs/core/pose.hpp"
#include "langgs/core/rng.hpp"
#include "langgs/render/constants.hpp"

/// @file The rasteriser's oracle: double precision, every Gaussian at every pixel, no tiles, straight from the
/// equations. Shares nothing with the kernels but the constants.

namespace langgs::reference {

struct NaiveGaussian {
  Eigen::Vector3d mean, log_scale;
  Eigen::Vector4d rotation;  ///< w, x, y, z, any length
  double opacity_logit = 0;
  Eigen::Vector3d colour;
  Eigen::VectorXd feature;
};

struct NaiveScene {
  Camera camera;
  Pose T_camera_world;
  std::vector<NaiveGaussian> gaussians;
};

struct NaiveHit {
  int gaussian = -1;
  double weight = 0;  ///< alpha T
};

struct NaivePixel {
  Eigen::Vector3d colour;
  double depth = 0, transmittance = 1;
  std::vector<NaiveHit> hits;   ///< front to back; weights are positive
  double margin = 0;            ///< smallest relative distance of an alpha or a transmittance to one of its thresholds
  std::uint64_t decisions = 0;  ///< hash of which Gaussians were blended, which were clamped and where the ray stopped
};

/// A Gaussian on the image (EWA splatting): normal distribution of `mean` and `covariance` in pixels.
struct NaiveSplat {
  int gaussian = 0;
  Eigen::Vector2d mean;
  Eigen::Matrix2d covariance, information;
  double opacity = 0, depth = 0;
  bool ray_bounded = false;  ///< the projection was linearised at the frustum's margin
  Eigen::Vector3d colour;
};

class NaiveRenderer {
 public:
  explicit NaiveRenderer(const NaiveScene& scene) : camera_(scene.camera) {
    for (std::size_t i = 0; i < scene.gaussians.size(); ++i) project(static_cast<int>(i), scene);
    // Not std::stable_sort: its buffer in libstdc++ ignores the alignment of Eigen's members.
    std::sort(splats_.begin(), splats_.end(), [](const NaiveSplat& a, const NaiveSplat& b) {
      return a.depth < b.depth || (a.depth == b.depth && a.gaussian < b.gaussian);
    });
  }

  [[nodiscard]] const Camera& camera() const { return camera_; }
  /// In front of the near plane, near to far, ties by index.
  [[nodiscard]] const std::vector<NaiveSplat>& splats() const { return splats_; }

  void pixel(int x, int y, NaivePixel& out) const {
    out.colour.setZero();
    out.depth = 0;
    out.transmittance = 1;
    out.margin = 1;
    out.decisions = 0;
    out.hits.clear();
    const double max_alpha = RasterConstants::kMaxAlpha, min_alpha = RasterConstants::kMinAlpha;
    const double min_transmittance = RasterConstants::kMinTransmittance;
    for (const NaiveSplat& s : splats_) {
      const Eigen::Vector2d d = s.mean - Eigen::Vector2d(x, y);
      const double free_alpha = s.opacity * std::exp(-0.5 * d.dot(s.information * d));
      const double alpha = std::min(max_alpha, free_alpha);
      out.margin = std::min({out.margin, std::abs(alpha / min_alpha - 1), std::abs(free_alpha / max_alpha - 1)});
      if (alpha < min_alpha) continue;
      const double next = out.transmittance * (1 - alpha);
      out.margin = std::min(out.margin, std::abs(next / min_transmittance - 1));
      const bool stop = next < min_transmittance;
      out.decisions = mix64(out.decisions ^ mix64(s.gaussian * 4 + (free_alpha > max_alpha ? 2 : 0) + (stop ? 1 : 0)));
      if (stop) break;
      const double weight = alpha * out.transmittance;
      out.hits.push_back({s.gaussian, weight});
      out.colour += weight * s.colour;
      out.depth += weight * s.depth;
      out.transmittance = next;
    }
  }
  [[nodiscard]] NaivePixel pixel(int x, int y) const {
    NaivePixel out;
    pixel(x, y, out);
    return out;
  }
  /// [H * W], row-major.
  [[nodiscard]] std::vector<NaivePixel> image() const {
    std::vector<NaivePixel> pixels;
    for (int y = 0; y < camera_.height; ++y)
      for (int x = 0; x < camera_.width; ++x) pixels.push_back(pixel(x, y));
    return pixels;
  }

 private:
  void project(int i, const NaiveScene& scene) {
    using C = RasterConstants;
    const NaiveGaussian& g = scene.gaussians[i];
    const Eigen::Vector3d t = scene.T_camera_world * g.mean;
    if (!(t.z() > static_cast<double>(C::kNearPlane))) return;
    const Eigen::Vector4d q = g.rotation.normalized();
    const Eigen::Matrix3d axes =
        scene.T_camera_world.linear() * Eigen::Quaterniond(q[0], q[1], q[2], q[3]).toRotationMatrix();
    Eigen::Vector3d variance;
    for (int a = 0; a < 3; ++a)
      variance[a] = std::exp(2 * std::clamp<double>(g.log_scale[a], C::kMinLogScale, C::kMaxLogScale));
    const Eigen::Matrix3d sigma = axes * variance.asDiagonal() * axes.transpose();

    const double fx = camera_.fx, fy = camera_.fy, cx = camera_.cx, cy = camera_.cy;
    const double w = camera_.width, h = camera_.height, margin = C::kFrustumMargin;
    const double ray_x = std::clamp(t.x() / t.z(), (-margin * w - cx) / fx, (w + margin * w - cx) / fx);
    const double ray_y = std::clamp(t.y() / t.z(), (-margin * h - cy) / fy, (h + margin * h - cy) / fy);
    Eigen::Matrix<double, 2, 3> jacobian;
    jacobian << fx / t.z(), 0, -fx * ray_x / t.z(), 0, fy / t.z(), -fy * ray_y / t.z();

    NaiveSplat s;
    s.gaussian = i;
    s.mean = camera_.project(t);
    s.covariance =
        jacobian * sigma * jacobian.transpose() + static_cast<double>(C::kLowPass) * Eigen::Matrix2d::Identity();
    s.information = s.covariance.inverse();
    s.opacity = 1 / (1 + std::exp(-std::clamp<double>(g.opacity_logit, -C::kMaxLogit, C::kMaxLogit)));
    s.depth = t.z();
    s.ray_bounded = ray_x != t.x() / t.z() || ray_y != t.y() / t.z();
    s.colour = g.colour;
    splats_.push_back(s);
  }

  Camera camera_;
  std::vector<NaiveSplat> splats_;
};

/// The K hits of largest weight, largest first; of equal weights the front-most first (paper Eq. 2).
[[nodiscard]] inline std::vector<NaiveHit> naive_topk(const NaivePixel& pixel, int k) {
  std::vector<NaiveHit> hits = pixel.hits;
  std::stable_sort(hits.begin(), hits.end(), [](const NaiveHit& a, const NaiveHit& b) { return a.weight > b.weight; });
  if (hits.size() > static_cast<std::size_t>(k)) hits.resize(k);
  return hits;
}

/// sum w_k f_k / sum w_k over the given hits; zero without hits. `pixel.hits` gives the normalised full alpha blend.
[[nodiscard]] inline Eigen::VectorXd naive_feature_mean(const NaiveScene& scene, const std::vector<NaiveHit>& hits) {
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(scene.gaussians.empty() ? 0 : scene.gaussians[0].feature.size());
  double total = 0;
  for (const NaiveHit& hit : hits) {
    sum += hit.weight * scene.gaussians[hit.gaussian].feature;
    total += hit.weight;
  }
  return total > 0 ? Eigen::VectorXd(sum / total) : sum;
}

/// Features blended like colours: sum w_i f_i over all hits, not normalised.
[[nodiscard]] inline Eigen::VectorXd naive_feature_blend(const NaiveScene& scene, const NaivePixel& pixel) {
  double total = 0;
  for (const NaiveHit& hit : pixel.hits) total += hit.weight;
  return total * naive_feature_mean(scene, pixel.hits);
}

/// What pruning counts, for one view.
struct NaiveStatistics {
  std::vector<double> max_weight;  ///< [N] S_i
  std::vector<int> topk_count;     ///< [N]
};

[[nodiscard]] inline NaiveStatistics naive_statistics(const std::vector<NaivePixel>& image, int num_gaussians, int k) {
  NaiveStatistics s{std::vector<double>(num_gaussians, 0.0), std::vector<int>(num_gaussians, 0)};
  for (const NaivePixel& pixel : image) {
    for (const NaiveHit& hit : pixel.hits)
      s.max_weight[hit.gaussian] = std::max(s.max_weight[hit.gaussian], hit.weight);
    for (const NaiveHit& hit : naive_topk(pixel, k)) ++s.topk_count[hit.gaussian];
  }
  return s;
}

}  // namespace langgs::reference
