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

#if defined(__CUDACC__)  // its front end knows neither pragma
#define LANGGS_FP_CONTRACT
#define LANGGS_FOR_PARTS for (int i = 0; i < kNumParts; ++i)
#elif defined(__clang__)
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

/// Stores a native vector past the caches, where the machine can. `to` is aligned to it. Such stores are ordered before
/// the next locked instruction of the thread: every hand-over of the worker pool has one.
template <class Native>
LANGGS_HOST_INLINE void stream(const Native& v, void* to) {
#if defined(__AVX512F__)
  __m512i words;
  std::memcpy(&words, &v, sizeof(words));  // not a cast: nvcc refuses it
  _mm512_stream_si512(static_cast<__m512i*>(to), words);
#elif defined(__AVX__)
  __m256i words;
  std::memcpy(&words, &v, sizeof(words));
  _mm256_stream_si256(static_cast<__m256i*>(to), words);
#elif defined(__SSE__)
  __m128i words;
  std::memcpy(&words, &v, sizeof(words));
  _mm_stream_si128(static_cast<__m128i*>(to), words);
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
  LANGGS_HOST_INLINE Varying(T uniform) { LANGGS_FOR_PARTS part[i] = uniform - Native{}; }
  /// 32 consecutive values; no alignment is needed.
  LANGGS_HOST_INLINE static Varying load(const T* values) {
    // Part by part: GCC copies a whole array with shorter moves, through the stack.
    Varying result;
    LANGGS_FOR_PARTS result.part[i] = *reinterpret_cast<const Unaligned*>(values + i * kNativeLanes);
    return result;
  }
  LANGGS_HOST_INLINE void store(T* values) const {
    LANGGS_FOR_PARTS* reinterpret_cast<Unaligned*>(values + i * kNativeLanes) = part[i];
  }
  /// 32 / kColumns rows of kColumns consecutive values, `pitch` apart.
  template <int kColumns>
  LANGGS_HOST_INLINE static Varying load_rows(const T* values, std::ptrdiff_t pitch) {
    static_assert(kColumns % kNativeLanes == 0);
    Varying result;
    LANGGS_FOR_PARTS result.part[i] =
        *reinterpret_cast<const Unaligned*>(values + i * kNativeLanes / kColumns * pitch + i * kNativeLanes % kColumns);
    return result;
  }
  template <int kColumns>
  LANGGS_HOST_INLINE void store_rows(T* values, std::ptrdiff_t pitch) const {
    static_assert(kColumns % kNativeLanes == 0);
    LANGGS_FOR_PARTS* reinterpret_cast<Unaligned*>(values + i * kNativeLanes / kColumns * pitch +
                                                   i * kNativeLanes % kColumns) = part[i];
  }
  /// The same past the caches, for what is not read soon: a store into a line that is not cached would load it first.
  template <int kColumns>
  LANGGS_HOST_INLINE void stream_rows(T* values, std::ptrdiff_t pitch) const {
    static_assert(kColumns % kNativeLanes == 0);
    if ((reinterpret_cast<std::uintptr_t>(values) | static_cast<std::uintptr_t>(pitch) * sizeof(T)) % kNativeBytes != 0)
      return store_rows<kColumns>(values, pitch);
    LANGGS_FOR_PARTS detail::stream(part[i],
                                    values + i * kNativeLanes / kColumns * pitch + i * kNativeLanes % kColumns);
  }
  [[nodiscard]] LANGGS_HOST_INLINE T lane(int i) const { return part[i / kNativeLanes][i % kNativeLanes]; }
};

using Mask = Varying<std::int32_t>;

/// Copies 16 floats to a cache line that is not read soon.
LANGGS_HOST_INLINE void stream_line(const float* from, float* to) {
  for (int i = 0; i < 64 / kNativeBytes; ++i) {
    Varying<float>::Native v;
    std::memcpy(&v, from + i * kNativeBytes / 4, kNativeBytes);
    detail::stream(v, to + i * kNativeBytes / 4);
  }
}

#define LANGGS_LANEWISE(Result, expression) \
  LANGGS_FP_CONTRACT                        \
  Result r;                                 \
  LANGGS_FOR_PARTS r.part[i] = expression;  \
  return r;

#define LANGGS_ARITHMETIC(op)                                                                 \
  template <class T>                                                                          \
  LANGGS_HOST_INLINE Varying<T> operator op(const Varying<T>& a, const Varying<T>& b) {       \
    LANGGS_LANEWISE(Varying<T>, a.part[i] op b.part[i])                                       \
  }                                                                                           \
  template <class T>                                                                          \
  LANGGS_HOST_INLINE Varying<T> operator op(const Varying<T>& a, std::type_identity_t<T> b) { \
    return a op Varying<T>(b);                                                                \
  }                                                                                           \
  template <class T>                                                                          \
  LANGGS_HOST_INLINE Varying<T> operator op(std::type_identity_t<T> a, const Varying<T>& b) { \
    return Varying<T>(a) op b;                                                                \
  }
LANGGS_ARITHMETIC(+)
LANGGS_ARITHMETIC(-)
LANGGS_ARITHMETIC(*)
LANGGS_ARITHMETIC(/)
LANGGS_ARITHMETIC(&)
LANGGS_ARITHMETIC(|)
#undef LANGGS_ARITHMETIC

#define LANGGS_COMPARISON(op)                                                           \
  template <class T>                                                                    \
  LANGGS_HOST_INLINE Mask operator op(const Varying<T>& a, const Varying<T>& b) {       \
    LANGGS_LANEWISE(Mask, a.part[i] op b.part[i])                                       \
  }                                                                                     \
  template <class T>                                                                    \
  LANGGS_HOST_INLINE Mask operator op(const Varying<T>& a, std::type_identity_t<T> b) { \
    return a op Varying<T>(b);                                                          \
  }
LANGGS_COMPARISON(<)
LANGGS_COMPARISON(<=)
LANGGS_COMPARISON(>)
LANGGS_COMPARISON(>=)
LANGGS_COMPARISON(==)
LANGGS_COMPARISON(!=)
#undef LANGGS_COMPARISON

template <class T>
LANGGS_HOST_INLINE Varying<T> operator-(const Varying<T>& a){
    LANGGS_LANEWISE(Varying<T>, -a.part[i])} LANGGS_HOST_INLINE Mask
operator!(const Mask& a) {
  Mask r;
  LANGGS_FOR_PARTS r.part[i] = ~a.part[i];
  return r;
}
template <class T>
LANGGS_HOST_INLINE Varying<T>& operator+=(Varying<T>& a, const Varying<T>& b) {
  return a = a + b;
}
template <class T>
LANGGS_HOST_INLINE Varying<T>& operator-=(Varying<T>& a, const Varying<T>& b) {
  return a = a - b;
}
template <class T>
LANGGS_HOST_INLINE Varying<T>& operator*=(Varying<T>& a, const Varying<T>& b) {
  return a = a * b;
}

namespace detail {

/// mask ? a : b of native vectors; the mask has lanes 0 or -1.
template <class M, class V>
LANGGS_HOST_INLINE V blend(const M& mask, const V& a, const V& b) {
#if defined(__CUDACC__)  // its front end breaks off at the conditional operator
  M x, y;
  std::memcpy(&x, &a, sizeof(x));
  std::memcpy(&y, &b, sizeof(y));
  x = (x & mask) | (y & ~mask);
  V r;
  std::memcpy(&r, &x, sizeof(r));
  return r;
#else
  return mask ? a : b;
#endif
}

}  // namespace detail

/// Per lane: mask ? a : b.
template <class T>
LANGGS_HOST_INLINE Varying<T> select(const Mask& mask, const Varying<T>& a, const Varying<T>& b) {
  LANGGS_LANEWISE(Varying<T>, detail::blend(mask.part[i], a.part[i], b.part[i]))
}
template <class T>
LANGGS_HOST_INLINE Varying<T> select(const Mask& mask, const Varying<T>& a, std::type_identity_t<T> b) {
  return select(mask, a, Varying<T>(b));
}
namespace detail {

// The x86 instructions compute exactly this; GCC makes a comparison and a blend of it when left alone.
template <class V>
LANGGS_HOST_INLINE V smaller(const V& a, const V& b) {
  return blend(a < b, a, b);
}
template <class V>
LANGGS_HOST_INLINE V larger(const V& a, const V& b) {
  return blend(a > b, a, b);
}
#if defined(__AVX512F__)
LANGGS_HOST_INLINE __m512 smaller(const __m512& a, const __m512& b) { return _mm512_maskz_min_ps(0xFFFF, a, b); }
LANGGS_HOST_INLINE __m512 larger(const __m512& a, const __m512& b) { return _mm512_maskz_max_ps(0xFFFF, a, b); }
#elif defined(__AVX__)
LANGGS_HOST_INLINE __m256 smaller(const __m256& a, const __m256& b) { return _mm256_min_ps(a, b); }
LANGGS_HOST_INLINE __m256 larger(const __m256& a, const __m256& b) { return _mm256_max_ps(a, b); }
#elif defined(__SSE__)
LANGGS_HOST_INLINE __m128 smaller(const __m128& a, const __m128& b) { return _mm_min_ps(a, b); }
LANGGS_HOST_INLINE __m128 larger(const __m128& a, const __m128& b) { return _mm_max_ps(a, b); }
#endif

}  // namespace detail

/// a < b ? a : b, so b where either is NaN.
template <class T>
LANGGS_HOST_INLINE Varying<T> min(const Varying<T>& a, const Varying<T>& b) {
  LANGGS_LANEWISE(Varying<T>, detail::smaller(a.part[i], b.part[i]))
}
/// a > b ? a : b, so b where either is NaN.
template <class T>
LANGGS_HOST_INLINE Varying<T> max(const Varying<T>& a, const Varying<T>& b) {
  LANGGS_LANEWISE(Varying<T>, detail::larger(a.part[i], b.part[i]))
}
template <class T>
LANGGS_HOST_INLINE Varying<T> min(const Varying<T>& a, std::type_identity_t<T> b) {
  return min(a, Varying<T>(b));
}
template <class T>
LANGGS_HOST_INLINE Varying<T> max(const Varying<T>& a, std::type_identity_t<T> b) {
  return max(a, Varying<T>(b));
}

template <class To, class From>
LANGGS_HOST_INLINE Varying<To> bit_cast(const Varying<From>& a) {
  Varying<To> r;
  LANGGS_FOR_PARTS std::memcpy(&r.part[i], &a.part[i], sizeof(r.part[i]));
  return r;
}
LANGGS_HOST_INLINE Varying<std::int32_t> abs(const Varying<std::int32_t>& a) { return max(a, -a); }
LANGGS_HOST_INLINE Varying<float> abs(const Varying<float>& a) {
  return bit_cast<float>(bit_cast<std::int32_t>(a) & 0x7FFFFFFF);
}

/// -|a|.
LANGGS_HOST_INLINE Varying<float> negative_abs(const Varying<float>& a) {
  return bit_cast<float>(bit_cast<std::int32_t>(a) | INT32_MIN);
}

template <class To, class From>
LANGGS_HOST_INLINE Varying<To> convert(const Varying<From>& a) {
  Varying<To> r;
  LANGGS_FOR_PARTS r.part[i] = __builtin_convertvector(a.part[i], typename Varying<To>::Native);
  return r;
}

/// 0 .. 31.
LANGGS_HOST_INLINE Varying<std::int32_t> lane_index() {
  alignas(64) static constexpr std::int32_t kIndices[kLanes] = {0,  1,  2,  3,  4,  5,  6,  7,  8,  9,  10,
                                                                11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21,
                                                                22, 23, 24, 25, 26, 27, 28, 29, 30, 31};
  return Varying<std::int32_t>::load(kIndices);
}
/// 1 << lane.
LANGGS_HOST_INLINE Varying<std::int32_t> lane_bits() {
  alignas(64) std::int32_t bits[kLanes];
  for (int i = 0; i < kLanes; ++i) bits[i] = static_cast<std::int32_t>(1u << i);
  return Varying<std::int32_t>::load(bits);
}
LANGGS_HOST_INLINE Varying<float> to_float(const Varying<std::int32_t>& a) { return convert<float>(a); }

#undef LANGGS_LANEWISE

}  // namespace langgs::host
