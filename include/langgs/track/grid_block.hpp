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

/// The nearest Gaussian so far, and how far away the second one is. Lane by lane until somebody asks.
class NearestTwo {
 public:
  explicit NearestTwo(const Eigen::Vector3f& query) : query_(query) {}

  LANGGS_HOST_INLINE void visit(const GridBlock& block, int cell) {
    if (num_visits_ == kMaxVisits) settle();
    const int end = block.end(cell);
    for (int i = block.begin(cell); i < end; i += kNativeLanes) {
      const Native dx = *reinterpret_cast<const Unaligned*>(block.coordinate(0) + i) - query_.x();
      const Native dy = *reinterpret_cast<const Unaligned*>(block.coordinate(1) + i) - query_.y();
      const Native dz = *reinterpret_cast<const Unaligned*>(block.coordinate(2) + i) - query_.z();
      Native d = dx * dx + dy * dy + dz * dz;
      const Index slot = first_lanes() + i;
      d = host::detail::blend(slot < end, d, kInfinity - Native{});  // the lanes beyond belong to other cells
      const Index nearer = d < best_;
      second_ = host::detail::smaller(second_, host::detail::larger(d, best_));
      best_ = host::detail::smaller(d, best_);
      slot_ = host::detail::blend(nearer, slot | num_visits_ << kSlotBits, slot_);
    }
    blocks_[num_visits_++] = &block;
  }

  /// Takes the lanes' findings over. Must be called before anything is read.
  LANGGS_HOST_INLINE void settle() {
    const float least = least_of(best_);
    if (least < squared_distance) {
      const Index winners = best_ == least;
      const int winner = std::countr_zero(host::detail::bits_of_part(winners));
      squared_second = std::min(squared_second, squared_distance);
      squared_distance = least;
      const std::int32_t slot = slot_[winner];
      gaussian = &blocks_[slot >> kSlotBits]->gaussians()[slot & ((1 << kSlotBits) - 1)];
      best_ = host::detail::blend(first_lanes() == winner, kInfinity - Native{}, best_);
    }
    squared_second = std::min(squared_second, least_of(host::detail::smaller(best_, second_)));
    best_ = second_ = kInfinity - Native{};
    num_visits_ = 0;
  }

  const TargetGaussian* gaussian = nullptr;
  float squared_distance = kInfinity, squared_second = kInfinity;

 private:
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
  Native best_ = kInfinity - Native{}, second_ = kInfinity - Native{};
  Index slot_{};
  int num_visits_ = 0;
  std::array<const GridBlock*, kMaxVisits> blocks_;
};

}  // namespace detail

}  // namespace langgs
