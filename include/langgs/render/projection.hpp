// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "langgs/core/config.hpp"
#include "langgs/device/block.hpp"
#include "langgs/device/math.hpp"
#include "langgs/map/planes.hpp"
#include "langgs/render/constants.hpp"
#include "langgs/render/view.hpp"

/// @file From a Gaussian of the map to a splat on the image (EWA splatting, Zwicker et al. 2001), lane by lane.

namespace langgs {

/// The geometric parameters of one Gaussian (per lane), as stored.
template <class V>
struct GaussianParameters {
  V mean[3], log_scale[3], rotation[4], opacity_logit;

  template <class LoadPlane>
  LANGGS_INLINE static GaussianParameters read(const LoadPlane& load) {
    GaussianParameters g;
    for (int a = 0; a < 3; ++a) g.mean[a] = load(kMeanX + a);
    for (int a = 0; a < 3; ++a) g.log_scale[a] = load(kLogScaleX + a);
    for (int a = 0; a < 4; ++a) g.rotation[a] = load(kRotationW + a);
    g.opacity_logit = load(kOpacityLogit);
    return g;
  }
};

/// Everything that the chain from parameters to splat computes; the backward pass needs most of it again.
template <class V>
struct Projection {
  using C = RasterConstants;

  V t[3];           ///< mean in camera coordinates [m]
  V quaternion[4];  ///< unit, w, x, y, z
  V inverse_norm;   ///< 1 / |stored quaternion|
  V local[3][3];    ///< rotation matrix of the Gaussian; columns are its axes
  V scale[3];       ///< standard deviations [m]
  V opacity;        ///< in (0, 1)
  V axes[3][3];     ///< M = R_cw local diag(scale): columns are the scaled axes in camera coordinates
  V inverse_z;
  V ray[2];  ///< x/z, y/z, bounded to the frustum with its margin
  decltype(V{} < V{}) ray_bounded[2];
  V footprint[2][3];  ///< U = J M, so that the projected covariance is U U^T + low-pass
  V covariance[3];    ///< xx, xy, yy [px^2]
  V determinant;
  V conic[3];  ///< inverse covariance xx, xy, yy [1/px^2]
  V pixel[2];  ///< mean on the image

  LANGGS_INLINE Projection(const GaussianParameters<V>& g, const View& view) {
    for (int r = 0; r < 3; ++r)
      t[r] = g.mean[0] * view.rotation[r][0] + g.mean[1] * view.rotation[r][1] + g.mean[2] * view.rotation[r][2] +
             view.translation[r];
    unit_rotation(g);
    for (int a = 0; a < 3; ++a) scale[a] = exp(min(max(g.log_scale[a], C::kMinLogScale), C::kMaxLogScale));
    opacity = 1.f / (1.f + exp(-min(max(g.opacity_logit, -C::kMaxLogit), C::kMaxLogit)));
    for (int r = 0; r < 3; ++r)
      for (int a = 0; a < 3; ++a)
        axes[r][a] = scale[a] * (local[0][a] * view.rotation[r][0] + local[1][a] * view.rotation[r][1] +
                                 local[2][a] * view.rotation[r][2]);
    project(view.camera);
  }

 private:
  LANGGS_INLINE void unit_rotation(const GaussianParameters<V>& g) {
    const V norm2 = g.rotation[0] * g.rotation[0] + g.rotation[1] * g.rotation[1] + g.rotation[2] * g.rotation[2] +
                    g.rotation[3] * g.rotation[3];
    inverse_norm = 1.f / sqrt(max(norm2, 1e-20f));
    for (int a = 0; a < 4; ++a) quaternion[a] = g.rotation[a] * inverse_norm;
    const V &w = quaternion[0], &x = quaternion[1], &y = quaternion[2], &z = quaternion[3];
    local[0][0] = 1.f - 2.f * (y * y + z * z);
    local[0][1] = 2.f * (x * y - w * z);
    local[0][2] = 2.f * (x * z + w * y);
    local[1][0] = 2.f * (x * y + w * z);
    local[1][1] = 1.f - 2.f * (x * x + z * z);
    local[1][2] = 2.f * (y * z - w * x);
    local[2][0] = 2.f * (x * z - w * y);
    local[2][1] = 2.f * (y * z + w * x);
    local[2][2] = 1.f - 2.f * (x * x + y * y);
  }

  LANGGS_INLINE void project(const Camera& camera) {
    const float focal[2] = {camera.fx, camera.fy}, centre[2] = {camera.cx, camera.cy};
    const int size[2] = {camera.width, camera.height};
    inverse_z = 1.f / max(t[2], 1e-6f);
    for (int a = 0; a < 2; ++a) {
      const V exact = t[a] * inverse_z;
      const float margin = C::kFrustumMargin * static_cast<float>(size[a]) / focal[a];
      const float low = -centre[a] / focal[a] - margin;
      const float high = (static_cast<float>(size[a]) - centre[a]) / focal[a] + margin;
      ray[a] = min(max(exact, low), high);
      ray_bounded[a] = ray[a] != exact;
      pixel[a] = focal[a] * exact + centre[a];
      for (int k = 0; k < 3; ++k) footprint[a][k] = focal[a] * inverse_z * (axes[a][k] - ray[a] * axes[2][k]);
    }
    const auto dot = [&](int a, int b) __attribute__((always_inline)) {
      return footprint[a][0] * footprint[b][0] + footprint[a][1] * footprint[b][1] + footprint[a][2] * footprint[b][2];
    };
    covariance[0] = dot(0, 0) + C::kLowPass;
    covariance[1] = dot(0, 1);
    covariance[2] = dot(1, 1) + C::kLowPass;
    // Of U U^T + low-pass, by Cauchy-Binet: no cancellation, so the determinant stays positive for any needle.
    const V m01 = footprint[0][0] * footprint[1][1] - footprint[0][1] * footprint[1][0];
    const V m02 = footprint[0][0] * footprint[1][2] - footprint[0][2] * footprint[1][0];
    const V m12 = footprint[0][1] * footprint[1][2] - footprint[0][2] * footprint[1][1];
    determinant = m01 * m01 + m02 * m02 + m12 * m12 + C::kLowPass * (covariance[0] + covariance[2] - C::kLowPass);
    const V inverse = 1.f / determinant;
    conic[0] = covariance[2] * inverse;
    conic[1] = -covariance[1] * inverse;
    conic[2] = covariance[0] * inverse;
  }
};

/// Half width and half height of the box outside of which alpha < 1/255 [px]: sqrt(2 ln(255 opacity) covariance).
/// Zero where the opacity itself is below 1/255.
template <class V>
LANGGS_INLINE void splat_extent(const Projection<V>& p, V& half_width, V& half_height) {
  // The small relative margin covers rounding, so that the box never cuts a pixel that the blending would count.
  const V reach = max(2.002f * log(p.opacity * (1.f / RasterConstants::kMinAlpha)), 0.f);
  half_width = sqrt(reach * p.covariance[0]);
  half_height = sqrt(reach * p.covariance[2]);
}

}  // namespace langgs
