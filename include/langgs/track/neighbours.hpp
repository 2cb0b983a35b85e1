// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <nanoflann.hpp>
#include <utility>
#include <vector>

/// @file Exact nearest neighbour in a fixed set of points: a thin wrapper that hides what differs between nanoflann
/// 1.4 and 1.5 and later.

namespace langgs {

/// A nearest point: its index and squared distance [m^2]. `index` is -1 if nothing lies within the search bound.
struct Neighbour {
  int index = -1;
  float squared_distance = 0;
};

namespace detail {

#if NANOFLANN_VERSION < 0x150
using NanoflannSearchParameters = nanoflann::SearchParams;
#else
using NanoflannSearchParameters = nanoflann::SearchParameters;
#endif

/// nanoflann result set of one nearest point within a bound that is known beforehand: a good bound prunes the descent.
struct BoundedNearest {
  using DistanceType = float;
  using IndexType = std::uint32_t;

  Neighbour best;

  bool addPoint(float squared_distance, std::uint32_t index) {
    if (squared_distance < best.squared_distance) best = {static_cast<int>(index), squared_distance};
    return true;
  }
  [[nodiscard]] float worstDist() const { return best.squared_distance; }
  [[nodiscard]] bool full() const { return best.index >= 0; }
  [[nodiscard]] bool empty() const { return best.index < 0; }
  [[nodiscard]] std::size_t size() const { return full() ? 1 : 0; }
  void sort() {}
};

}  // namespace detail

/// A k-d tree over N points that it owns. Immutable after construction; concurrent queries are safe.
class NeighbourTree {
 public:
  /// points: [N, 3], finite; N may be 0.
  explicit NeighbourTree(std::vector<Eigen::Vector3f> points)
      : points_(std::move(points)), index_(3, *this, nanoflann::KDTreeSingleIndexAdaptorParams(kLeafSize)) {
    if (!points_.empty()) index_.buildIndex();
  }
  NeighbourTree(const NeighbourTree&) = delete;  // the index refers to this object
  NeighbourTree& operator=(const NeighbourTree&) = delete;

  [[nodiscard]] int size() const { return static_cast<int>(points_.size()); }
  [[nodiscard]] const Eigen::Vector3f& operator[](int i) const { return points_[i]; }

  /// The point nearest to `query` that is strictly closer than `bound` says, else `bound` itself. A caller who knows a
  /// near point already passes it with its distance; one who knows only a radius passes {-1, radius^2}.
  [[nodiscard]] Neighbour nearest(const Eigen::Vector3f& query, Neighbour bound) const {
    if (points_.empty() || !query.allFinite()) return bound;
    detail::BoundedNearest result{bound};
    index_.findNeighbors(result, query.data(), detail::NanoflannSearchParameters{});
    return result.best;
  }

  // nanoflann's dataset interface.
  [[nodiscard]] std::size_t kdtree_get_point_count() const { return points_.size(); }
  [[nodiscard]] float kdtree_get_pt(std::size_t i, std::size_t axis) const {
    return points_[i][static_cast<Eigen::Index>(axis)];
  }
  template <class Box>
  [[nodiscard]] bool kdtree_get_bbox(Box&) const {
    return false;
  }

 private:
  static constexpr int kLeafSize = 16;

  using Metric = nanoflann::L2_Simple_Adaptor<float, NeighbourTree>;
  using Index = nanoflann::KDTreeSingleIndexAdaptor<Metric, NeighbourTree, 3, std::uint32_t>;

  std::vector<Eigen::Vector3f> points_;
  Index index_;
};

}  // namespace langgs
