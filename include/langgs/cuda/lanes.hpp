// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "langgs/cuda/warp.hpp"

/// @file The CUDA twin of host/lanes.hpp.

namespace langgs::gpu {

/// The value of the one lane that a thread has.
template <class T>
struct LaneValues {
  T value;

  [[nodiscard]] __device__ __forceinline__ T operator[](int) const { return value; }
};

/// One element of a one-dimensional range, as seen by the thread that owns it.
class Lanes {
 public:
  template <class T>
  using Varying = T;
  using Mask = gpu::Mask;

  __device__ __forceinline__ explicit Lanes(int index) : index_(index) {}
  [[nodiscard]] __device__ __forceinline__ int first() const { return index_; }
  [[nodiscard]] __device__ __forceinline__ int count() const { return 1; }
  [[nodiscard]] __device__ __forceinline__ std::int32_t index() const { return index_; }
  [[nodiscard]] __device__ __forceinline__ Mask active() const { return true; }
  [[nodiscard]] __device__ __forceinline__ bool any(Mask mask) const { return mask; }
  [[nodiscard]] __device__ __forceinline__ std::int32_t max(std::int32_t v) const { return v; }
  /// Rounded towards zero.
  [[nodiscard]] __device__ __forceinline__ std::int32_t truncate(float v) const { return static_cast<std::int32_t>(v); }
  template <class T>
  [[nodiscard]] __device__ __forceinline__ LaneValues<T> values(T v) const {
    return {v};
  }
  /// Calls `body(lane)` for each lane where the mask holds, ascending; `values` tell what the lane has.
  template <class F>
  __device__ __forceinline__ void each(Mask mask, F&& body) const {
    if (mask) body(0);
  }
  /// base[index()].
  template <class T>
  [[nodiscard]] __device__ __forceinline__ T load(const T* base) const {
    return base[index_];
  }
  template <class T>
  __device__ __forceinline__ void store(T* base, const T& v) const {
    base[index_] = v;
  }
  template <class T>
  [[nodiscard]] __device__ __forceinline__ T gather(const T* base, std::int32_t index) const {
    return base[index];
  }
  /// sums[v] = the sum over the rows begin[index()] .. begin[index() + 1] of rows[row * kStride + v], in row order.
  template <int kStride, int N>
  __device__ __forceinline__ void sum_segments(const std::int32_t* begin, const float* rows, float (&sums)[N]) const {
#pragma unroll
    for (int v = 0; v < N; ++v) sums[v] = 0;
    for (std::int32_t r = begin[index_]; r < begin[index_ + 1]; ++r) {
#pragma unroll
      for (int v = 0; v < N; ++v) sums[v] += rows[static_cast<std::ptrdiff_t>(r) * kStride + v];
    }
  }
  /// A GPU hides latency with other warps.
  template <class T>
  __device__ __forceinline__ void prefetch(T*, std::int32_t) const {}
  template <class T>
  __device__ __forceinline__ void scatter(T* base, std::int32_t index, const T& v) const {
    base[index] = v;
  }

 private:
  int index_;
};

}  // namespace langgs::gpu
