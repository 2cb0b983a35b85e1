// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <cstring>

#include "langgs/host/varying.hpp"

/// @file Transcendental functions of 32 lanes, in the order of operations that their error bounds are stated for.

namespace langgs::host {

/// e^x for x in [-87, 88]; smaller x give e^-87, which is 1.6e-38. Relative error below 2e-7 + 8e-8 |x|.
LANGGS_HOST_INLINE Varying<float> exp(const Varying<float>& x) {
  LANGGS_FP_CONTRACT
  constexpr float kMagic = 12582912.f;  // 1.5 * 2^23: adding it rounds to the nearest integer
  Varying<float> r;
  LANGGS_FOR_PARTS {
    using V = Varying<float>::Native;
    using Bits = Varying<std::int32_t>::Native;
    const V bounded = detail::blend(x.part[i] > -87.f, x.part[i], -87.f - V{});
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
LANGGS_HOST_INLINE Varying<float> log(const Varying<float>& x) {
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
LANGGS_HOST_INLINE Varying<float> exp256(const Varying<float>& x) {
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
LANGGS_HOST_INLINE Varying<float> sqrt(const Varying<float>& x) {
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

}  // namespace langgs::host
