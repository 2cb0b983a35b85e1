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
#include "langgs/track/source_cloud.hpp"
#include "langgs/track/target.hpp"

/// @file The points of a frame, 32 at a time, and the map Gaussian that each of them belongs to.

namespace langgs::detail {

/// Values of the points in rows, points in columns; correspondences as they were last found.
class Correspondences {
 public:
  /// Takes the trackable points whose values are finite.
  Correspondences(const SourceCloud& source, WorkerPool& pool) : pool_(pool) {
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

 protected:
  using Float = host::Varying<float>;
  using Symmetric = SymmetricLanes3;
  static constexpr int kPasses = 4, kChunk = 256, kCandidates = 1 + TargetMatch::kRunnersUp;
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

  [[nodiscard]] int num_chunks() const { return (active_ + kChunk - 1) / kChunk; }
  /// body(chunk, begin, end) for the points looked at.
  template <class Body>
  void for_each_chunk(Body&& body) {
    pool_.run(num_chunks(), [&](int chunk) { body(chunk, chunk * kChunk, std::min(active_, (chunk + 1) * kChunk)); });
  }

 private:
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

  WorkerPool& pool_;
  std::vector<int> source_;
  std::size_t pitch_ = 0;
  int active_ = 0;  // points looked at
  std::vector<float> values_;
  std::vector<std::array<const TargetGaussian*, kCandidates>> candidates_;  // of each point
  Eigen::Vector3d centroid_ = Eigen::Vector3d::Zero();
  double radius_ = 1;
};

}  // namespace langgs::detail
