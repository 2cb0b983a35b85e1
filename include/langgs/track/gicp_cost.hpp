// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "langgs/core/pose.hpp"
#include "langgs/host/lane_math.hpp"
#include "langgs/host/lane_reductions.hpp"
#include "langgs/host/varying.hpp"
#include "langgs/host/worker_pool.hpp"
#include "langgs/track/correspondences.hpp"
#include "langgs/track/lanes3.hpp"
#include "langgs/track/photometric_term.hpp"
#include "langgs/track/source_cloud.hpp"

/// @file The G-ICP cost of a frame at a pose: linearisation and value, 32 points at a time. Sums run over
/// chunks of a fixed size and are added in chunk order, so they do not depend on the number of threads.

namespace langgs::detail {

/// Normal equations of a step [rho; theta] that moves world points x by rho + theta x (x - centre).
struct NormalEquations {
  Eigen::Matrix<double, 6, 6> hessian = Eigen::Matrix<double, 6, 6>::Zero();  ///< sum J^T M J, upper triangle
  Twist gradient = Twist::Zero();                                             ///< sum J^T M e
  double cost = 0;                                                            ///< sum e^T M e
  double squared_normal_distance = 0;                                         ///< weighted sum [m^2]
  double weight = 0;                                                          ///< sum of weights, kernel included
  int count = 0;                                                              ///< correspondences
};

/// Weights of the cost's terms.
struct GicpWeights {
  double robust_width;        ///< residual along the normal with half its weight (Cauchy kernel) [m]; 0: no kernel
  double photometric_weight;  ///< of a squared difference of grey values; 0: none
  double photometric_width;   ///< difference of grey values with half its weight
};

/// Correspondences and what they cost.
class GicpCost : public Correspondences {
 public:
  GicpCost(const SourceCloud& source, WorkerPool& pool)
      : Correspondences(source, pool), photometric_(source.intensity, source.T_colour_depth) {}

  /// Linearises about pose T with the present correspondences, whose precisions it sets for that pose (A.6.3).
  [[nodiscard]] NormalEquations linearise(const Pose& T_world_camera, const Eigen::Vector3d& centre,
                                          const GicpWeights& weights) {
    const PlacementLanes3 T(T_world_camera);
    uses_colour_ = weights.photometric_weight > 0;
    const PhotometricLanes colour = photometric_.at(T_world_camera, brightening_, uses_colour_);
    const Eigen::Vector3f c3 = centre.cast<float>();
    const Lanes3 c{Float(c3.x()), Float(c3.y()), Float(c3.z())};
    const auto inverse_square = [](double width) { return width > 0 ? static_cast<float>(1 / (width * width)) : 0.f; };
    const Float robust(inverse_square(weights.robust_width)), grey(inverse_square(weights.photometric_width));
    const auto photometric_weight = static_cast<float>(weights.photometric_weight);
    const auto sums = sum<kNumSums>([&](int k, Float(&s)[kNumSums]) LANGGS_INLINE_LAMBDA {
      const Lanes3 mean = load3(kMean, k), x = T * load3(kPoint, k), d = x - c;
      const Lanes3 e = mean - x;
      Symmetric m = inverse(load_symmetric(kTargetCovariance, k) + T.rotate(load_symmetric(kSourceCovariance, k)));
      const Float squared = dot(e, m * e);
      // The trace is nearly the precision along the normal alone: this is the distance along it.
      const Float squared_normal = squared / m.trace();
      const host::Mask valid = (load(kSquaredDistance, k) < kInfinity) & (squared_normal >= 0.f) &
                               (squared < kInfinity) & (m.trace() < kInfinity);
      const Float zero(0.f), kernel = 1.f / (1.f + squared_normal * robust);
      const Float weight = select(valid, load(kWeight, k) * kernel, zero);
      m = weight * select(valid, m, Symmetric{zero, zero, zero, zero, zero, zero});
      store_symmetric(m, kPrecision, k);
      const Lanes3 error = select(valid, e, Lanes3{zero, zero, zero});
      Lanes3 force = m * error;

      // The grey value has the same Jacobian, along its gradient in space.
      const PhotometricLanes::Value p = colour.value(mean, load(kIntensity, k));
      const Float colour_weight =
          select(p.valid & valid, weight * photometric_weight / (1.f + p.residual * p.residual * grey), zero);
      colour_weight.store(row(kColourWeight) + k);
      const Float residual = select(p.valid, p.residual, zero), pull = colour_weight * residual;
      const Lanes3 g = select(p.valid, p.gradient, Lanes3{zero, zero, zero});
      m = m + colour_weight * Symmetric{g.x * g.x, g.x * g.y, g.x * g.z, g.y * g.y, g.y * g.z, g.z * g.z};
      force = Lanes3{force.x + pull * g.x, force.y + pull * g.y, force.z + pull * g.z};

      // J = [-I, hat(d)]: rows of M hat, then the upper triangle of hat^T M hat.
      const Lanes3 px = cross({m.xx, m.xy, m.xz}, d), py = cross({m.xy, m.yy, m.yz}, d),
                   pz = cross({m.xz, m.yz, m.zz}, d);
      const Lanes3 torque = cross(d, force);
      const Float terms[kNumSums] = {m.xx,
                                     m.xy,
                                     m.xz,
                                     m.yy,
                                     m.yz,
                                     m.zz,
                                     px.x,
                                     px.y,
                                     px.z,
                                     py.x,
                                     py.y,
                                     py.z,
                                     pz.x,
                                     pz.y,
                                     pz.z,
                                     d.z * py.x - d.y * pz.x,
                                     d.z * py.y - d.y * pz.y,
                                     d.z * py.z - d.y * pz.z,
                                     d.x * pz.y - d.z * px.y,
                                     d.x * pz.z - d.z * px.z,
                                     d.y * px.z - d.x * py.z,
                                     force.x,
                                     force.y,
                                     force.z,
                                     torque.x,
                                     torque.y,
                                     torque.z,
                                     weight * select(valid, squared, zero),
                                     weight * select(valid, squared_normal, zero),
                                     weight,
                                     select(valid, Float(1.f), zero),
                                     pull * residual,
                                     pull,
                                     colour_weight};
      for (int i = 0; i < kNumSums; ++i) s[i] += terms[i];
    });
    NormalEquations result = assembled(sums);
    // The mean difference is a change of exposure, to be left out from the next linearisation on.
    next_brightening_ = brightening_ + (sums[33] > 0 ? static_cast<float>(sums[32] / sums[33]) : 0.f);
    return result;
  }

  /// The cost at another pose with the correspondences and weights of the last linearisation.
  [[nodiscard]] double value(const Pose& T_world_camera) {
    const PlacementLanes3 T(T_world_camera);
    const PhotometricLanes colour = photometric_.at(T_world_camera, brightening_, uses_colour_);
    return sum<1>([&](int k, Float(&s)[1]) LANGGS_INLINE_LAMBDA {
      const Lanes3 mean = load3(kMean, k), e = mean - T * load3(kPoint, k);
      const PhotometricLanes::Value p = colour.value(mean, load(kIntensity, k));
      const Float photometric = load(kColourWeight, k) * select(p.valid, p.residual * p.residual, Float(0.f));
      const Float cost = dot(e, load_symmetric(kPrecision, k) * e) + photometric;
      s[0] += select(load(kSquaredDistance, k) < kInfinity, cost, Float(0.f));
    })[0];
  }

  /// To be called after a step: what the last linearisation learnt about the exposure holds from now on.
  void adopt_exposure() { brightening_ = next_brightening_; }

 private:
  static constexpr int kNumSums = 34;

  template <int N, class Body>
  [[nodiscard]] std::array<double, N> sum(Body&& body) {
    partial_.assign(static_cast<std::size_t>(num_chunks()) * N, 0.f);
    for_each_chunk([&](int chunk, int begin, int end) {
      Float lanes[N];
      for (Float& l : lanes) l = Float(0.f);
      for (int k = begin; k < end; k += host::kLanes) body(k, lanes);
      float sums[N];
      host::reduce_sums(lanes, sums);
      std::copy_n(sums, N, partial_.data() + chunk * N);
    });
    std::array<double, N> total{};
    for (std::size_t i = 0; i < partial_.size(); ++i) total[i % N] += static_cast<double>(partial_[i]);
    return total;
  }

  [[nodiscard]] static NormalEquations assembled(const std::array<double, kNumSums>& s) {
    NormalEquations n;
    n.hessian.row(0) << s[0], s[1], s[2], -s[6], -s[7], -s[8];
    n.hessian.row(1) << s[1], s[3], s[4], -s[9], -s[10], -s[11];
    n.hessian.row(2) << s[2], s[4], s[5], -s[12], -s[13], -s[14];
    n.hessian.row(3).tail<3>() << s[15], s[16], s[17];
    n.hessian.row(4).tail<2>() << s[18], s[19];
    n.hessian(5, 5) = s[20];
    n.gradient << -s[21], -s[22], -s[23], -s[24], -s[25], -s[26];
    n.cost = s[27] + s[31];
    n.squared_normal_distance = s[28];
    n.weight = s[29];
    n.count = static_cast<int>(std::lround(s[30]));
    return n;
  }

  PhotometricTerm photometric_;
  bool uses_colour_ = false;                      // in the last linearisation
  float brightening_ = 0, next_brightening_ = 0;  // mean difference of the frame's grey values from the map's
  std::vector<float> partial_;
};

}  // namespace langgs::detail
