// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <utility>

#include "langgs/core/config.hpp"

/// @file The window of SSIM (Wang et al. 2004), 11x11 Gaussian, sigma 1.5 (A.11.3), as two filters of eleven taps.
///
/// A block walks down a strip of the image, kSsimStep rows at a time. Rows are laid into shared memory, filtered along
/// the row into a ring of rows, and this is filtered along the columns: the rows that the windows of one step share
/// with those of the next are never computed twice. Every addition takes one product, so that no compiler has a choice
/// of which product to fuse with it.

namespace langgs::detail {

inline constexpr int kSsimRadius = 5, kSsimTaps = 2 * kSsimRadius + 1;
inline constexpr int kSsimStep = 8;                                  ///< rows; one for each warp of a block
inline constexpr int kSsimWindows = 64;                              ///< columns of a strip that have windows
inline constexpr int kSsimColumns = kSsimWindows - 2 * kSsimRadius;  ///< columns of a strip that get a gradient
inline constexpr int kSsimReadColumns = 96;                          ///< that all windows of a strip reach
inline constexpr int kSsimRing = kSsimStep + 2 * kSsimRadius;        ///< rows

/// Tap i = 0..10 of the normalised Gaussian exp(-(i - 5)^2 / (2 * 1.5^2)).
[[nodiscard]] LANGGS_INLINE constexpr float ssim_tap(int i) {
  constexpr float kTaps[] = {1.0283800845e-03f, 7.5987581352e-03f, 3.6000772128e-02f, 1.0936068951e-01f,
                             2.1300553771e-01f, 2.6601172486e-01f, 2.1300553771e-01f, 1.0936068951e-01f,
                             3.6000772128e-02f, 7.5987581352e-03f, 1.0283800845e-03f};
  return kTaps[i];
}

/// 0..10 as a parameter pack: sums over the taps are folds, written out under every compiler.
using SsimTapIndices = std::make_integer_sequence<int, kSsimTaps>;

/// The rows of one step, kPitch columns each. What lanes read past a row is never used.
template <class Block, int kPitch>
struct SsimRows {
  static constexpr int kTail = 16;
  typename Block::template SharedArray<float, kSsimStep * kPitch + kTail> values;

  /// What lanes read past the last row is not used, but no memory checker knows.
  LANGGS_INLINE void clear_tail(Block& block) {
    block.threads(kTail, [&](auto thread) { values.set(kSsimStep * kPitch + thread.index, 0.f); });
  }
  template <class Warp, class V>
  LANGGS_INLINE void store(const Warp& warp, int column, const V& v) {
    values.store(warp.index() * kPitch + column, v, warp);
  }
  /// Filters the warp's row: lane l gets the window over columns column + l .. column + l + 10.
  template <class V, class Warp>
  [[nodiscard]] LANGGS_INLINE V filter(const Warp& warp, int column) const {
    return filter<V>(warp, warp.index() * kPitch + column, SsimTapIndices{});
  }
  /// The same of the values and of their squares.
  template <class V, class Warp>
  LANGGS_INLINE void filter(const Warp& warp, int column, V& mean, V& square) const {
    filter(warp, warp.index() * kPitch + column, mean, square, SsimTapIndices{});
  }

 private:
  template <class V, class Warp, int... kTap>
  [[nodiscard]] LANGGS_INLINE V filter(const Warp& warp, int first, std::integer_sequence<int, kTap...>) const {
    V sum(0.f);
    ((sum += values.load(first + kTap, warp) * ssim_tap(kTap)), ...);
    return sum;
  }
  template <class V, class Warp, int... kTap>
  LANGGS_INLINE void filter(const Warp& warp, int first, V& mean, V& square,
                            std::integer_sequence<int, kTap...>) const {
    mean = V(0.f), square = V(0.f);
    V x;
    ((x = values.load(first + kTap, warp), mean += x * ssim_tap(kTap), square += (x * x) * ssim_tap(kTap)), ...);
  }
};

/// The last kSsimRing rows that were filtered along the row; rows count from 0 at the top of the strip.
template <class Block>
struct SsimRing {
  typename Block::template SharedArray<float, kSsimRing * kSsimWindows> values;

  template <class Warp, class V>
  LANGGS_INLINE void store(const Warp& warp, int row, int column, const V& v) {
    values.store(row % kSsimRing * kSsimWindows + column, v, warp);
  }
  /// The windows over rows row - 5 .. row + 5.
  template <class V, class Warp>
  [[nodiscard]] LANGGS_INLINE V filter(const Warp& warp, int row, int column) const {
    return filter<V>(warp, (row - kSsimRadius) % kSsimRing, column, SsimTapIndices{});
  }

 private:
  [[nodiscard]] LANGGS_INLINE static int wrapped(int slot) { return slot < kSsimRing ? slot : slot - kSsimRing; }
  template <class V, class Warp, int... kTap>
  [[nodiscard]] LANGGS_INLINE V filter(const Warp& warp, int top, int column,
                                       std::integer_sequence<int, kTap...>) const {
    V sum(0.f);
    ((sum += values.load(wrapped(top + kTap) * kSsimWindows + column, warp) * ssim_tap(kTap)), ...);
    return sum;
  }
};

}  // namespace langgs::detail
