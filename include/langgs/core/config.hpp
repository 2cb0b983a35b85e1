// SPDX-License-Identifier: Apache-2.0
#pragma once

/// @file Annotations that let one source compile as host code and as CUDA device code.

#if defined(__CUDACC__)
#define LANGGS_HD __host__ __device__
#else
#define LANGGS_HD
#endif

/// Small functions in hot loops: inlined whatever the compiler's cost model thinks, on host and device alike.
#define LANGGS_INLINE LANGGS_HD inline __attribute__((always_inline))

/// The same for functions of vector types, which nvcc refuses in device code.
#define LANGGS_HOST_INLINE inline __attribute__((always_inline))

/// The same for a lambda: `[&](int j) LANGGS_INLINE_LAMBDA { ... }`. Loop bodies handed to a block must not be calls.
#define LANGGS_INLINE_LAMBDA __attribute__((always_inline))

/// Before a loop over a small array that should live in registers: unrolled, so that no loop is left to index it.
#if defined(__CUDACC__)
#define LANGGS_UNROLL _Pragma("unroll")
#else
#define LANGGS_UNROLL _Pragma("GCC unroll 16")
#endif
