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
#include <utility>
#include <vector>

#include "langgs/host/lane_reductions.hpp"
#include "langgs/host/varying.hpp"
#include "langgs/track/target.hpp"

/// @file A block of a target's grid, and the search through its cells.

namespace langgs {

namespace detail {

/// A cube of 4 x 4 x 4 cells and the Gaussians in it, cell by cell. Immutable once built.
class GridBlock {
 public:
  static constexpr int kSide = 4, kCells = 64;
  static constexpr int kSlotBits = 25;  ///< most Gaussians in a block: 33 million in a cube of 26 cm

  /// `gaussians` in the order of the map; cell_of(g) in [0, 64).
  template <class CellOf>
  GridBlock(const std::vector<TargetGaussian>& gaussians, CellOf&& cell_of) {
    std::vector<std::uint8_t> cells;
    cells.reserve(gaussians.size());
    for (const TargetGaussian& g : gaussians) {
      cells.push_back(static_cast<std::uint8_t>(cell_of(g)));
      ++begin_[cells.back() + 1];
    }
    for (int c = 0; c < kCells; ++c) {
      if (begin_[c + 1] > 0) occupied_ |= std::uint64_t{1} << c;
      begin_[c + 1] += begin_[c];
    }
    std::array<std::int32_t, kCells> next;
    std::copy_n(begin_.begin(), kCells, next.begin());
    gaussians_.resize(gaussians.size());
    coordinates_.assign(3 * pitch(), std::numeric_limits<float>::infinity());
    for (std::size_t i = 0; i < gaussians.size(); ++i) {
      const std::int32_t slot = next[cells[i]]++;
      gaussians_[slot] = gaussians[i];
      for (int a = 0; a < 3; ++a) coordinates_[a * pitch() + slot] = gaussians[i].mean[a];
    }
  }

  [[nodiscard]] std::uint64_t occupied() const { return occupied_; }  ///< bit c: cell c has Gaussians
  [[nodiscard]] const std::vector<TargetGaussian>& gaussians() const { return gaussians_; }
  [[nodiscard]] int begin(int cell) const { return begin_[cell]; }
  [[nodiscard]] int end(int cell) const { return begin_[cell + 1]; }
  [[nodiscard]] const float* coordinate(int axis) const { return coordinates_.data() + axis * pitch(); }

 private:
  /// A whole vector may be read at every Gaussian.
  [[nodiscard]] std::size_t pitch() const { return gaussians_.size() + host::Varying<float>::kNativeLanes; }

  std::uint64_t occupied_ = 0;
  std::array<std::int32_t, kCells + 1> begin_{};
  std::vector<TargetGaussian> gaussians_;
  std::vector<float> coordinates_;  // [3, pitch]
};

struct GridCell {
  const GridBlock* block;
  int cell;  ///< in [0, GridBlock::kCells)
};

/// The nearest Gaussians so far, and how far away the rest is. Lane by lane, two to a lane, until `settle`.
class NearestFew {
 public:
  static constexpr int kFew = 1 + TargetMatch::kRunnersUp;

  explicit NearestFew(const Eigen::Vector3f& query) : query_(query) {}

  /// Looks into some cells, at most kMaxVisits at once.
  LANGGS_HOST_INLINE void visit(const GridCell* cells, int count) {
    if (num_visits_ + count > kMaxVisits) settle();
    Lanes l = lanes_;
    for (int c = 0; c < count; ++c) {
      const GridBlock& block = *cells[c].block;
      const int end = block.end(cells[c].cell);
      for (int i = block.begin(cells[c].cell); i < end; i += kNativeLanes) {
        const Native dx = *reinterpret_cast<const Unaligned*>(block.coordinate(0) + i) - query_.x();
        const Native dy = *reinterpret_cast<const Unaligned*>(block.coordinate(1) + i) - query_.y();
        const Native dz = *reinterpret_cast<const Unaligned*>(block.coordinate(2) + i) - query_.z();
        Native d = dx * dx + dy * dy + dz * dz;
        const Index slot = first_lanes() + i;
        d = host::detail::blend(slot < end, d, kInfinity - Native{});  // the lanes beyond belong to other cells
        const Index id = slot | num_visits_ << kSlotBits;
        const Index nearest = d < l.best, nearer = d < l.second;
        l.rest = host::detail::smaller(l.rest, host::detail::larger(d, l.second));
        l.second = host::detail::smaller(l.second, host::detail::larger(d, l.best));
        l.second_id = host::detail::blend(nearest, l.best_id, host::detail::blend(nearer, id, l.second_id));
        l.best = host::detail::smaller(d, l.best);
        l.best_id = host::detail::blend(nearest, id, l.best_id);
      }
      blocks_[num_visits_++] = &block;
    }
    lanes_ = l;
  }

  /// Squared distance of the nearest Gaussian so far; infinite without one.
  [[nodiscard]] LANGGS_HOST_INLINE float squared_distance() const {
    return std::min(found_[0].squared_distance, least_of(lanes_.best));
  }

  /// Takes the lanes' findings over. To be called after the last visit.
  LANGGS_HOST_INLINE void settle() {
    Lanes l = lanes_;
    float least = least_of(l.best);
    for (int taken = 0; taken < kFew && least < found_.back().squared_distance; ++taken) {
      const int winner = std::countr_zero(host::detail::bits_of_part(l.best == least));
      const std::int32_t id = l.best_id[winner];
      insert({least, &blocks_[id >> kSlotBits]->gaussians()[id & ((1 << kSlotBits) - 1)]});
      const Index is_winner = first_lanes() == winner;
      l.best = host::detail::blend(is_winner, l.second, l.best);
      l.best_id = host::detail::blend(is_winner, l.second_id, l.best_id);
      l.second = host::detail::blend(is_winner, kInfinity - Native{}, l.second);
      least = least_of(l.best);
    }
    least_rest_ = std::min(least_rest_, least_of(host::detail::smaller(l.best, l.rest)));
    lanes_ = Lanes();
    num_visits_ = 0;
  }

  /// What was found within `radius` [m], given that everything within `reach` has been visited. After `settle`.
  [[nodiscard]] LANGGS_HOST_INLINE TargetMatch match(float radius, float reach) const {
    TargetMatch match;
    match.rest_beyond = radius;
    if (!(found_[0].squared_distance < radius * radius)) return match;
    match.gaussian = found_[0].gaussian;
    match.squared_distance = found_[0].squared_distance;
    for (int i = 1; i < kFew; ++i) match.runners_up[i - 1] = found_[i].gaussian;
    match.rest_beyond = std::min(std::sqrt(least_rest_), reach);
    return match;
  }

 private:
  struct Found {
    float squared_distance = kInfinity;
    const TargetGaussian* gaussian = nullptr;
  };

  LANGGS_HOST_INLINE void insert(Found next) {
    for (Found& f : found_)
      if (next.squared_distance < f.squared_distance) std::swap(next, f);
    least_rest_ = std::min(least_rest_, next.squared_distance);
  }

  using Native = host::Varying<float>::Native;
  using Unaligned = host::Varying<float>::Unaligned;
  using Index = host::Varying<std::int32_t>::Native;
  static constexpr int kNativeLanes = host::Varying<float>::kNativeLanes;
  static constexpr int kSlotBits = GridBlock::kSlotBits, kMaxVisits = 1 << (31 - kSlotBits);
  static constexpr float kInfinity = std::numeric_limits<float>::infinity();

  LANGGS_HOST_INLINE static Index first_lanes() { return host::lane_index().part[0]; }

  template <int kSpan, int... kLane>
  LANGGS_HOST_INLINE static Native turned(const Native& v, std::integer_sequence<int, kLane...>) {
#if defined(__CUDACC__)  // its front end loses the expansion below
    Native r;
    for (int l = 0; l < kNativeLanes; ++l) r[l] = v[(l + kSpan) % kNativeLanes];
    return r;
#else
    return __builtin_shufflevector(v, v, ((kLane + kSpan) % kNativeLanes)...);
#endif
  }
  template <int kSpan = kNativeLanes / 2>
  LANGGS_HOST_INLINE static float least_of(const Native& v) {
    const Native w = host::detail::smaller(v, turned<kSpan>(v, std::make_integer_sequence<int, kNativeLanes>{}));
    if constexpr (kSpan == 1)
      return w[0];
    else
      return least_of<kSpan / 2>(w);
  }

  Eigen::Vector3f query_;
  /// What each lane has seen: the nearest two, and how far away the rest is (squared).
  struct Lanes {
    Native best, second, rest;
    Index best_id, second_id;  // visit and slot

    LANGGS_HOST_INLINE Lanes()  // nvcc's front end breaks off at initialisers of vectors beside the members
    {
      best = second = rest = kInfinity - Native{};
      best_id = second_id = Index{};
    }
  };
  Lanes lanes_;
  std::array<Found, kFew> found_;  // ascending
  float least_rest_ = kInfinity;
  int num_visits_ = 0;
  std::array<const GridBlock*, kMaxVisits> blocks_;
};

}  // namespace detail

}  // namespace langgs
