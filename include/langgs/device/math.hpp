// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>

#include "langgs/core/config.hpp"

/// @file Scalar twins of the lane-wise functions, so that a formula written on `V` runs on Varying<float> and on float.

namespace langgs {

template <class T>
LANGGS_INLINE T select(bool mask, T a, T b) {
  return mask ? a : b;
}
LANGGS_INLINE float min(float a, float b) { return a < b ? a : b; }
LANGGS_INLINE float max(float a, float b) { return a > b ? a : b; }
LANGGS_INLINE int min(int a, int b) { return a < b ? a : b; }
LANGGS_INLINE int max(int a, int b) { return a > b ? a : b; }
LANGGS_INLINE float abs(float a) { return a < 0 ? -a : a; }
LANGGS_INLINE float negative_abs(float a) { return a < 0 ? a : -a; }
LANGGS_INLINE float exp(float x) { return ::expf(max(x, -87.f)); }
LANGGS_INLINE float exp256(float x) { return ::exp2f(8.f * x); }
LANGGS_INLINE float log(float x) { return ::logf(x); }
LANGGS_INLINE float sqrt(float x) { return ::sqrtf(x); }
LANGGS_INLINE float to_float(int a) { return static_cast<float>(a); }

}  // namespace langgs
