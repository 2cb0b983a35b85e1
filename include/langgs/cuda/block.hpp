// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

#include "langgs/core/config.hpp"
#include "langgs/core/half.hpp"
#include "langgs/device/math.hpp"
#include "langgs/device/ordered_insert.hpp"

/// @file The CUDA twin of host/block.hpp, name for name. A lane is a thread, so `Varying<T>` is a plain T and a mask is
/// a bool. See device/block.hpp for the rules.

namespace langgs::cuda {

inline constexpr int kLanes = 32;
inline constexpr unsigned kAllLanes = 0xFFFFFFFFu;

using Mask = bool;

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

struct Thread {
  int index;
};

/// Warps first .. last of a block, inclusive; none where last < first.
struct WarpRange {
  int first, last;
};

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
  template <class T>
  [[nodiscard]] __device__ __forceinline__ T max(T value) const {
#pragma unroll
    for (int step = kLanes / 2; step >= 1; step /= 2) {
      const T other = __shfl_xor_sync(kAllLanes, value, step);
      value = value > other ? value : other;
    }
    return value;
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
  __device__ __forceinline__ void prefetch(const float*) const {}
  /// base[0 .. 31] from half precision; lanes from `count` on are 0 and are not read.
  [[nodiscard]] __device__ __forceinline__ float load_half(const Half* base, int count) const {
    return lane_ < count ? static_cast<float>(base[lane_]) : 0.f;
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
  int index_, lane_;
};

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
  using Mask = cuda::Mask;
  using Warp = cuda::Warp;
  template <class T, int N>
  using SharedArray = cuda::SharedArray<T, N>;
  template <int K, int kOffers>
  using KLargest = cuda::KLargest<K>;

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

  /// Collects N sums, or one maximum, over all lanes of all warps of each item: here one row for each warp.
  template <int N, int kItems>
  class ItemTotals {
   public:
    __device__ __forceinline__ void put_sums(const Item& item, const float (&values)[N]) {
#pragma unroll
      for (int v = 0; v < N; ++v) {
        const float sum = item.warp().sum(values[v]);
        if (item.warp().lane_index() == 0) rows_[item.warp().index()][v][item.index()] = sum;
      }
    }
    __device__ __forceinline__ void put_max(const Item& item, float value) {
      static_assert(N == 1);
      const float most = item.warp().max(value);
      if (item.warp().lane_index() == 0) rows_[item.warp().index()][0][item.index()] = most;
    }
    /// Writes the sums that were put for item i, or zeros if no warp did, to the first N of the 16 floats at `line`.
    /// Only after a `sync`; `warps` are those of the item.
    __device__ __forceinline__ void write_sums(int i, WarpRange warps, float* line) const {
#pragma unroll
      for (int v = 0; v < N; ++v) {
        float total = 0;
        for (int w = warps.first; w <= warps.last; ++w) total += rows_[w][v][i];
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
  using Mask = cuda::Mask;

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

}  // namespace langgs::cuda
