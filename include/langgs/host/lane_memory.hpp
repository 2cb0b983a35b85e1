// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <cstring>

#include "langgs/core/half.hpp"
#include "langgs/host/lane_reductions.hpp"
#include "langgs/host/varying.hpp"

/// @file Memory at an index of each lane, and values in half precision. Neither GCC nor Clang makes the instructions of
/// a loop here.

namespace langgs::host {

/// base[index] in the lanes where `wanted`, `otherwise` in the others, which do not read.
template <class T>
LANGGS_HOST_INLINE Varying<T> gather(const T* base, const Varying<std::int32_t>& index, const Mask& wanted,
                                     T otherwise) {
  Varying<T> r(otherwise);
  LANGGS_FOR_PARTS {
#if defined(__AVX512F__)
    __m512i part;
    std::memcpy(&part, &r.part[i], sizeof(part));
    part = _mm512_mask_i32gather_epi32(part, static_cast<__mmask16>(detail::bits_of_part(wanted.part[i])),
                                       reinterpret_cast<__m512i>(index.part[i]), base, sizeof(T));
    std::memcpy(&r.part[i], &part, sizeof(part));
#elif defined(__AVX2__)
    __m256i part;
    std::memcpy(&part, &r.part[i], sizeof(part));
    part =
        _mm256_mask_i32gather_epi32(part, reinterpret_cast<const int*>(base), reinterpret_cast<__m256i>(index.part[i]),
                                    reinterpret_cast<__m256i>(wanted.part[i]), sizeof(T));
    std::memcpy(&r.part[i], &part, sizeof(part));
#else
    for (int l = 0; l < Varying<T>::kNativeLanes; ++l)
      if (wanted.part[i][l] != 0) r.part[i][l] = base[index.part[i][l]];
#endif
  }
  return r;
}
/// base[index]; every lane reads.
template <class T>
LANGGS_HOST_INLINE Varying<T> gather(const T* base, const Varying<std::int32_t>& index) {
  return gather(base, index, Mask(-1), T(0));
}

/// base[index] = v in the lanes where `wanted`, in ascending order.
template <class T>
LANGGS_HOST_INLINE void scatter(T* base, const Varying<std::int32_t>& index, const Mask& wanted, const Varying<T>& v) {
  LANGGS_FOR_PARTS {
#if defined(__AVX512F__)
    __m512i words;
    std::memcpy(&words, &v.part[i], sizeof(words));  // not a cast: nvcc refuses it
    _mm512_mask_i32scatter_epi32(base, static_cast<__mmask16>(detail::bits_of_part(wanted.part[i])),
                                 reinterpret_cast<__m512i>(index.part[i]), words, sizeof(T));
#else
    for (int l = 0; l < Varying<T>::kNativeLanes; ++l)
      if (wanted.part[i][l] != 0) base[index.part[i][l]] = v.part[i][l];
#endif
  }
}

#if defined(__AVX512F__)
// Masked, since GCC 12 warns of the unmasked forms of its own header (bug 105593).
inline constexpr __mmask16 kAllParts = 0xFFFF;
#endif

/// base[0 .. 31] from half precision.
LANGGS_HOST_INLINE Varying<float> load_half(const Half* base) {
  Varying<float> r;
#if defined(__AVX512F__)
  LANGGS_FOR_PARTS {
    __m256i bits;
    std::memcpy(&bits, base + i * 16, sizeof(bits));
    r.part[i] = reinterpret_cast<Varying<float>::Native>(_mm512_maskz_cvtph_ps(kAllParts, bits));
  }
#elif defined(__F16C__)
  LANGGS_FOR_PARTS {
    __m128i bits;
    std::memcpy(&bits, base + i * 8, sizeof(bits));
    r.part[i] = reinterpret_cast<Varying<float>::Native>(_mm256_cvtph_ps(bits));
  }
#else
  alignas(64) float lanes[kLanes];
  for (int i = 0; i < kLanes; ++i) lanes[i] = static_cast<float>(base[i]);
  r = Varying<float>::load(lanes);
#endif
  return r;
}
namespace detail {

/// Hands the native words of `v` in half precision, in order, to put(word, first lane).
template <class Put>
LANGGS_HOST_INLINE void halves_of(const Varying<float>& v, const Put& put) {
#if defined(__AVX512F__)
  LANGGS_FOR_PARTS put(_mm512_maskz_cvtps_ph(kAllParts, reinterpret_cast<__m512>(v.part[i]), _MM_FROUND_TO_NEAREST_INT),
                       i * 16);
#elif defined(__F16C__)
  LANGGS_FOR_PARTS put(_mm256_cvtps_ph(reinterpret_cast<__m256>(v.part[i]), _MM_FROUND_TO_NEAREST_INT), i * 8);
#else
  for (int i = 0; i < kLanes; ++i) put(Half(v.lane(i)), i);
#endif
}

}  // namespace detail

/// base[0 .. 31] = v, rounded to the nearest half.
LANGGS_HOST_INLINE void store_half(Half* base, const Varying<float>& v) {
  detail::halves_of(v, [&](const auto& halves, int first) LANGGS_INLINE_LAMBDA {
    std::memcpy(static_cast<void*>(base + first), &halves, sizeof(halves));
  });
}
/// The same past the caches, if `base` is aligned to its 64 bytes.
LANGGS_HOST_INLINE void stream_half(Half* base, const Varying<float>& v) {
  if (reinterpret_cast<std::uintptr_t>(base) % 64 != 0) return store_half(base, v);
  detail::halves_of(v, [&](const auto& halves, int first) LANGGS_INLINE_LAMBDA {
#if defined(__AVX512F__)
    _mm256_stream_si256(reinterpret_cast<__m256i*>(base + first), halves);
#elif defined(__F16C__)
    _mm_stream_si128(reinterpret_cast<__m128i*>(base + first), halves);
#else
    base[first] = halves;
#endif
  });
}

}  // namespace langgs::host
