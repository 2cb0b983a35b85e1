// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "langgs/render/projection.hpp"
#include "langgs/render/tile_backward.hpp"

namespace langgs {

/// Gradient of a loss with respect to one Gaussian's parameters and to the pose of the view (per lane).
///
/// Input are the sums of SplatSum over all pixels. The pose gradient is that of the left perturbation
/// T_camera_world <- Exp([rho; theta]) T_camera_world at zero.
template <class V>
struct ProjectionGradient {
  V mean[3], log_scale[3], rotation[4], opacity_logit, colour[3];
  V rho[3], theta[3];

  LANGGS_INLINE ProjectionGradient(const Projection<V>& p, const View& view, const V (&sums)[kNumSplatSums]) {
    const float focal[2] = {view.camera.fx, view.camera.fy};
    for (int c = 0; c < 3; ++c) colour[c] = sums[kSumRed + c];
    opacity_logit = sums[kSumP] * (1.f - p.opacity);  // p = o dL/do, and do/dlogit = o (1 - o)

    // Mean on the image: power = -(A dx^2 + 2 B dx dy + C dy^2) / 2, dx = mean - pixel.
    const V pixel[2] = {-(p.conic[0] * sums[kSumPX] + p.conic[1] * sums[kSumPY]),
                        -(p.conic[1] * sums[kSumPX] + p.conic[2] * sums[kSumPY])};
    V footprint[2][3];
    footprint_gradient(p, sums, footprint);

    // U = J M with rows U_a = focal_a / z (M_a - ray_a M_z).
    V axes[3][3], ray[2], scale_z = V(0.f);
    for (int a = 0; a < 2; ++a) {
      ray[a] = V(0.f);
      const V factor = focal[a] * p.inverse_z;
      for (int k = 0; k < 3; ++k) {
        axes[a][k] = factor * footprint[a][k];
        ray[a] -= axes[a][k] * p.axes[2][k];
        scale_z -= footprint[a][k] * p.footprint[a][k];
      }
    }
    for (int k = 0; k < 3; ++k) axes[2][k] = -(p.ray[0] * axes[0][k] + p.ray[1] * axes[1][k]);

    camera_gradient(p, focal, pixel, ray, scale_z, sums[kSumDepth], rho);
    theta[0] = p.t[1] * rho[2] - p.t[2] * rho[1];
    theta[1] = p.t[2] * rho[0] - p.t[0] * rho[2];
    theta[2] = p.t[0] * rho[1] - p.t[1] * rho[0];
    for (int k = 0; k < 3; ++k) {  // columns of M turn with the camera
      theta[0] += p.axes[1][k] * axes[2][k] - p.axes[2][k] * axes[1][k];
      theta[1] += p.axes[2][k] * axes[0][k] - p.axes[0][k] * axes[2][k];
      theta[2] += p.axes[0][k] * axes[1][k] - p.axes[1][k] * axes[0][k];
    }
    for (int c = 0; c < 3; ++c)
      mean[c] = rho[0] * view.rotation[0][c] + rho[1] * view.rotation[1][c] + rho[2] * view.rotation[2][c];
    shape_gradient(p, view, axes);
  }

 private:
  /// Through conic = covariance^-1 and covariance = U U^T + low-pass.
  LANGGS_INLINE static void footprint_gradient(const Projection<V>& p, const V (&sums)[kNumSplatSums], V (&out)[2][3]) {
    // dL/dQ as a symmetric matrix, then dL/dcov = -Q dL/dQ Q.
    const V q00 = -0.5f * sums[kSumPXX], q01 = -0.5f * sums[kSumPXY], q11 = -0.5f * sums[kSumPYY];
    const V a0 = p.conic[0] * q00 + p.conic[1] * q01, a1 = p.conic[0] * q01 + p.conic[1] * q11;
    const V b0 = p.conic[1] * q00 + p.conic[2] * q01, b1 = p.conic[1] * q01 + p.conic[2] * q11;
    const V c00 = -(a0 * p.conic[0] + a1 * p.conic[1]);
    const V c01 = -(a0 * p.conic[1] + a1 * p.conic[2]);
    const V c11 = -(b0 * p.conic[1] + b1 * p.conic[2]);
    for (int k = 0; k < 3; ++k) {
      out[0][k] = 2.f * (c00 * p.footprint[0][k] + c01 * p.footprint[1][k]);
      out[1][k] = 2.f * (c01 * p.footprint[0][k] + c11 * p.footprint[1][k]);
    }
  }

  /// dL/dt in camera coordinates: from the mean on the image, the rays and the scale of J, and the depth.
  LANGGS_INLINE static void camera_gradient(const Projection<V>& p, const float (&focal)[2], const V (&pixel)[2],
                                            const V (&ray)[2], const V& scale_z, const V& depth, V (&out)[3]) {
    out[2] = depth + scale_z * p.inverse_z;
    for (int a = 0; a < 2; ++a) {
      const V exact = p.t[a] * p.inverse_z;
      // A bounded ray does not move with the mean.
      const V total = focal[a] * pixel[a] + select(p.ray_bounded[a], V(0.f), ray[a]);
      out[a] = total * p.inverse_z;
      out[2] -= total * exact * p.inverse_z;
    }
  }

  /// Through M = R_cw local(q) diag(s) to the log-scales and the stored quaternion.
  LANGGS_INLINE void shape_gradient(const Projection<V>& p, const View& view, const V (&axes)[3][3]) {
    V d[3][3];  // dL/dlocal
    for (int k = 0; k < 3; ++k) {
      log_scale[k] = axes[0][k] * p.axes[0][k] + axes[1][k] * p.axes[1][k] + axes[2][k] * p.axes[2][k];
      for (int r = 0; r < 3; ++r)
        d[r][k] = p.scale[k] * (axes[0][k] * view.rotation[0][r] + axes[1][k] * view.rotation[1][r] +
                                axes[2][k] * view.rotation[2][r]);
    }
    const V &w = p.quaternion[0], &x = p.quaternion[1], &y = p.quaternion[2], &z = p.quaternion[3];
    const V q[4] = {2.f * (x * (d[2][1] - d[1][2]) + y * (d[0][2] - d[2][0]) + z * (d[1][0] - d[0][1])),
                    2.f * (w * (d[2][1] - d[1][2]) + y * (d[0][1] + d[1][0]) + z * (d[0][2] + d[2][0]) -
                           2.f * x * (d[1][1] + d[2][2])),
                    2.f * (w * (d[0][2] - d[2][0]) + x * (d[0][1] + d[1][0]) + z * (d[1][2] + d[2][1]) -
                           2.f * y * (d[0][0] + d[2][2])),
                    2.f * (w * (d[1][0] - d[0][1]) + x * (d[0][2] + d[2][0]) + y * (d[1][2] + d[2][1]) -
                           2.f * z * (d[0][0] + d[1][1]))};
    const V radial = q[0] * w + q[1] * x + q[2] * y + q[3] * z;
    for (int a = 0; a < 4; ++a) rotation[a] = (q[a] - radial * p.quaternion[a]) * p.inverse_norm;
  }
};

}  // namespace langgs
