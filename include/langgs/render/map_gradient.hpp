// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "langgs/core/pose.hpp"
#include "langgs/device/algorithm.hpp"
#include "langgs/device/buffer.hpp"
#include "langgs/device/copy.hpp"
#include "langgs/device/launch.hpp"
#include "langgs/map/planes.hpp"
#include "langgs/render/projection_backward.hpp"
#include "langgs/render/splat_list.hpp"

namespace langgs {

/// Sums the instances of each splat and carries the sums back to the Gaussian's parameters and the pose.
struct GatherGradient {
  PlanesView map;
  const View* view;
  const std::int32_t* gaussian;    ///< [V]
  const std::int32_t* slot_begin;  ///< [V + 1]
  const float* slot_sums;          ///< [I, kSplatSumStride]
  PlanesView out;                  ///< [14, V]
  float* pose;                     ///< [6, V] contributions to [rho; theta]

  template <class Lanes>
  LANGGS_HD void operator()(const Lanes& lanes) const {
    using F = VaryingOf<float, Lanes>;
    const auto who = lanes.load(gaussian);
    const Projection<F> p(GaussianParameters<F>::read([&](int plane) { return lanes.gather(map.plane(plane), who); }),
                          *view);
    F sums[kNumSplatSums];
    lanes.template sum_segments<kSplatSumStride>(slot_begin, slot_sums, sums);
    const ProjectionGradient<F> g(p, *view, sums);
    const auto put = [&](int plane, const F& v) { lanes.store(out.plane(plane), v); };
    for (int a = 0; a < 3; ++a) {
      put(kMeanX + a, g.mean[a]);
      put(kLogScaleX + a, g.log_scale[a]);
      put(kRed + a, g.colour[a]);
      lanes.store(pose + static_cast<std::ptrdiff_t>(a) * out.stride, g.rho[a]);
      lanes.store(pose + static_cast<std::ptrdiff_t>(a + 3) * out.stride, g.theta[a]);
    }
    for (int a = 0; a < 4; ++a) put(kRotationW + a, g.rotation[a]);
    put(kOpacityLogit, g.opacity_logit);
  }
};

/// Gradient of a loss with respect to the visible Gaussians' parameters and to the view's pose.
template <class Backend>
class MapGradient {
 public:
  /// [14, V] in the order of `gaussian`.
  [[nodiscard]] PlanesView planes() const { return {const_cast<float*>(planes_.data()), stride_, size_.most}; }
  /// [V] the Gaussian of each column, ascending. The rasteriser's memory: valid until its next render.
  [[nodiscard]] const std::int32_t* gaussian() const { return gaussian_; }
  /// V; where the rasteriser did not know it yet, what there was room for.
  [[nodiscard]] int size() const { return size_.most; }
  /// V for kernels.
  [[nodiscard]] const ListSize& columns() const { return size_; }
  /// dL/dtau for T_camera_world <- Exp(tau) T_camera_world, translation first. Waits for the backend to have it.
  [[nodiscard]] Twist pose() const {
    if (pose_.size() == 0) return Twist::Zero();
    return Eigen::Map<const Twist>(pose_.values());
  }

  /// The same [6] in the backend's memory.
  [[nodiscard]] const double* pose_sums() const { return pose_sums_.data(); }

  void from_slot_sums(const Executor<Backend>& executor, const PlanesView& map, const SplatList<Backend>& splats,
                      const float* slot_sums) {
    size_ = splats.splats_size();
    gaussian_ = splats.gaussian();
    stride_ = (size_.most / 32 + 1) * 32;
    planes_.resize_discard(executor, static_cast<std::size_t>(stride_) * kNumPlanes);
    pose_rows_.resize_discard(executor, static_cast<std::size_t>(stride_) * 6);
    pose_sums_.resize_discard(executor, 6);
    for_each_lanes(
        executor, size_,
        GatherGradient{map, splats.view(), gaussian_, splats.slot_begin(), slot_sums, planes(), pose_rows_.data()});
    sum_rows(executor, pose_rows_.data(), stride_, size_, 6, pose_sums_.data());
    pose_.start(executor, pose_sums_.data(), 6);
  }

 private:
  ListSize size_;
  int stride_ = 0;
  const std::int32_t* gaussian_ = nullptr;
  Buffer<float, Backend> planes_, pose_rows_;
  Buffer<double, Backend> pose_sums_;
  Readback<double, Backend> pose_;
};

}  // namespace langgs
