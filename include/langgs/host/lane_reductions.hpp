// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <cstring>
#include <utility>

#include "langgs/host/varying.hpp"

/// @file From 32 lanes to one value: sums, maxima, votes. The same tree for every native width.

namespace langgs::host {

namespace detail {

/// Reduces 32 lanes with the tree xor 16, 8, 4, 2, 1.
template <class T, class Op>
LANGGS_HOST_INLINE T reduce(const Varying<T>& a, Op op) {
  constexpr int kParts = Varying<T>::kParts;
  typename Varying<T>::Native p[kParts];
  LANGGS_FOR_PARTS p[i] = a.part[i];
  if constexpr (kParts > 4)
    for (int i = 0; i < 4; ++i) p[i] = op(p[i], p[i + 4]);
  if constexpr (kParts > 2) p[0] = op(p[0], p[2]), p[1] = op(p[1], p[3]);
  p[0] = op(p[0], p[1]);
  typedef T V4 __attribute__((vector_size(16)));
  V4 quarter;
  if constexpr (kNativeBytes == 64) {
    typedef T V8 __attribute__((vector_size(32)));
    const V8 low = __builtin_shufflevector(p[0], p[0], 0, 1, 2, 3, 4, 5, 6, 7);
    const V8 high = __builtin_shufflevector(p[0], p[0], 8, 9, 10, 11, 12, 13, 14, 15);
    const V8 eight = op(low, high);
    const V4 a4 = __builtin_shufflevector(eight, eight, 0, 1, 2, 3);
    const V4 b4 = __builtin_shufflevector(eight, eight, 4, 5, 6, 7);
    quarter = op(a4, b4);
  } else if constexpr (kNativeBytes == 32) {
    const V4 a4 = __builtin_shufflevector(p[0], p[0], 0, 1, 2, 3);
    const V4 b4 = __builtin_shufflevector(p[0], p[0], 4, 5, 6, 7);
    quarter = op(a4, b4);
  } else {
    quarter = p[0];
  }
  const V4 swapped = __builtin_shufflevector(quarter, quarter, 2, 3, 0, 1);
  quarter = op(quarter, swapped);
  const V4 odd = __builtin_shufflevector(quarter, quarter, 1, 0, 3, 2);
  return op(quarter, odd)[0];
}

}  // namespace detail

template <class T>
LANGGS_HOST_INLINE T reduce_sum(const Varying<T>& a) {
  return detail::reduce(
      a, [](auto x, auto y) __attribute__((always_inline)) { return x + y; });
}
template <class T>
LANGGS_HOST_INLINE T reduce_max(const Varying<T>& a) {
  return detail::reduce(
      a, [](auto x, auto y) __attribute__((always_inline)) { return x > y ? x : y; });
}
namespace detail {

/// Bit l is set where lane l of one native vector of a mask is.
LANGGS_HOST_INLINE std::uint32_t bits_of_part(const Mask::Native& part) {
#if defined(__AVX512F__)
  return _mm512_test_epi32_mask(reinterpret_cast<__m512i>(part), reinterpret_cast<__m512i>(part));
#elif defined(__AVX__)
  return static_cast<std::uint32_t>(_mm256_movemask_ps(reinterpret_cast<__m256>(part)));
#elif defined(__SSE__)
  return static_cast<std::uint32_t>(_mm_movemask_ps(reinterpret_cast<__m128>(part)));
#else
  std::uint32_t bits = 0;
  for (int l = 0; l < Mask::kNativeLanes; ++l) bits |= (part[l] & 1u) << l;
  return bits;
#endif
}

}  // namespace detail

/// Bit l is set where the mask holds in lane l.
[[nodiscard]] LANGGS_HOST_INLINE std::uint32_t bits_of(const Mask& mask) {
  std::uint32_t bits = 0;
  LANGGS_FOR_PARTS bits |= detail::bits_of_part(mask.part[i]) << (i * Mask::kNativeLanes);
  return bits;
}
[[nodiscard]] LANGGS_HOST_INLINE bool any(const Mask& mask) {
  auto joined = mask.part[0];
  for (int i = 1; i < kNumParts; ++i) joined |= mask.part[i];
  return detail::bits_of_part(joined) != 0;
}
[[nodiscard]] LANGGS_HOST_INLINE bool all(const Mask& mask) { return !any(!mask); }

namespace detail {

template <int kSpan, class V, int... kLane>
LANGGS_HOST_INLINE V fold_pair(const V& a, const V& b, std::integer_sequence<int, kLane...>) {
#if defined(__CUDACC__)  // its front end loses the expansion below
  constexpr int kNativeLanes = sizeof...(kLane);
  V low, high;
  for (int i = 0; i < kNativeLanes; ++i) {
    const int from = i / kSpan * 2 * kSpan + i % kSpan, beside = from + kSpan;
    low[i] = from < kNativeLanes ? a[from] : b[from - kNativeLanes];
    high[i] = beside < kNativeLanes ? a[beside] : b[beside - kNativeLanes];
  }
  return low + high;
#else
  // Of the 2 L lanes of a and b, those whose bit kSpan is clear, in order; and the same plus kSpan.
  return __builtin_shufflevector(a, b, (kLane / kSpan * 2 * kSpan + kLane % kSpan)...) +
         __builtin_shufflevector(a, b, (kLane / kSpan * 2 * kSpan + kLane % kSpan + kSpan)...);
#endif
}
/// Folds pairs of vectors until each lane is the sum of one of them; lane i of vector g belongs to input g L + i.
template <int kSpan, int N, class V>
LANGGS_HOST_INLINE void fold_all(V (&v)[N]) {
  constexpr int kNativeLanes = kNativeBytes / 4;
  constexpr int kHalf = (N + 1) / 2;
  V folded[kHalf];
  for (int i = 0; i < kHalf; ++i)
    folded[i] =
        fold_pair<kSpan>(v[2 * i], 2 * i + 1 < N ? v[2 * i + 1] : V{}, std::make_integer_sequence<int, kNativeLanes>{});
  if constexpr (kSpan > 1) fold_all<kSpan / 2>(folded);
  for (int i = 0; i < kHalf; ++i) v[i] = folded[i];
}

}  // namespace detail

/// sums[i] = reduce_sum(values[i]), all at once: the tree of reduce_sum, in a fraction of its shuffles.
template <int N>
LANGGS_HOST_INLINE void reduce_sums(const Varying<float> (&values)[N], float (&sums)[N]) {
  using V = Varying<float>::Native;
  constexpr int kParts = Varying<float>::kParts, kNativeLanes = Varying<float>::kNativeLanes;
  constexpr int kGroups = (N + kNativeLanes - 1) / kNativeLanes;
  V v[N > kGroups ? N : kGroups];
  for (int n = 0; n < N; ++n) {
    V part[kParts];
    for (int i = 0; i < kParts; ++i) part[i] = values[n].part[i];
    for (int half = kParts / 2; half >= 1; half /= 2)
      for (int i = 0; i < half; ++i) part[i] = part[i] + part[i + half];
    v[n] = part[0];
  }
  detail::fold_all<kNativeLanes / 2>(v);
  alignas(64) float lanes[kGroups * kNativeLanes];
  std::memcpy(lanes, v, sizeof(lanes));
  std::memcpy(sums, lanes, sizeof(sums));
}

}  // namespace langgs::host
