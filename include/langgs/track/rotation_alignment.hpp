// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "langgs/core/pose.hpp"
#include "langgs/track/intensity_image.hpp"

/// @file Rotation between two frames from small blurred images alone (as in PTAM, Klein & Murray 2008): where a hand
/// turns fast, the registration starts too far away without it.

namespace langgs {

struct RotationAlignment {
  Eigen::Matrix3d R_last_now = Eigen::Matrix3d::Identity();
  double difference = 1;          ///< mean absolute difference of grey values at the end, the mean one removed
  double initial_difference = 1;  ///< and at the guess
};

namespace detail {

/// Averages over squares of `size` values.
[[nodiscard]] inline IntensityImage reduced(const IntensityImage& image, int size) {
  IntensityImage result;
  const Camera& c = image.camera;
  const auto scale = static_cast<float>(size);
  const float shift = 0.5f * (scale - 1);
  result.camera = {c.fx / scale,           c.fy / scale,   (c.cx - shift) / scale,
                   (c.cy - shift) / scale, c.width / size, c.height / size};
  for (int y = 0; y < result.camera.height; ++y)
    for (int x = 0; x < result.camera.width; ++x) {
      float sum = 0;
      for (int j = 0; j < size; ++j)
        for (int i = 0; i < size; ++i)
          sum += image.values[static_cast<std::size_t>(y * size + j) * c.width + x * size + i];
      result.values.push_back(sum / (scale * scale));
    }
  return result;
}

/// Normal equations of a rotation R <- Exp(omega) R.
struct RotationEquations {
  Eigen::Matrix3d hessian = Eigen::Matrix3d::Zero();
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero(), mean_row = Eigen::Vector3d::Zero();
  double mean = 0, difference = 0;
  int count = 0;
};

[[nodiscard]] inline RotationEquations compare_turned(const IntensityImage& last, const IntensityImage& now,
                                                      const Eigen::Matrix3d& R_last_now) {
  const Camera& camera = now.camera;
  RotationEquations result;
  std::vector<float> residuals;
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x) {
      const Eigen::Vector3d ray = R_last_now * camera.back_project(static_cast<float>(x), static_cast<float>(y), 1);
      if (!(ray.z() > 0.1)) continue;
      const double u = camera.fx * ray.x() / ray.z() + camera.cx, v = camera.fy * ray.y() / ray.z() + camera.cy;
      if (!(u >= 0 && v >= 0 && u < camera.width - 1 && v < camera.height - 1)) continue;
      const int x0 = static_cast<int>(u), y0 = static_cast<int>(v);
      const double a = u - x0, b = v - y0;
      const float* const p = last.values.data() + static_cast<std::ptrdiff_t>(y0) * camera.width + x0;
      const double i00 = p[0], i10 = p[1], i01 = p[camera.width], i11 = p[camera.width + 1];
      const double top = i10 - i00, bottom = i11 - i01;
      const double gx = (top + b * (bottom - top)) * camera.fx / ray.z();
      const double gy = (i01 - i00 + a * (bottom - top)) * camera.fy / ray.z();
      const Eigen::Vector3d g(gx, gy, -(gx * ray.x() + gy * ray.y()) / ray.z());
      const double residual = i00 + a * top + b * (i01 + a * bottom - i00 - a * top) -
                              now.values[static_cast<std::size_t>(y) * camera.width + x];
      const Eigen::Vector3d row = ray.cross(g);  // of omega
      result.hessian += row * row.transpose();
      result.gradient += residual * row;
      result.mean_row += row;
      result.mean += residual;
      ++result.count;
      residuals.push_back(static_cast<float>(residual));
    }
  if (result.count == 0) return result;
  // A change of exposure is projected out.
  const double n = result.count;
  result.hessian -= result.mean_row * result.mean_row.transpose() / n;
  result.gradient -= result.mean * result.mean_row / n;
  result.mean /= n;
  for (const float r : residuals) result.difference += std::abs(r - result.mean) / n;
  return result;
}

/// The whole-pixel shift (du, dv) of `now` against `last` with the smallest difference, as a rotation: where the
/// gradient of the images leads nowhere any more. At least half of the images overlap.
[[nodiscard]] inline Eigen::Matrix3d best_shift(const IntensityImage& last, const IntensityImage& now) {
  const int width = now.camera.width, height = now.camera.height;
  const auto mean = [](const IntensityImage& image) {
    float sum = 0;
    for (const float v : image.values) sum += v;
    return sum / static_cast<float>(image.values.size());
  };
  const float brightening = mean(now) - mean(last);
  float best = std::numeric_limits<float>::infinity();
  int best_u = 0, best_v = 0;
  for (int dv = -height / 4; dv <= height / 4; ++dv)
    for (int du = -3 * width / 8; du <= 3 * width / 8; ++du) {
      const int x0 = std::max(0, -du), x1 = std::min(width, width - du);
      const int y0 = std::max(0, -dv), y1 = std::min(height, height - dv);
      float sum = 0;
      for (int y = y0; y < y1; ++y) {
        const float* const a = now.values.data() + static_cast<std::ptrdiff_t>(y) * width;
        const float* const b = last.values.data() + static_cast<std::ptrdiff_t>(y + dv) * width + du;
        float row = 0;
        for (int x = x0; x < x1; ++x) row += std::abs(a[x] - b[x] - brightening);
        sum += row;
      }
      sum /= static_cast<float>((x1 - x0) * (y1 - y0));
      if (sum < best) best = sum, best_u = du, best_v = dv;
    }
  const Eigen::Vector3d ray(best_u / static_cast<double>(now.camera.fx), best_v / static_cast<double>(now.camera.fy),
                            1);
  // The turn from z to the ray, which is never opposite. For rays that are, Eigen's FromTwoVectors has a singular value
  // decomposition, and a fifth of the time that our headers take to compile.
  const Eigen::Vector3d to = ray.normalized();
  const double twice_w = std::sqrt(2 * (1 + to.z())), inverse = 1 / twice_w;
  return Eigen::Quaterniond(twice_w / 2, -to.y() * inverse, to.x() * inverse, 0).toRotationMatrix();
}

}  // namespace detail

/// The rotation that makes `now` look like `last`, from the guess; the guess itself where the images do not overlap by
/// half or nothing is won. Both of one camera.
[[nodiscard]] inline RotationAlignment align_rotation(const IntensityImage& last, const IntensityImage& now,
                                                      const Eigen::Matrix3d& R_last_now_guess) {
  constexpr int kColumns = 40, kIterations = 12;
  constexpr double kAlike = 0.03;         // grey values; above it another beginning is tried
  constexpr double kSmallestStep = 1e-3;  // [rad]; a pixel is some 30 times that
  RotationAlignment result{R_last_now_guess};
  if (last.empty() || now.empty() || last.camera.width != now.camera.width || last.camera.height != now.camera.height)
    return result;
  const int size = std::max(1, now.camera.width / kColumns);
  const IntensityImage small_last = detail::reduced(last, size), small_now = detail::reduced(now, size);
  const int enough = small_now.camera.width * small_now.camera.height / 2;
  const auto descend = [&](Eigen::Matrix3d R) {
    for (int i = 0; i <= kIterations; ++i) {
      const detail::RotationEquations e = detail::compare_turned(small_last, small_now, R);
      if (e.count < enough) return;
      if (result.initial_difference == 1) result.initial_difference = e.difference;
      if (e.difference < result.difference) {
        result.difference = e.difference;
        result.R_last_now = R;
      }
      const Eigen::Vector3d step = -e.hessian.ldlt().solve(e.gradient);
      if (!step.allFinite() || step.norm() < kSmallestStep) return;
      R = so3_exp(step) * R;
    }
  };
  descend(R_last_now_guess);
  if (result.difference > kAlike) descend(detail::best_shift(small_last, small_now));
  return result;
}

}  // namespace langgs
