// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
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

/// nanoflann result set of the nearest few points, one more than are named, within a bound.
struct BoundedNearestFew {
  using DistanceType = float;
  using IndexType = std::uint32_t;
  static constexpr int kFew = 1 + TargetMatch::kRunnersUp;
  struct Found {
    float squared_distance = std::numeric_limits<float>::infinity();
    std::uint32_t index = 0;
  };

  float bound;                        ///< squared
  std::array<Found, kFew + 1> found;  ///< ascending

  bool addPoint(float squared_distance, std::uint32_t i) {
    Found next{squared_distance, i};
    for (Found& f : found)
      if (next.squared_distance < f.squared_distance) std::swap(next, f);
    return true;
  }
  [[nodiscard]] float worstDist() const { return std::min(found.back().squared_distance, bound); }
  [[nodiscard]] bool full() const { return !empty(); }
  [[nodiscard]] bool empty() const { return found[0].squared_distance == std::numeric_limits<float>::infinity(); }
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
    TargetMatch match;
    match.rest_beyond = radius;
    if (gaussians_.empty() || !query.allFinite()) return match;
    detail::BoundedNearestFew set{radius * radius, {}};
    index_.findNeighbors(set, query.data(), detail::NanoflannSearchParameters{});
    const auto& found = set.found;
    if (!(found[0].squared_distance < set.bound)) return match;
    match.gaussian = &gaussians_[found[0].index];
    match.squared_distance = found[0].squared_distance;
    for (int i = 1; i < set.kFew && found[i].squared_distance < set.bound; ++i)
      match.runners_up[i - 1] = &gaussians_[found[i].index];
    match.rest_beyond = std::min(std::sqrt(found.back().squared_distance), radius);
    return match;
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
