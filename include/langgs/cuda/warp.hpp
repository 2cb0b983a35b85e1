// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

#include "langgs/core/config.hpp"
#include "langgs/core/half.hpp"
#include "langgs/device/math.hpp"

/// @file The CUDA twin of host/warp.hpp. A lane is a thread, so `Varying<T>` is a plain T and a mask is a bool.

namespace langgs::gpu {

inline constexpr int kLanes = 32;
inline constexpr unsigned kAllLanes = 0xFFFFFFFFu;

using Mask = bool;

struct Thread {
  int index;
};

/// Warps first .. last of a block, inclusive; none where last < first.
struct WarpRange {
  int first, last;
};

/// Half's conversions by the instructions for them: the same values, in one instruction instead of a dozen.
[[nodiscard]] __device__ __forceinline__ float load_channel(float value) { return value; }
[[nodiscard]] __device__ __forceinline__ float load_channel(Half value) {
  float result;
  asm("cvt.f32.f16 %0, %1;" : "=f"(result) : "h"(value.bits));
  return result;
}
__device__ __forceinline__ void store_channel(float* to, float value) { *to = value; }
__device__ __forceinline__ void store_channel(Half* to, float value) {
  asm("cvt.rn.f16.f32 %0, %1;" : "=h"(to->bits) : "f"(value));
}

/// 32 lanes; code at warp scope is run by all of them and takes the same branches in all of them.
class Warp {
 public:
  __device__ __forceinline__ explicit Warp(int thread) : index_(thread / kLanes), lane_(thread % kLanes) {}
  [[nodiscard]] __device__ __forceinline__ int index() const { return index_; }
  /// 0 .. 31.
  [[nodiscard]] __device__ __forceinline__ std::int32_t lane_index() const { return lane_; }
  [[nodiscard]] __device__ __forceinline__ bool any(Mask mask) const { return __any_sync(kAllLanes, mask) != 0; }
  [[nodiscard]] __device__ __forceinline__ bool all(Mask mask) const { return __all_sync(kAllLanes, mask) != 0; }
  /// The tree xor 16, 8, 4, 2, 1: the host's order of additions, and the same bits in every lane.
  template <class T>
  [[nodiscard]] __device__ __forceinline__ T sum(T value) const {
#pragma unroll
    for (int step = kLanes / 2; step >= 1; step /= 2) value = value + __shfl_xor_sync(kAllLanes, value, step);
    return value;
  }
  /// Calls put(i, sum of values[i] over the lanes) for each i, in one lane each: the same bits as `sum`. In each step
  /// of the tree a lane hands half of its values to its partner, so that N values take about N shuffles instead of 5 N.
  template <int N, class Put>
  __device__ __forceinline__ void sums(const float (&values)[N], const Put& put) const {
    share_sums<kLanes / 2>(values, 0, N, put);
  }
  template <class T>
  [[nodiscard]] __device__ __forceinline__ T max(T value) const {
#pragma unroll
    for (int step = kLanes / 2; step >= 1; step /= 2) {
      const T other = __shfl_xor_sync(kAllLanes, value, step);
      value = value > other ? value : other;
    }
    return value;
  }
  /// The same for values that are not negative, which order as their bits: from sm_80 on, one instruction.
  [[nodiscard]] __device__ __forceinline__ float max_of_non_negative(float value) const {
#if __CUDA_ARCH__ >= 800
    return __uint_as_float(__reduce_max_sync(kAllLanes, __float_as_uint(value)));
#else
    return max(value);
#endif
  }
  /// base[0 .. 31] for the 32 lanes.
  template <class T>
  [[nodiscard]] __device__ __forceinline__ T load(const T* base) const {
    return base[lane_];
  }
  /// base[0 .. 31] = v.
  template <class T>
  __device__ __forceinline__ void store(T* base, const T& v) const {
    base[lane_] = v;
  }
  /// A GPU hides latency with other warps.
  __device__ __forceinline__ void prefetch(const void*, std::size_t) const {}
  /// base[0 .. 31] of a row of channels, stored as float or half; lanes from `count` on are 0 and are not read.
  template <class T>
  [[nodiscard]] __device__ __forceinline__ float load_channels(const T* base, int count) const {
    return lane_ < count ? load_channel(base[lane_]) : 0.f;
  }
  /// base[0 .. 31] = v in the lanes before `count`, rounded to the nearest T.
  template <class T>
  __device__ __forceinline__ void store_channels(T* base, int count, float v) const {
    if (lane_ < count) store_channel(base + lane_, v);
  }
  /// The same for what is not read soon.
  template <class T>
  __device__ __forceinline__ void stream_channels(T* base, int count, float v) const {
    store_channels(base, count, v);
  }
  /// *to = value, which is the same in all lanes, after all of them have come here.
  template <class T>
  __device__ __forceinline__ void store_uniform(T* to, T value) const {
    __syncwarp();
    if (lane_ == 0) *to = value;
  }
  /// Bit i is set where the mask holds in lane i.
  [[nodiscard]] __device__ __forceinline__ std::uint32_t ballot(Mask mask) const {
    return __ballot_sync(kAllLanes, mask);
  }
  /// The mask whose bits are set in `word`.
  [[nodiscard]] __device__ __forceinline__ Mask unballot(std::uint32_t word) const {
    return ((word >> lane_) & 1u) != 0;
  }
  /// base[index] = v in the lanes where `wanted`.
  template <class T>
  __device__ __forceinline__ void scatter(T* base, std::int32_t index, Mask wanted, T v) const {
    if (wanted) base[index] = v;
  }
  /// base[index] in the lanes where `wanted`, `otherwise` in the others, which do not read.
  template <class T>
  [[nodiscard]] __device__ __forceinline__ T gather(const T* base, std::int32_t index, Mask wanted, T otherwise) const {
    return wanted ? base[index] : otherwise;
  }
  /// base[index]; every lane reads.
  template <class T>
  [[nodiscard]] __device__ __forceinline__ T gather(const T* base, std::int32_t index) const {
    return base[index];
  }

  /// The warp's threads as rows of kColumns pixels: base[row * pitch + column], or `outside` beyond the valid part.
  template <int kColumns, class T>
  [[nodiscard]] __device__ __forceinline__ T load_rect(const T* base, std::ptrdiff_t pitch, int columns, int rows,
                                                       T outside) const {
    const int row = lane_ / kColumns, column = lane_ % kColumns;
    return row < rows && column < columns ? base[row * pitch + column] : outside;
  }
  template <int kColumns, class T>
  __device__ __forceinline__ void store_rect(T* base, std::ptrdiff_t pitch, int columns, int rows, T v) const {
    const int row = lane_ / kColumns, column = lane_ % kColumns;
    if (row < rows && column < columns) base[row * pitch + column] = v;
  }

 private:
  /// The lane has sums over 32 / (2 kStep) lanes of the values first .. end - 1; what `values` has beyond is ignored.
  template <int kStep, int N, class Put>
  __device__ __forceinline__ void share_sums(const float (&values)[N], int first, int end, const Put& put) const {
    if constexpr (kStep == 0) {
#pragma unroll
      for (int v = 0; v < N; ++v)
        if (first + v < end) put(first + v, values[v]);
    } else if constexpr (N == 1) {
      float total = values[0];
#pragma unroll
      for (int step = kStep; step >= 1; step /= 2) total += __shfl_xor_sync(kAllLanes, total, step);
      if ((lane_ & (2 * kStep - 1)) == 0 && first < end) put(first, total);
    } else {
      constexpr int kHalf = (N + 1) / 2;
      const bool is_upper = (lane_ & kStep) != 0;
      float kept[kHalf];
#pragma unroll
      for (int v = 0; v < kHalf; ++v) {
        const float lower = values[v], upper = v + kHalf < N ? values[v + kHalf] : 0.f;
        kept[v] = (is_upper ? upper : lower) + __shfl_xor_sync(kAllLanes, is_upper ? lower : upper, kStep);
      }
      const int middle = first + kHalf;
      share_sums<kStep / 2>(kept, is_upper ? middle : first, is_upper || end < middle ? end : middle, put);
    }
  }

  int index_, lane_;
};

}  // namespace langgs::gpu
