// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "langgs/core/pose.hpp"
#include "langgs/host/lane_math.hpp"
#include "langgs/host/lane_reductions.hpp"
#include "langgs/host/varying.hpp"
#include "langgs/host/worker_pool.hpp"
#include "langgs/track/lanes3.hpp"
#include "langgs/track/photometric_term.hpp"
#include "langgs/track/source_cloud.hpp"
#include "langgs/track/target.hpp"

/// @file The G-ICP cost of a frame at a pose: correspondences, linearisation, value, 32 points at a time. Sums run over
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

class GicpCost {
 public:
  /// Takes the trackable points whose values are finite.
  explicit GicpCost(const SourceCloud& source, WorkerPool& pool)
      : pool_(pool), photometric_(source.intensity, source.T_colour_depth) {
    source_.reserve(source.points.size());
    // In four passes, so that the first quarter is a coarser grid over the whole image.
    for (int pass = 0; pass < kPasses; ++pass)
      for (int i = pass; i < source.size(); i += kPasses)
        if (source.trackable[i] && source.points[i].allFinite() && source.covariances[i].allFinite() &&
            source.weights[i] > 0 && source.weights[i] < std::numeric_limits<float>::infinity())
          source_.push_back(i);
    active_ = size();
    pitch_ = (source_.size() + kChunk - 1) / kChunk * kChunk;
    values_.assign(kNumRows * pitch_, 0.f);
    std::fill_n(row(kSafe), pitch_, -1.f);  // search at once
    candidates_.resize(source_.size());
    for (std::size_t k = 0; k < source_.size(); ++k) {
      const int i = source_[k];
      for (int a = 0; a < 3; ++a) row(kPoint + a)[k] = source.points[i][a];
      const Symmetric3 covariance = symmetric3(source.covariances[i]);
      for (int a = 0; a < 6; ++a) row(kSourceCovariance + a)[k] = covariance[a];
      row(kWeight)[k] = source.weights[i];
      centroid_ += source.points[i].cast<double>();
    }
    if (source_.empty()) return;
    centroid_ /= static_cast<double>(source_.size());
    double squared_radius = 0;
    for (const int i : source_) squared_radius += (source.points[i].cast<double>() - centroid_).squaredNorm();
    radius_ = std::max(1e-3, std::sqrt(squared_radius / static_cast<double>(source_.size())));
  }

  /// From now on looks at the first quarter of the points alone, if that is still a good number; or at all.
  void use_quarter(bool quarter) {
    constexpr int kEnough = 1024;
    const int part = (size() / kPasses + kChunk - 1) / kChunk * kChunk;
    active_ = quarter && part >= kEnough ? part : size();
  }

  [[nodiscard]] int size() const { return static_cast<int>(source_.size()); }
  /// Index of point k in the source cloud.
  [[nodiscard]] int source(int k) const { return source_[k]; }
  /// Squared distance of point k to its correspondence [m^2]; infinite without one.
  [[nodiscard]] float squared_distance(int k) const { return row(kSquaredDistance)[k]; }
  /// Mean of the points [m], camera frame, and their rms distance from it.
  [[nodiscard]] const Eigen::Vector3d& centroid() const { return centroid_; }
  [[nodiscard]] double radius() const { return radius_; }

  /// Nearest target of every point at pose T, if closer than `gate` [m] (A.6.2). The target is asked again only for
  /// points that may have moved nearer to others than to those it has named.
  template <RegistrationTarget Target>
  void find_correspondences(const Target& target, const Pose& T_world_camera, float gate) {
    const PlacementLanes3 T(T_world_camera);
    for_each_chunk([&](int, int begin, int end) {
      for (int k = begin; k < end; k += host::kLanes) {
        const Lanes3 query = T * load3(kPoint, k);
        const Lanes3 moved = query - load3(kQuery, k);
        Float squared(kInfinity), nearest(-1.f);
        for (int c = 0; c < kCandidates; ++c) {
          const Lanes3 to_target = load3(kCandidate + 3 * c, k) - query;
          const Float s = dot(to_target, to_target);
          nearest = select(s < squared, Float(static_cast<float>(c)), nearest);
          squared = min(s, squared);
        }
        const Float reach = sqrt(min(squared, gate * gate));
        select(squared < gate * gate, squared, Float(kInfinity)).store(row(kSquaredDistance) + k);
        // Written so that NaN asks for a search.
        const host::Mask unsure = !(sqrt(dot(moved, moved)) + reach <= load(kSafe, k));
        const std::uint32_t within = k + host::kLanes > size() ? (1u << (size() % host::kLanes)) - 1 : ~0u;
        const std::uint32_t search = host::bits_of(unsure) & within;
        std::uint32_t changed = host::bits_of((nearest != load(kNearest, k)) & (nearest >= 0.f)) & ~search & within;
        for (; changed != 0; changed &= changed - 1) {
          const int lane = std::countr_zero(changed);
          take(k + lane, static_cast<int>(nearest.lane(lane)));
        }
        for (std::uint32_t left = search; left != 0; left &= left - 1) {
          const int lane = std::countr_zero(left);
          ask(target, k + lane, {query.x.lane(lane), query.y.lane(lane), query.z.lane(lane)}, gate);
        }
      }
    });
  }

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
  using Float = host::Varying<float>;
  using Symmetric = SymmetricLanes3;
  static constexpr int kPasses = 4, kChunk = 256, kNumSums = 34, kCandidates = 1 + TargetMatch::kRunnersUp;
  static constexpr float kInfinity = std::numeric_limits<float>::infinity();
  static_assert(kChunk % host::kLanes == 0);

  /// Values of the points, a row of `pitch_` for each.
  enum Row {
    kPoint,                                // 3, camera frame
    kSourceCovariance = kPoint + 3,        // 6, camera frame
    kWeight = kSourceCovariance + 6,       //
    kQuery,                                // 3, where the target was last asked, world frame
    kCandidate = kQuery + 3,               // 3 each, the means that it named; infinite beyond as many as there are
    kSafe = kCandidate + 3 * kCandidates,  // no other target Gaussian was closer then
    kNearest,                              // which of them is the nearest; negative: none
    kMean,                                 // 3, of the nearest
    kTargetCovariance = kMean + 3,         // 6
    kIntensity = kTargetCovariance + 6,    // negative: not known
    kSquaredDistance,                      // to it now; infinite where it does not count
    kPrecision,                            // 6, (C_B + R C_A R^T)^-1 times weight and kernel, world frame
    kColourWeight = kPrecision + 6,        // photometric weight, kernel included
    kNumRows
  };

  [[nodiscard]] float* row(int r) { return values_.data() + r * pitch_; }
  [[nodiscard]] const float* row(int r) const { return values_.data() + r * pitch_; }
  LANGGS_HOST_INLINE Float load(int r, int k) const { return Float::load(row(r) + k); }
  LANGGS_HOST_INLINE Lanes3 load3(int r, int k) const { return {load(r, k), load(r + 1, k), load(r + 2, k)}; }
  LANGGS_HOST_INLINE Symmetric load_symmetric(int r, int k) const {
    return {load(r, k), load(r + 1, k), load(r + 2, k), load(r + 3, k), load(r + 4, k), load(r + 5, k)};
  }
  LANGGS_HOST_INLINE void store_symmetric(const Symmetric& m, int r, int k) {
    const Float* const values[6] = {&m.xx, &m.xy, &m.xz, &m.yy, &m.yz, &m.zz};
    for (int a = 0; a < 6; ++a) values[a]->store(row(r + a) + k);
  }

  template <RegistrationTarget Target>
  void ask(const Target& target, int k, const Eigen::Vector3f& query, float gate) {
    const TargetMatch match = target.nearest(query, gate);
    for (int a = 0; a < 3; ++a) row(kQuery + a)[k] = query[a];
    row(kSafe)[k] = match.rest_beyond;
    row(kSquaredDistance)[k] = match.gaussian != nullptr ? match.squared_distance : kInfinity;
    candidates_[k][0] = match.gaussian;
    std::copy_n(match.runners_up.begin(), kCandidates - 1, candidates_[k].begin() + 1);
    for (int c = 0; c < kCandidates; ++c)
      for (int a = 0; a < 3; ++a)
        row(kCandidate + 3 * c + a)[k] = candidates_[k][c] != nullptr ? candidates_[k][c]->mean[a] : kInfinity;
    if (match.gaussian != nullptr)
      take(k, 0);
    else
      row(kNearest)[k] = -1;
  }

  /// Candidate c of point k is its correspondence.
  void take(int k, int c) {
    const TargetGaussian& gaussian = *candidates_[k][c];
    row(kNearest)[k] = static_cast<float>(c);
    for (int a = 0; a < 3; ++a) row(kMean + a)[k] = gaussian.mean[a];
    for (int a = 0; a < 6; ++a) row(kTargetCovariance + a)[k] = gaussian.covariance[a];
    row(kIntensity)[k] = gaussian.intensity;
  }

  template <class Body>
  void for_each_chunk(Body&& body) {
    pool_.run((active_ + kChunk - 1) / kChunk,
              [&](int chunk) { body(chunk, chunk * kChunk, std::min(active_, (chunk + 1) * kChunk)); });
  }

  template <int N, class Body>
  [[nodiscard]] std::array<double, N> sum(Body&& body) {
    partial_.assign(static_cast<std::size_t>((active_ + kChunk - 1) / kChunk) * N, 0.f);
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

  WorkerPool& pool_;
  PhotometricTerm photometric_;
  bool uses_colour_ = false;                      // in the last linearisation
  float brightening_ = 0, next_brightening_ = 0;  // mean difference of the frame's grey values from the map's
  std::vector<int> source_;
  std::size_t pitch_ = 0;
  int active_ = 0;  // points looked at
  std::vector<float> values_, partial_;
  std::vector<std::array<const TargetGaussian*, kCandidates>> candidates_;  // of each point
  Eigen::Vector3d centroid_ = Eigen::Vector3d::Zero();
  double radius_ = 1;
};

}  // namespace langgs::detail
