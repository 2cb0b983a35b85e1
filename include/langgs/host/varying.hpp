// SPDX-License-Identifier: Apache-2.0
#pragma once

#if defined(__SSE__)
#include <immintrin.h>
#endif

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>
#include <utility>

#include "langgs/core/config.hpp"

/// @file 32 lanes as native SIMD vectors. Arithmetic is data-parallel by type, not by the mood of a vectoriser.
///
/// GCC and Clang vector extensions make one source for SSE2, AVX2, AVX-512 and NEON. The reductions run the same tree
/// (halves, quarters, ... = xor 16, 8, 4, 2, 1) for every native width, so results do not depend on the instruction
/// set's width. Clang fuses multiply and add across inlined operators only when told to; GCC does it by default.
///
/// Loops over the parts are unrolled by request: GCC keeps an array in registers only if no loop is left to index it.

#if defined(__clang__)
#define LANGGS_FP_CONTRACT _Pragma("clang fp contract(fast)")
#define LANGGS_FOR_PARTS for (int i = 0; i < kNumParts; ++i)
#else
#define LANGGS_FP_CONTRACT
#define LANGGS_FOR_PARTS _Pragma("GCC unroll 8") for (int i = 0; i < kNumParts; ++i)
#endif

namespace langgs::host {

inline constexpr int kLanes = 32;

#if defined(__AVX512F__)
inline constexpr int kNativeBytes = 64;
#elif defined(__AVX__)
inline constexpr int kNativeBytes = 32;
#else
inline constexpr int kNativeBytes = 16;
#endif

inline constexpr int kNumParts = kLanes * 4 / kNativeBytes;

namespace detail {

/// Stores a native vector past the caches, where the machine can. `to` is aligned to it.
template <class Native>
LANGGS_INLINE void stream(const Native& v, void* to) {
#if defined(__AVX512F__)
  _mm512_stream_si512(static_cast<__m512i*>(to), reinterpret_cast<__m512i>(v));
#elif defined(__AVX__)
  _mm256_stream_si256(static_cast<__m256i*>(to), reinterpret_cast<__m256i>(v));
#elif defined(__SSE__)
  _mm_stream_si128(static_cast<__m128i*>(to), reinterpret_cast<__m128i>(v));
#else
  *static_cast<Native*>(to) = v;
#endif
}

}  // namespace detail

/// 32 values of a 4-byte arithmetic type, one per lane. Masks are Varying<int32_t> with lanes 0 or -1.
template <class T>
struct alignas(64) Varying {
  static_assert(sizeof(T) == 4 && std::is_arithmetic_v<T>, "Varying holds float, int32_t or uint32_t lanes");
  static constexpr int kNativeLanes = kNativeBytes / 4;
  static constexpr int kParts = kNumParts;
  typedef T Native __attribute__((vector_size(kNativeBytes)));  // the attribute needs a typedef for a dependent T
  typedef T Unaligned __attribute__((vector_size(kNativeBytes), aligned(4), may_alias));

  Native part[kParts];

  Varying() = default;
  /// The same value in every lane.
  LANGGS_INLINE Varying(T uniform) { LANGGS_FOR_PARTS part[i] = uniform - Native{}; }
  /// 32 consecutive values; no alignment is needed.
  LANGGS_INLINE static Varying load(const T* values) {
    // Part by part: GCC copies a whole array with shorter moves, through the stack.
    Varying result;
    LANGGS_FOR_PARTS result.part[i] = *reinterpret_cast<const Unaligned*>(values + i * kNativeLanes);
    return result;
  }
  LANGGS_INLINE void store(T* values) const {
    LANGGS_FOR_PARTS* reinterpret_cast<Unaligned*>(values + i * kNativeLanes) = part[i];
  }
  /// 32 / kColumns rows of kColumns consecutive values, `pitch` apart.
  template <int kColumns>
  LANGGS_INLINE static Varying load_rows(const T* values, std::ptrdiff_t pitch) {
    static_assert(kColumns % kNativeLanes == 0);
    Varying result;
    LANGGS_FOR_PARTS result.part[i] =
        *reinterpret_cast<const Unaligned*>(values + i * kNativeLanes / kColumns * pitch + i * kNativeLanes % kColumns);
    return result;
  }
  template <int kColumns>
  LANGGS_INLINE void store_rows(T* values, std::ptrdiff_t pitch) const {
    static_assert(kColumns % kNativeLanes == 0);
    LANGGS_FOR_PARTS* reinterpret_cast<Unaligned*>(values + i * kNativeLanes / kColumns * pitch +
                                                   i * kNativeLanes % kColumns) = part[i];
  }
  /// The same past the caches, for what is not read soon: a store into a line that is not cached would load it first.
  template <int kColumns>
  LANGGS_INLINE void stream_rows(T* values, std::ptrdiff_t pitch) const {
    static_assert(kColumns % kNativeLanes == 0);
    if ((reinterpret_cast<std::uintptr_t>(values) | static_cast<std::uintptr_t>(pitch) * sizeof(T)) % kNativeBytes != 0)
      return store_rows<kColumns>(values, pitch);
    LANGGS_FOR_PARTS detail::stream(part[i],
                                    values + i * kNativeLanes / kColumns * pitch + i * kNativeLanes % kColumns);
  }
  [[nodiscard]] LANGGS_INLINE T lane(int i) const { return part[i / kNativeLanes][i % kNativeLanes]; }
};

using Mask = Varying<std::int32_t>;

#define LANGGS_LANEWISE(Result, expression) \
  LANGGS_FP_CONTRACT                        \
  Result r;                                 \
  LANGGS_FOR_PARTS r.part[i] = expression;  \
  return r;

#define LANGGS_ARITHMETIC(op)                                                            \
  template <class T>                                                                     \
  LANGGS_INLINE Varying<T> operator op(const Varying<T>& a, const Varying<T>& b) {       \
    LANGGS_LANEWISE(Varying<T>, a.part[i] op b.part[i])                                  \
  }                                                                                      \
  template <class T>                                                                     \
  LANGGS_INLINE Varying<T> operator op(const Varying<T>& a, std::type_identity_t<T> b) { \
    return a op Varying<T>(b);                                                           \
  }                                                                                      \
  template <class T>                                                                     \
  LANGGS_INLINE Varying<T> operator op(std::type_identity_t<T> a, const Varying<T>& b) { \
    return Varying<T>(a) op b;                                                           \
  }
LANGGS_ARITHMETIC(+)
LANGGS_ARITHMETIC(-)
LANGGS_ARITHMETIC(*)
LANGGS_ARITHMETIC(/)
LANGGS_ARITHMETIC(&)
LANGGS_ARITHMETIC(|)
#undef LANGGS_ARITHMETIC

#define LANGGS_COMPARISON(op)                                                      \
  template <class T>                                                               \
  LANGGS_INLINE Mask operator op(const Varying<T>& a, const Varying<T>& b) {       \
    LANGGS_LANEWISE(Mask, a.part[i] op b.part[i])                                  \
  }                                                                                \
  template <class T>                                                               \
  LANGGS_INLINE Mask operator op(const Varying<T>& a, std::type_identity_t<T> b) { \
    return a op Varying<T>(b);                                                     \
  }
LANGGS_COMPARISON(<)
LANGGS_COMPARISON(<=)
LANGGS_COMPARISON(>)
LANGGS_COMPARISON(>=)
LANGGS_COMPARISON(==)
LANGGS_COMPARISON(!=)
#undef LANGGS_COMPARISON

template <class T>
LANGGS_INLINE Varying<T> operator-(const Varying<T>& a){LANGGS_LANEWISE(Varying<T>, -a.part[i])} LANGGS_INLINE Mask
operator!(const Mask& a) {
  Mask r;
  LANGGS_FOR_PARTS r.part[i] = ~a.part[i];
  return r;
}
template <class T>
LANGGS_INLINE Varying<T>& operator+=(Varying<T>& a, const Varying<T>& b) {
  return a = a + b;
}
template <class T>
LANGGS_INLINE Varying<T>& operator-=(Varying<T>& a, const Varying<T>& b) {
  return a = a - b;
}
template <class T>
LANGGS_INLINE Varying<T>& operator*=(Varying<T>& a, const Varying<T>& b) {
  return a = a * b;
}

/// Per lane: mask ? a : b.
template <class T>
LANGGS_INLINE Varying<T> select(const Mask& mask, const Varying<T>& a, const Varying<T>& b) {
  LANGGS_LANEWISE(Varying<T>, mask.part[i] ? a.part[i] : b.part[i])
}
template <class T>
LANGGS_INLINE Varying<T> select(const Mask& mask, const Varying<T>& a, std::type_identity_t<T> b) {
  return select(mask, a, Varying<T>(b));
}
namespace detail {

// The x86 instructions compute exactly this; GCC makes a comparison and a blend of it when left alone.
template <class V>
LANGGS_INLINE V smaller(const V& a, const V& b) {
  return a < b ? a : b;
}
template <class V>
LANGGS_INLINE V larger(const V& a, const V& b) {
  return a > b ? a : b;
}
#if defined(__AVX512F__)
LANGGS_INLINE __m512 smaller(const __m512& a, const __m512& b) { return _mm512_maskz_min_ps(0xFFFF, a, b); }
LANGGS_INLINE __m512 larger(const __m512& a, const __m512& b) { return _mm512_maskz_max_ps(0xFFFF, a, b); }
#elif defined(__AVX__)
LANGGS_INLINE __m256 smaller(const __m256& a, const __m256& b) { return _mm256_min_ps(a, b); }
LANGGS_INLINE __m256 larger(const __m256& a, const __m256& b) { return _mm256_max_ps(a, b); }
#elif defined(__SSE__)
LANGGS_INLINE __m128 smaller(const __m128& a, const __m128& b) { return _mm_min_ps(a, b); }
LANGGS_INLINE __m128 larger(const __m128& a, const __m128& b) { return _mm_max_ps(a, b); }
#endif

}  // namespace detail

/// a < b ? a : b, so b where either is NaN.
template <class T>
LANGGS_INLINE Varying<T> min(const Varying<T>& a, const Varying<T>& b) {
  LANGGS_LANEWISE(Varying<T>, detail::smaller(a.part[i], b.part[i]))
}
/// a > b ? a : b, so b where either is NaN.
template <class T>
LANGGS_INLINE Varying<T> max(const Varying<T>& a, const Varying<T>& b) {
  LANGGS_LANEWISE(Varying<T>, detail::larger(a.part[i], b.part[i]))
}
template <class T>
LANGGS_INLINE Varying<T> min(const Varying<T>& a, std::type_identity_t<T> b) {
  return min(a, Varying<T>(b));
}
template <class T>
LANGGS_INLINE Varying<T> max(const Varying<T>& a, std::type_identity_t<T> b) {
  return max(a, Varying<T>(b));
}

template <class To, class From>
LANGGS_INLINE Varying<To> bit_cast(const Varying<From>& a) {
  Varying<To> r;
  LANGGS_FOR_PARTS std::memcpy(&r.part[i], &a.part[i], sizeof(r.part[i]));
  return r;
}
LANGGS_INLINE Varying<std::int32_t> abs(const Varying<std::int32_t>& a) { return max(a, -a); }
LANGGS_INLINE Varying<float> abs(const Varying<float>& a) {
  return bit_cast<float>(bit_cast<std::int32_t>(a) & 0x7FFFFFFF);
}

/// -|a|.
LANGGS_INLINE Varying<float> negative_abs(const Varying<float>& a) {
  return bit_cast<float>(bit_cast<std::int32_t>(a) | INT32_MIN);
}

template <class To, class From>
LANGGS_INLINE Varying<To> convert(const Varying<From>& a) {
  Varying<To> r;
  LANGGS_FOR_PARTS r.part[i] = __builtin_convertvector(a.part[i], typename Varying<To>::Native);
  return r;
}

/// e^x for x in [-87, 88]; smaller x give e^-87, which is 1.6e-38. Relative error below 2e-7 + 8e-8 |x|.
LANGGS_INLINE Varying<float> exp(const Varying<float>& x) {
  LANGGS_FP_CONTRACT
  constexpr float kMagic = 12582912.f;  // 1.5 * 2^23: adding it rounds to the nearest integer
  Varying<float> r;
  LANGGS_FOR_PARTS {
    using V = Varying<float>::Native;
    using Bits = Varying<std::int32_t>::Native;
    const V bounded = x.part[i] > -87.f ? x.part[i] : -87.f - V{};
    const V t = bounded * 1.44269504f;
    const V shifted = t + kMagic;
    Bits exponent;
    std::memcpy(&exponent, &shifted, sizeof(exponent));
    const V f = t - (shifted - kMagic);
    // Taylor series of 2^f on [-1/2, 1/2]
    V p = 1.5403530e-4f * f + 1.3333558e-3f;
    p = p * f + 9.6181291e-3f;
    p = p * f + 5.5504109e-2f;
    p = p * f + 2.4022651e-1f;
    p = p * f + 6.9314718e-1f;
    p = p * f + 1.f;
    Bits bits;
    std::memcpy(&bits, &p, sizeof(bits));
    bits += exponent << 23;
    std::memcpy(&r.part[i], &bits, sizeof(bits));
  }
  return r;
}

/// ln x for positive normal x. Relative error below 3e-7 away from x = 1, absolute error below 1e-7 near it.
LANGGS_INLINE Varying<float> log(const Varying<float>& x) {
  LANGGS_FP_CONTRACT
  Varying<float> r;
  LANGGS_FOR_PARTS {
    using V = Varying<float>::Native;
    using Bits = Varying<std::int32_t>::Native;
    Bits bits;
    std::memcpy(&bits, &x.part[i], sizeof(bits));
    // Split so that the mantissa m lies in [sqrt(1/2), sqrt(2)).
    const Bits exponent = (bits - 0x3F3504F3) >> 23;
    bits -= exponent << 23;
    V m;
    std::memcpy(&m, &bits, sizeof(m));
    // ln m = 2 atanh(s), s = (m - 1) / (m + 1), |s| < 0.172
    const V s = (m - 1.f) / (m + 1.f);
    const V s2 = s * s;
    V p = s2 * 0.22222222f + 0.28571429f;
    p = p * s2 + 0.4f;
    p = p * s2 + 0.66666667f;
    p = p * s2 + 2.f;
    r.part[i] = __builtin_convertvector(exponent, V) * 0.69314718f + p * s;
  }
  return r;
}

/// 256^x = 2^(8x) for x in [-1, 0]: an opacity from its logarithm. Relative error below 2.4e-6, rms 6e-7.
/// A polynomial of degree 5 for 2^x (minimax, 8e-8), squared three times: no integer arithmetic, no range reduction.
LANGGS_INLINE Varying<float> exp256(const Varying<float>& x) {
  LANGGS_FP_CONTRACT
  Varying<float> r;
  LANGGS_FOR_PARTS {
    auto p = 9.387883474e-4f * x.part[i] + 9.188611992e-3f;
    p = p * x.part[i] + 5.527972430e-2f;
    p = p * x.part[i] + 2.401721925e-1f;
    p = p * x.part[i] + 6.931422353e-1f;
    p = p * x.part[i] + 9.999999404e-1f;
    p = p * p;
    p = p * p;
    r.part[i] = p * p;
  }
  return r;
}

/// Neither GCC nor Clang vectorises sqrtf while it may set errno, so x86 needs the instructions by name.
LANGGS_INLINE Varying<float> sqrt(const Varying<float>& x) {
  Varying<float> r;
  LANGGS_FOR_PARTS {
#if defined(__AVX512F__)
    r.part[i] = _mm512_maskz_sqrt_ps(0xFFFF, x.part[i]);  // GCC 12 warns of its own header's plain form
#elif defined(__AVX__)
    r.part[i] = _mm256_sqrt_ps(x.part[i]);
#elif defined(__SSE__)
    r.part[i] = _mm_sqrt_ps(x.part[i]);
#else
    for (int l = 0; l < Varying<float>::kNativeLanes; ++l) r.part[i][l] = __builtin_sqrtf(x.part[i][l]);
#endif
  }
  return r;
}

/// base[index] per lane.
template <class T>
LANGGS_INLINE Varying<T> gather(const T* base, const Varying<std::int32_t>& index) {
  Varying<T> r;
  LANGGS_FOR_PARTS for (int l = 0; l < Varying<T>::kNativeLanes; ++l) r.part[i][l] = base[index.part[i][l]];
  return r;
}

/// 0 .. 31.
LANGGS_INLINE Varying<std::int32_t> lane_index() {
  alignas(64) static constexpr std::int32_t kIndices[kLanes] = {0,  1,  2,  3,  4,  5,  6,  7,  8,  9,  10,
                                                                11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21,
                                                                22, 23, 24, 25, 26, 27, 28, 29, 30, 31};
  return Varying<std::int32_t>::load(kIndices);
}
/// 1 << lane.
LANGGS_INLINE Varying<std::int32_t> lane_bits() {
  alignas(64) std::int32_t bits[kLanes];
  for (int i = 0; i < kLanes; ++i) bits[i] = static_cast<std::int32_t>(1u << i);
  return Varying<std::int32_t>::load(bits);
}
LANGGS_INLINE Varying<float> to_float(const Varying<std::int32_t>& a) { return convert<float>(a); }

namespace detail {

/// Reduces 32 lanes with the tree xor 16, 8, 4, 2, 1.
template <class T, class Op>
LANGGS_INLINE T reduce(const Varying<T>& a, Op op) {
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
LANGGS_INLINE T reduce_sum(const Varying<T>& a) {
  return detail::reduce(
      a, [](auto x, auto y) __attribute__((always_inline)) { return x + y; });
}
template <class T>
LANGGS_INLINE T reduce_max(const Varying<T>& a) {
  return detail::reduce(
      a, [](auto x, auto y) __attribute__((always_inline)) { return x > y ? x : y; });
}
namespace detail {

/// Bit l is set where lane l of one native vector of a mask is.
LANGGS_INLINE std::uint32_t bits_of_part(const Mask::Native& part) {
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
[[nodiscard]] LANGGS_INLINE std::uint32_t bits_of(const Mask& mask) {
  std::uint32_t bits = 0;
  LANGGS_FOR_PARTS bits |= detail::bits_of_part(mask.part[i]) << (i * Mask::kNativeLanes);
  return bits;
}
[[nodiscard]] LANGGS_INLINE bool any(const Mask& mask) {
  auto joined = mask.part[0];
  for (int i = 1; i < kNumParts; ++i) joined |= mask.part[i];
  return detail::bits_of_part(joined) != 0;
}
[[nodiscard]] LANGGS_INLINE bool all(const Mask& mask) { return !any(!mask); }

namespace detail {

template <int kSpan, class V, int... kLane>
LANGGS_INLINE V fold_pair(const V& a, const V& b, std::integer_sequence<int, kLane...>) {
  // Of the 2 L lanes of a and b, those whose bit kSpan is clear, in order; and the same plus kSpan.
  return __builtin_shufflevector(a, b, (kLane / kSpan * 2 * kSpan + kLane % kSpan)...) +
         __builtin_shufflevector(a, b, (kLane / kSpan * 2 * kSpan + kLane % kSpan + kSpan)...);
}
/// Folds pairs of vectors until each lane is the sum of one of them; lane i of vector g belongs to input g L + i.
template <int kSpan, int N, class V>
LANGGS_INLINE void fold_all(V (&v)[N]) {
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

/// Copies 16 floats to a cache line that is not read soon.
LANGGS_INLINE void stream_line(const float* from, float* to) {
  for (int i = 0; i < 64 / kNativeBytes; ++i) {
    Varying<float>::Native v;
    std::memcpy(&v, from + i * kNativeBytes / 4, kNativeBytes);
    detail::stream(v, to + i * kNativeBytes / 4);
  }
}

/// sums[i] = reduce_sum(values[i]), all at once: the tree of reduce_sum, in a fraction of its shuffles.
template <int N>
LANGGS_INLINE void reduce_sums(const Varying<float> (&values)[N], float (&sums)[N]) {
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

#undef LANGGS_LANEWISE
#undef LANGGS_FOR_PARTS

}  // namespace langgs::host
