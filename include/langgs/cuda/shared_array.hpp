// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "langgs/core/config.hpp"

/// @file The CUDA twin of host/shared_array.hpp.

namespace langgs::gpu {

/// Shared memory of a block; lives in the kernel's `Shared` struct and is not initialised.
template <class T, int N>
class SharedArray {
 public:
  static constexpr int kSize = N;
  __device__ __forceinline__ const T& operator[](int i) const { return values_[i]; }
  __device__ __forceinline__ void set(int i, const T& value) { values_[i] = value; }
  /// Elements first .. first + 31, one for each lane of a warp.
  template <class Warp>
  [[nodiscard]] __device__ __forceinline__ T load(int first, const Warp& warp) const {
    return values_[first + warp.lane_index()];
  }
  /// The whole warp sees the stored elements afterwards: lanes need not run in lock step.
  template <class Warp>
  __device__ __forceinline__ void store(int first, const T& value, const Warp& warp) {
    values_[first + warp.lane_index()] = value;
    __syncwarp();
  }

 private:
  alignas(16) T values_[N];
};

}  // namespace langgs::gpu
