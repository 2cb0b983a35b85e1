// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

#include "langgs/device/block.hpp"
#include "langgs/device/math.hpp"

namespace langgs {

/// A row of FeatDim channels as a warp works on it: up to 512 consecutive channels at a time, a value for each 32 of
/// them. So a row of the paper's 512 channels is read as a whole, which is how memory likes to be read; a CPU adds up
/// in its first-level cache, a GPU in registers. Longer rows are cut evenly: 768 channels are 2 blocks of 384, so that
/// no block has an end to check for.
template <int FeatDim>
struct FeatureChannels {
  static constexpr int kLanes = 32;
  static constexpr int kNumBlocks = (FeatDim + 511) / 512;
  static constexpr int kVectors = (FeatDim + kNumBlocks * kLanes - 1) / (kNumBlocks * kLanes);
  static constexpr int kBlock = kVectors * kLanes;

  template <class V>
  struct Values {
    V vector[kVectors];

    LANGGS_INLINE Values() { LANGGS_UNROLL for (int v = 0; v < kVectors; ++v) vector[v] = V(0.f); }
    /// this += factor * row[c ..]
    template <class Warp, class T>
    LANGGS_INLINE void add(const Warp& warp, float factor, const T* row, int c) {
      LANGGS_UNROLL for (int v = 0; v < kVectors; ++v) vector[v] +=
          factor * warp.load_channels(row + c + kLanes * v, count(c, v));
    }
  };

  /// Channels from c + 32 v on, as far as 32 of them matter: the compiler sees where no row ends within a block.
  [[nodiscard]] static LANGGS_INLINE int count(int c, int v) {
    return FeatDim % kBlock == 0 ? kLanes : FeatDim - c - kLanes * v;
  }
  /// Bytes of the block from c on in a row of T.
  template <class T>
  [[nodiscard]] static LANGGS_INLINE std::size_t bytes(const T*, int c) {
    return static_cast<std::size_t>(min(kBlock, FeatDim - c)) * sizeof(T);
  }
  /// Row i of [N, FeatDim].
  template <class T>
  [[nodiscard]] static LANGGS_INLINE T* row(T* base, std::int32_t i) {
    return base + static_cast<std::ptrdiff_t>(i) * FeatDim;
  }
};

/// How the samples of a grid are dealt out to blocks: patches of 16 x 16, whose pixels share Gaussians and therefore
/// what a cache holds.
struct FeaturePatches {
  static constexpr int kSide = 16;
  int width = 0, height = 0;

  [[nodiscard]] LANGGS_HD int columns() const { return (width + kSide - 1) / kSide; }
  [[nodiscard]] LANGGS_HD int count() const { return columns() * ((height + kSide - 1) / kSide); }
  /// The patch that has pixel p.
  [[nodiscard]] LANGGS_HD int of(int p) const { return p / width / kSide * columns() + p % width / kSide; }

  /// Calls `body(p)` for the pixels of a patch that are the warp's: every kWarps-th row.
  template <int kWarps, class Body>
  LANGGS_INLINE void for_each_pixel(int patch, int warp, Body&& body) const {
    const int left = patch % columns() * kSide, top = patch / columns() * kSide;
    for (int y = top + warp; y < min(top + kSide, height); y += kWarps)
      for (int x = left; x < min(left + kSide, width); ++x) body(y * width + x);
  }
};

}  // namespace langgs
