// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "langgs/cuda/warp.hpp"
#include "langgs/device/ordered_insert.hpp"

/// @file The CUDA twin of host/k_largest.hpp.

namespace langgs::gpu {

/// For each thread the K largest of the values that its warp was offered, with their tags. In registers: an offer is
/// inserted at once.
template <int K>
class KLargest {
 public:
  __device__ __forceinline__ void clear(const Warp&) {
#pragma unroll
    for (int k = 0; k < K; ++k) {
      value_[k] = 0;
      tag_[k] = 0;
    }
  }
  __device__ __forceinline__ void offer(const Warp& warp, float value, std::int32_t tag) {
    if (warp.any(value > value_[K - 1])) ordered_insert(value_, tag_, value, tag);
  }
  __device__ __forceinline__ void settle(const Warp&) {}
  [[nodiscard]] __device__ __forceinline__ float value(const Warp&, int k) const { return value_[k]; }
  [[nodiscard]] __device__ __forceinline__ std::int32_t tag(const Warp&, int k) const { return tag_[k]; }

 private:
  float value_[K];
  std::int32_t tag_[K];
};

}  // namespace langgs::gpu
