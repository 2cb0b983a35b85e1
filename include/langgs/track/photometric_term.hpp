// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "langgs/core/pose.hpp"
#include "langgs/host/lane_memory.hpp"
#include "langgs/host/varying.hpp"
#include "langgs/track/intensity_image.hpp"
#include "langgs/track/lanes3.hpp"

/// @file Grey values of map Gaussians against the frame's at the pixels where they appear: what holds a wall that is
/// seen frontally from sliding along itself.

namespace langgs::detail {

/// The term at one pose.
class PhotometricLanes {
 public:
  using Float = host::Varying<float>;

  struct Value {
    host::Mask valid;  ///< the Gaussian appears in the image and has a grey value
    Float residual;    ///< the frame's grey value minus the Gaussian's
    Lanes3 gradient;   ///< of the frame's grey value by the mean, world frame [1/m]
  };

  PhotometricLanes(const IntensityImage& image, const Pose& T_world_colour, float brightening, bool wanted)
      : image_(image), T_colour_world_(T_world_colour.inverse()), brightening_(brightening), wanted_(wanted) {}

  [[nodiscard]] LANGGS_HOST_INLINE Value value(const Lanes3& mean, const Float& intensity) const {
    Value result{host::Mask(0), Float(0.f), {Float(0.f), Float(0.f), Float(0.f)}};
    if (!wanted_) return result;
    const Camera& camera = image_.camera;
    const Lanes3 p = T_colour_world_ * mean;
    const Float one_over_z = 1.f / p.z;
    const Float u = camera.fx * (p.x * one_over_z) + camera.cx, v = camera.fy * (p.y * one_over_z) + camera.cy;
    result.valid = (p.z > kNearest) & (intensity >= 0.f) & (u >= 0.f) & (v >= 0.f) &
                   (u < static_cast<float>(camera.width - 1)) & (v < static_cast<float>(camera.height - 1));
    if (!host::any(result.valid)) return result;
    const auto x = host::convert<std::int32_t>(select(result.valid, u, Float(0.f)));
    const auto y = host::convert<std::int32_t>(select(result.valid, v, Float(0.f)));
    const auto at = y * camera.width + x;
    const float* const values = image_.values.data();
    const Float a = u - host::to_float(x), b = v - host::to_float(y);
    const Float i00 = host::gather(values, at, result.valid, 0.f),
                i10 = host::gather(values + 1, at, result.valid, 0.f);
    const Float i01 = host::gather(values + camera.width, at, result.valid, 0.f);
    const Float i11 = host::gather(values + camera.width + 1, at, result.valid, 0.f);
    const Float top = i10 - i00, bottom = i11 - i01;
    result.residual = i00 + a * top + b * (i01 + a * bottom - i00 - a * top) - intensity - brightening_;
    const Float gx = (top + b * (bottom - top)) * (camera.fx * one_over_z);
    const Float gy = (i01 - i00 + a * (bottom - top)) * (camera.fy * one_over_z);
    const Float gz = -(gx * p.x + gy * p.y) * one_over_z;
    const auto& r = T_colour_world_.r;  // its transpose leads back to the world
    result.gradient = {r[0][0] * gx + r[1][0] * gy + r[2][0] * gz, r[0][1] * gx + r[1][1] * gy + r[2][1] * gz,
                       r[0][2] * gx + r[1][2] * gy + r[2][2] * gz};
    return result;
  }

 private:
  static constexpr float kNearest = 0.05f;  // [m]

  const IntensityImage& image_;
  PlacementLanes3 T_colour_world_;
  float brightening_;
  bool wanted_;
};

class PhotometricTerm {
 public:
  PhotometricTerm(const IntensityImage& image, const Pose& T_colour_depth)
      : image_(image), T_depth_colour_(T_colour_depth.inverse()) {}

  /// `wanted`: otherwise no Gaussian appears.
  [[nodiscard]] PhotometricLanes at(const Pose& T_world_depth, float brightening, bool wanted) const {
    return {image_, T_world_depth * T_depth_colour_, brightening, wanted};
  }

 private:
  const IntensityImage& image_;
  Pose T_depth_colour_;
};

}  // namespace langgs::detail
