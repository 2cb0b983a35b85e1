// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "langgs/core/config.hpp"
#include "langgs/cuda/k_largest.hpp"
#include "langgs/cuda/lanes.hpp"
#include "langgs/cuda/shared_array.hpp"
#include "langgs/cuda/warp.hpp"

/// @file The CUDA twin of host/block.hpp, name for name. See device/block.hpp for the rules.

namespace langgs::gpu {

/// kThreads threads that share memory and meet at `sync`.
template <int kThreads_>
class Block {
 public:
  static constexpr int kThreads = kThreads_;
  static constexpr int kWarps = kThreads / kLanes;
  static constexpr bool kChecked = false;
  static_assert(kThreads % kLanes == 0 && kThreads <= 1024, "a block has 1 to 32 whole warps of 32 threads");

  template <class T>
  using Varying = T;
  using Mask = gpu::Mask;
  using Warp = gpu::Warp;
  template <class T, int N>
  using SharedArray = gpu::SharedArray<T, N>;
  template <int K, int kOffers>
  using KLargest = gpu::KLargest<K>;

  /// One value for each thread that lives across phases: a register.
  template <class T>
  class PerThread {
   public:
    __device__ __forceinline__ T& operator[](Thread) { return value_; }
    __device__ __forceinline__ T load(const Warp&) const { return value_; }
    __device__ __forceinline__ void store(const Warp&, const T& v) { value_ = v; }

   private:
    T value_;
  };

  /// One value for each warp that lives across phases, uniform in the warp.
  template <class T>
  using PerWarp = PerThread<T>;

  /// One item of `for_each_item`, as seen by one of the warps that it concerns.
  class Item {
   public:
    __device__ __forceinline__ Item(const Warp& warp, int index) : warp_(warp), index_(index) {}
    [[nodiscard]] __device__ __forceinline__ int index() const { return index_; }
    template <class F>
    __device__ __forceinline__ void warps(F&& body) const {
      body(warp_);
    }
    [[nodiscard]] __device__ __forceinline__ const Warp& warp() const { return warp_; }

   private:
    const Warp& warp_;
    int index_;
  };

  /// Collects N sums, or one maximum of values that are not negative, over all lanes of all warps of each item: here
  /// one row for each warp.
  template <int N, int kItems>
  class ItemTotals {
   public:
    __device__ __forceinline__ void put_sums(const Item& item, const float (&values)[N]) {
      item.warp().sums(values, [&](int v, float sum) { rows_[item.warp().index()][v][place(v, item.index())] = sum; });
    }
    __device__ __forceinline__ void put_max(const Item& item, float value) {
      static_assert(N == 1);
      const float most = item.warp().max_of_non_negative(value);
      if (item.warp().lane_index() == 0) rows_[item.warp().index()][0][item.index()] = most;
    }
    /// Writes the sums that were put for item i, or zeros if no warp did, to the first N of the 16 floats at `line`.
    /// Only after a `sync`; `warps` are those of the item.
    __device__ __forceinline__ void write_sums(int i, WarpRange warps, float* line) const {
#pragma unroll
      for (int v = 0; v < N; ++v) {
        float total = 0;
        for (int w = warps.first; w <= warps.last; ++w) total += rows_[w][v][place(v, i)];
        line[v] = total;
      }
    }
    /// The maximum that was put for item i. Only after a `sync`; `warps` are those of the item, at least one.
    [[nodiscard]] __device__ __forceinline__ float max(int i, WarpRange warps) const {
      float most = rows_[warps.first][0][i];
      for (int w = warps.first + 1; w <= warps.last; ++w) most = most > rows_[w][0][i] ? most : rows_[w][0][i];
      return most;
    }

   private:
    /// Each row begins one place later: the lanes that write the sums of one item write to different banks.
    [[nodiscard]] __device__ __forceinline__ static int place(int v, int i) {
      return static_cast<int>(static_cast<unsigned>(i + v) % kItems);
    }

    float rows_[kWarps][N][kItems];
  };

  Block() = default;
  Block(const Block&) = delete;
  Block& operator=(const Block&) = delete;

  [[nodiscard]] __device__ __forceinline__ int index() const { return static_cast<int>(blockIdx.x); }

  /// 0 .. 31, as in every warp.
  [[nodiscard]] __device__ __forceinline__ std::int32_t lane_index() const {
    return static_cast<std::int32_t>(threadIdx.x % kLanes);
  }

  template <class F>
  __device__ __forceinline__ void threads(F&& body) {
    body(Thread{static_cast<int>(threadIdx.x)});
  }
  /// The first n threads only, n <= kThreads.
  template <class F>
  __device__ __forceinline__ void threads(int n, F&& body) {
    if (static_cast<int>(threadIdx.x) < n) body(Thread{static_cast<int>(threadIdx.x)});
  }
  /// A GPU hides latency with other warps.
  __device__ __forceinline__ void prefetch(const void*) const {}
  template <class F>
  __device__ __forceinline__ void warps(F&& body) {
    const Warp warp(static_cast<int>(threadIdx.x));
    body(warp);
  }
  /// Calls `body(item)` for the items 0 .. n-1, in ascending order, that concern the own warp. Each lane asks about one
  /// item; the answers are shared by a ballot.
  template <class WarpsOf, class F>
  __device__ __forceinline__ void for_each_item(int n, WarpsOf&& warps_of, F&& body) {
    const Warp warp(static_cast<int>(threadIdx.x));
    for (int begin = 0; begin < n; begin += kLanes) {
      const int mine = begin + warp.lane_index();
      bool wanted = false;
      if (mine < n) {
        const WarpRange warps = warps_of(mine);
        wanted = warps.first <= warp.index() && warp.index() <= warps.last;
      }
      for (std::uint32_t left = warp.ballot(wanted); left != 0; left &= left - 1)
        body(Item(warp, begin + __ffs(static_cast<int>(left)) - 1));
    }
  }
  __device__ __forceinline__ void sync() { __syncthreads(); }
  /// Whether `mask_of(warp)` holds in every lane of every warp. Also a barrier.
  template <class MaskOf>
  [[nodiscard]] __device__ __forceinline__ bool all(MaskOf&& mask_of) {
    return __syncthreads_and(mask_of(Warp(static_cast<int>(threadIdx.x)))) != 0;
  }
  /// Adds 1 to counters[indices[i]] for each i. Integers commute: the order does not matter.
  template <int N>
  __device__ __forceinline__ void count(std::int32_t* counters, const std::int32_t (&indices)[N]) const {
#pragma unroll
    for (int i = 0; i < N; ++i) atomicAdd(counters + indices[i], 1);
  }
};

}  // namespace langgs::gpu
