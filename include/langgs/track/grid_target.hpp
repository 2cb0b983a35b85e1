// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "langgs/core/rng.hpp"
#include "langgs/track/grid_block.hpp"
#include "langgs/track/target.hpp"

/// @file Map Gaussians in a sparse grid: exact nearest neighbours, and updates that share what has not changed.

namespace langgs {

/// Map Gaussians in cubic cells, sixty-four cells to a block.
///
/// Immutable, and cheap to renew: `renewed` shares the blocks whose Gaussians have stayed where they were. Share it
/// between threads as std::shared_ptr<const GridTarget>. Gaussians with values that are not finite, or farther than
/// kMaxTargetCoordinate from the origin, are left out.
class GridTarget {
 public:
  /// Side of a cell [m]. Half of it is searched in one look at eight cells, and covers the distances that keyframe
  /// selection and insertion ask for.
  static constexpr float kCell = 0.064f;
  /// How much farther than the nearest Gaussian is looked [m]: a query may move by half of it before it is asked again.
  static constexpr float kMargin = 0.009f;

  GridTarget() = default;
  explicit GridTarget(const std::vector<TargetGaussian>& gaussians) : GridTarget(GridTarget{}.renewed(gaussians)) {}

  /// The target of a map that has changed: blocks in which no Gaussian came, went, or moved by `tolerance` [m] are
  /// shared with this one.
  [[nodiscard]] GridTarget renewed(const std::vector<TargetGaussian>& gaussians, float tolerance = 0) const {
    // Gaussians block by block, in the map's order within each.
    GridTarget result;
    std::vector<std::int32_t> block_of(gaussians.size(), -1), first;
    for (std::size_t i = 0; i < gaussians.size(); ++i) {
      if (!detail::is_usable(gaussians[i])) continue;
      const std::int32_t block = result.table_.insert(key(block_coordinates(gaussians[i].mean)));
      block_of[i] = block;
      if (block == static_cast<std::int32_t>(first.size())) first.push_back(0);
      ++first[block];
      ++result.size_;
    }
    std::int32_t sum = 0;
    for (std::int32_t& f : first) sum += std::exchange(f, sum);
    std::vector<std::int32_t> next = first, order(sum);
    for (std::size_t i = 0; i < gaussians.size(); ++i)
      if (block_of[i] >= 0) order[next[block_of[i]]++] = static_cast<std::int32_t>(i);

    std::vector<TargetGaussian> members;
    for (std::size_t b = 0; b < first.size(); ++b) {
      members.clear();
      for (std::int32_t k = first[b]; k < next[b]; ++k) members.push_back(gaussians[order[k]]);
      result.blocks_.push_back(shared_or_new(result.table_.key(static_cast<std::int32_t>(b)), members, tolerance));
    }
    return result;
  }

  [[nodiscard]] int size() const { return size_; }
  [[nodiscard]] int num_blocks() const { return static_cast<int>(blocks_.size()); }
  /// Blocks that this target has in common with another one.
  [[nodiscard]] int num_shared_with(const GridTarget& other) const {
    int shared = 0;
    for (const auto& block : blocks_)
      shared += std::find(other.blocks_.begin(), other.blocks_.end(), block) != other.blocks_.end();
    return shared;
  }

  /// f(gaussian) for every `step`th Gaussian.
  template <class F>
  void for_each(int step, F&& f) const {
    std::size_t next = 0;
    for (const auto& block : blocks_) {
      const std::vector<TargetGaussian>& members = block->gaussians();
      for (; next < members.size(); next += step) f(members[next]);
      next -= members.size();
    }
  }

  /// The Gaussian nearest to `query` if it is closer than `radius` [m]. Exact.
  [[nodiscard]] TargetMatch nearest(const Eigen::Vector3f& query, float radius) const {
    detail::NearestFew found(query);
    if (blocks_.empty() || !(query.cwiseAbs().maxCoeff() <= kMaxTargetCoordinate) || !query.allFinite())
      return found.match(radius, radius);
    const Eigen::Array3f in_cells = query.array() * (1 / kCell);
    const Eigen::Array3f floor = in_cells.floor();
    const Eigen::Array3i own = floor.cast<int>();
    const Eigen::Array3f into = in_cells - floor;
    // The cells next to the query, by axis: on which side, and how far away.
    const Eigen::Array3f aside = kCell * into.min(1 - into);
    const Eigen::Array3f squared = aside.square();
    const int side[3] = {into.x() < 0.5f ? -1 : 1, into.y() < 0.5f ? -1 : 1, into.z() < 0.5f ? -1 : 1};
    const Eigen::Array3i own_block = block_of_cell(own);
    const std::int32_t own_index = table_.find(key(own_block));
    detail::GridCell cells[7];
    int count = 0;
    if (own_index >= 0) cells[count++] = {blocks_[own_index].get(), cell_in_block(own)};
    found.visit(cells, count);
    float reach = reach_of(found, radius);
    // Which of the seven other cells lie within reach; nobody can guess that, so there is no branch.
    const float limit = reach * reach, in_plane[4] = {0, squared.x(), squared.y(), squared.x() + squared.y()};
    unsigned within = 0;
    for (unsigned corner = 1; corner < 8; ++corner)
      within |= unsigned{in_plane[corner & 3] + (corner & 4 ? squared.z() : 0) <= limit} << corner;
    count = 0;
    for (; within != 0; within &= within - 1) {
      const int corner = std::countr_zero(within);
      const Eigen::Array3i cell(own.x() + (corner & 1 ? side[0] : 0), own.y() + (corner & 2 ? side[1] : 0),
                                own.z() + (corner & 4 ? side[2] : 0));
      const Eigen::Array3i block = block_of_cell(cell);
      const std::int32_t index = (block == own_block).all() ? own_index : table_.find(key(block));
      if (index >= 0) cells[count++] = {blocks_[index].get(), cell_in_block(cell)};
    }
    found.visit(cells, count);
    const float searched = std::min(reach, kCell - aside.maxCoeff());
    reach = reach_of(found, radius);
    if (searched < reach && found.squared_distance() > searched * searched)
      visit_others(query, own, side, reach, found);
    else
      reach = searched;
    found.settle();
    return found.match(radius, reach);
  }

 private:
  /// Keys of blocks, each with the order of its insertion; open addressing.
  class Table {
   public:
    static constexpr std::uint64_t kEmpty = ~std::uint64_t{0};

    [[nodiscard]] std::int32_t find(std::uint64_t key) const {
      for (std::size_t at = mix64(key) & mask();; at = (at + 1) & mask()) {
        if (slots_[at].first == key) return slots_[at].second;
        if (slots_[at].first == kEmpty) return -1;
      }
    }
    std::int32_t insert(std::uint64_t key) {
      if (keys_.empty() || keys_.size() * 2 > slots_.size()) grow();
      const std::int32_t known = find(key);
      if (known >= 0) return known;
      const auto index = static_cast<std::int32_t>(keys_.size());
      keys_.push_back(key);
      place(key, index);
      return index;
    }
    [[nodiscard]] std::uint64_t key(std::int32_t index) const { return keys_[index]; }

   private:
    [[nodiscard]] std::size_t mask() const { return slots_.size() - 1; }
    void place(std::uint64_t key, std::int32_t index) {
      std::size_t at = mix64(key) & mask();
      while (slots_[at].first != kEmpty) at = (at + 1) & mask();
      slots_[at] = {key, index};
    }
    void grow() {
      slots_.assign(std::max<std::size_t>(64, 2 * slots_.size()), {kEmpty, -1});
      for (std::size_t i = 0; i < keys_.size(); ++i) place(keys_[i], static_cast<std::int32_t>(i));
    }

    std::vector<std::pair<std::uint64_t, std::int32_t>> slots_;
    std::vector<std::uint64_t> keys_;
  };

  using Block = detail::GridBlock;
  static constexpr int kSide = Block::kSide;

  [[nodiscard]] static Eigen::Array3i cell_coordinates(const Eigen::Vector3f& mean) {
    return (mean.array() * (1 / kCell)).floor().cast<int>();
  }
  [[nodiscard]] static Eigen::Array3i block_of_cell(const Eigen::Array3i& cell) {
    return {cell.x() >> 2, cell.y() >> 2, cell.z() >> 2};
  }
  [[nodiscard]] static Eigen::Array3i block_coordinates(const Eigen::Vector3f& mean) {
    return block_of_cell(cell_coordinates(mean));
  }
  [[nodiscard]] static std::uint64_t key(const Eigen::Array3i& block) {
    std::uint64_t key = 0;
    for (int a = 0; a < 3; ++a) key = key << 21 | (static_cast<std::uint32_t>(block[a]) & 0x1FFFFF);
    return key;
  }
  [[nodiscard]] static int cell_in_block(const Eigen::Array3i& cell) {
    return (cell.x() & 3) | (cell.y() & 3) << 2 | (cell.z() & 3) << 4;
  }

  [[nodiscard]] std::shared_ptr<const Block> shared_or_new(std::uint64_t key,
                                                           const std::vector<TargetGaussian>& members,
                                                           float tolerance) const {
    const auto cell_of = [](const TargetGaussian& g) { return cell_in_block(cell_coordinates(g.mean)); };
    const std::int32_t former = blocks_.empty() ? -1 : table_.find(key);
    if (former >= 0 && is_same(*blocks_[former], members, tolerance, cell_of)) return blocks_[former];
    return std::make_shared<const Block>(members, cell_of);
  }

  /// True if the block holds these Gaussians, none moved by more than the tolerance.
  template <class CellOf>
  [[nodiscard]] static bool is_same(const Block& block, const std::vector<TargetGaussian>& members, float tolerance,
                                    CellOf&& cell_of) {
    if (block.gaussians().size() != members.size()) return false;
    std::array<std::int32_t, Block::kCells> next;
    for (int c = 0; c < Block::kCells; ++c) next[c] = block.begin(c);
    for (const TargetGaussian& g : members) {
      const int cell = cell_of(g);
      if (next[cell] == block.end(cell)) return false;
      const TargetGaussian& former = block.gaussians()[next[cell]++];
      if (!((former.mean - g.mean).cwiseAbs().maxCoeff() <= tolerance)) return false;
    }
    return true;
  }

  /// How far to look given what was found: a little farther than the best, so that the answer holds for a while.
  [[nodiscard]] static float reach_of(const detail::NearestFew& found, float radius) {
    return std::min(std::sqrt(found.squared_distance()) + kMargin, radius);
  }

  /// Goes on where the eight cells did not settle it: all other cells within reach, block by block.
  void visit_others(const Eigen::Vector3f& query, const Eigen::Array3i& own, const int (&side)[3], float reach,
                    detail::NearestFew& found) const {
    const auto seen = [&](int cell, int a) { return cell == own[a] || cell == own[a] + side[a]; };
    const Eigen::Array3i low = ((query.array() - reach) * (1 / kCell)).floor().cast<int>();
    const Eigen::Array3i high = ((query.array() + reach) * (1 / kCell)).floor().cast<int>();
    const Eigen::Array3i first = block_of_cell(low), last = block_of_cell(high);
    Eigen::Array3i b;
    for (b.z() = first.z(); b.z() <= last.z(); ++b.z())
      for (b.y() = first.y(); b.y() <= last.y(); ++b.y())
        for (b.x() = first.x(); b.x() <= last.x(); ++b.x()) {
          const std::int32_t index = table_.find(key(b));
          if (index < 0) continue;
          const Eigen::Array3i origin = kSide * b;
          for (std::uint64_t cells = blocks_[index]->occupied(); cells != 0; cells &= cells - 1) {
            const int local = std::countr_zero(cells);
            const Eigen::Array3i cell = origin + Eigen::Array3i(local & 3, local >> 2 & 3, local >> 4);
            if (seen(cell.x(), 0) && seen(cell.y(), 1) && seen(cell.z(), 2)) continue;
            const Eigen::Array3f corner = kCell * cell.cast<float>();
            const Eigen::Array3f outside = (corner - query.array()).max(query.array() - corner - kCell).max(0);
            if (!(outside.square().sum() <= reach * reach)) continue;
            const detail::GridCell one{blocks_[index].get(), local};
            found.visit(&one, 1);
          }
        }
  }

  int size_ = 0;
  Table table_;
  std::vector<std::shared_ptr<const Block>> blocks_;  // in the order of the table's keys
};

static_assert(RegistrationTarget<GridTarget>);

}  // namespace langgs
