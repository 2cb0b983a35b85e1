// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <nanoflann.hpp>
#include <utility>
#include <vector>

#include "langgs/track/target.hpp"

/// @file Map Gaussians in a k-d tree: a thin wrapper that hides what differs between nanoflann 1.4 and 1.5 and later.

namespace langgs {

namespace detail {

#if NANOFLANN_VERSION < 0x150
using NanoflannSearchParameters = nanoflann::SearchParams;
#else
using NanoflannSearchParameters = nanoflann::SearchParameters;
#endif

/// nanoflann result set of the nearest two points within a bound.
struct BoundedNearestTwo {
  using DistanceType = float;
  using IndexType = std::uint32_t;

  float bound;  ///< squared
  float best = std::numeric_limits<float>::infinity(), second = best;
  std::int64_t index = -1;

  bool addPoint(float squared_distance, std::uint32_t i) {
    if (squared_distance < best) {
      second = best;
      best = squared_distance;
      index = i;
    } else {
      second = std::min(second, squared_distance);
    }
    return true;
  }
  [[nodiscard]] float worstDist() const { return std::min(second, bound); }
  [[nodiscard]] bool full() const { return index >= 0; }
  [[nodiscard]] bool empty() const { return index < 0; }
  [[nodiscard]] std::size_t size() const { return full() ? 1 : 0; }
  void sort() {}
};

}  // namespace detail

/// Map Gaussians in nanoflann's k-d tree: what GridTarget is held against. The same rules for what is left out.
class KdTreeTarget {
 public:
  explicit KdTreeTarget(std::vector<TargetGaussian> gaussians)
      : gaussians_(usable(std::move(gaussians))),
        index_(3, *this, nanoflann::KDTreeSingleIndexAdaptorParams(kLeafSize)) {
    if (!gaussians_.empty()) index_.buildIndex();
  }
  KdTreeTarget(const KdTreeTarget&) = delete;  // the index refers to this object
  KdTreeTarget& operator=(const KdTreeTarget&) = delete;

  [[nodiscard]] int size() const { return static_cast<int>(gaussians_.size()); }

  /// The Gaussian nearest to `query` if it is closer than `radius` [m].
  [[nodiscard]] TargetMatch nearest(const Eigen::Vector3f& query, float radius) const {
    if (gaussians_.empty() || !query.allFinite()) return {nullptr, 0, radius};
    detail::BoundedNearestTwo found{radius * radius};
    index_.findNeighbors(found, query.data(), detail::NanoflannSearchParameters{});
    if (!(found.best < radius * radius)) return {nullptr, 0, radius};
    return {&gaussians_[found.index], found.best, std::min(std::sqrt(found.second), radius)};
  }

  // nanoflann's dataset interface.
  [[nodiscard]] std::size_t kdtree_get_point_count() const { return gaussians_.size(); }
  [[nodiscard]] float kdtree_get_pt(std::size_t i, std::size_t axis) const {
    return gaussians_[i].mean[static_cast<Eigen::Index>(axis)];
  }
  template <class Box>
  [[nodiscard]] bool kdtree_get_bbox(Box&) const {
    return false;
  }

 private:
  static constexpr int kLeafSize = 16;

  using Metric = nanoflann::L2_Simple_Adaptor<float, KdTreeTarget>;
  using Index = nanoflann::KDTreeSingleIndexAdaptor<Metric, KdTreeTarget, 3, std::uint32_t>;

  static std::vector<TargetGaussian> usable(std::vector<TargetGaussian> gaussians) {
    std::erase_if(gaussians, [](const TargetGaussian& g) { return !detail::is_usable(g); });
    return gaussians;
  }

  std::vector<TargetGaussian> gaussians_;
  Index index_;
};

static_assert(RegistrationTarget<KdTreeTarget>);

}  // namespace langgs
