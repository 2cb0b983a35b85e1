// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <type_traits>

#include "langgs/core/error.hpp"
#include "langgs/core/rng.hpp"
#include "langgs/host/backend.hpp"
#include "langgs/host/k_largest.hpp"
#include "langgs/host/lanes.hpp"
#include "langgs/host/shared_array.hpp"
#include "langgs/host/warp.hpp"

/// @file The host twin of a CUDA thread block: one worker runs it, phase by phase. See device/block.hpp for the rules.

namespace langgs::host {

/// A permutation of [0, n) that is cheap to evaluate: identity, reversal, or a seeded affine map.
struct Permutation {
  ExecutionOrder order = ExecutionOrder::ascending;
  std::uint64_t seed = 0;

  [[nodiscard]] int operator()(int i, int n) const {
    switch (order) {
      case ExecutionOrder::ascending:
        return i;
      case ExecutionOrder::descending:
        return n - 1 - i;
      case ExecutionOrder::shuffled:
        break;
    }
    const std::uint64_t word = mix64(seed);
    std::uint64_t stride = 1 + (word >> 32) % static_cast<std::uint64_t>(n);
    while (gcd(stride, static_cast<std::uint64_t>(n)) != 1) ++stride;
    return static_cast<int>((stride * static_cast<std::uint64_t>(i) + (word & 0xFFFF)) % static_cast<std::uint64_t>(n));
  }

 private:
  static std::uint64_t gcd(std::uint64_t a, std::uint64_t b) {
    while (b != 0) {
      const std::uint64_t r = a % b;
      a = b;
      b = r;
    }
    return a;
  }
};

/// kThreads threads that share memory and meet at `sync`.
template <int kThreads_, class Backend>
class Block {
 public:
  static constexpr int kThreads = kThreads_;
  static constexpr int kWarps = kThreads / kLanes;
  static constexpr bool kChecked = Backend::kChecked;
  static_assert(kThreads % kLanes == 0, "a block has whole warps of 32 threads");

  template <class T>
  using Varying = host::Varying<T>;
  using Mask = host::Mask;
  using Warp = host::Warp<kThreads, kChecked>;
  template <class T, int N>
  using SharedArray = host::SharedArray<T, N, kChecked>;
  template <int K, int kOffers>
  using KLargest = host::KLargest<K, kOffers, Warp, kWarps>;

  /// One value for each thread that lives across phases: a register on CUDA, an aligned row here.
  template <class T>
  class PerThread {
   public:
    LANGGS_INLINE T& operator[](Thread t) { return row_[t.index]; }
    LANGGS_INLINE Varying<T> load(const Warp& warp) const { return Varying<T>::load(row_ + warp.index() * kLanes); }
    LANGGS_INLINE void store(const Warp& warp, const Varying<T>& v) { v.store(row_ + warp.index() * kLanes); }

   private:
    alignas(64) T row_[kThreads];
  };

  /// One value for each warp that lives across phases, uniform in the warp.
  template <class T>
  class PerWarp {
   public:
    [[nodiscard]] LANGGS_INLINE const T& load(const Warp& warp) const { return row_[warp.index()]; }
    LANGGS_INLINE void store(const Warp& warp, const T& v) { row_[warp.index()] = v; }

   private:
    T row_[kWarps];
  };

  /// One item of `for_each_item` with the warps that it concerns.
  class Item {
   public:
    LANGGS_INLINE Item(Block& block, int index, WarpRange warps) : block_(block), index_(index), warps_(warps) {}
    [[nodiscard]] LANGGS_INLINE int index() const { return index_; }
    /// Calls `body(warp)` for the warps of the item, in ascending order.
    template <class F>
    LANGGS_INLINE void warps(F&& body) const {
      for (int w = warps_.first; w <= warps_.last; ++w) {
        const Warp warp(w);
        if constexpr (kChecked) block_.context_.agent = kThreads + w;
        body(warp);
      }
      if constexpr (kChecked) block_.context_.agent = kThreads + warps_.first;
    }

   private:
    Block& block_;
    int index_;
    WarpRange warps_;
  };

  /// Collects N sums, or one maximum of values that are not negative, over all lanes of all warps of each item. At item
  /// scope a varying value is shared by the warps here, and each warp has its own on CUDA: `put` closes the difference.
  template <int N, int kItems>
  class ItemTotals {
   public:
    LANGGS_INLINE void put_sums(const Item& item, const Varying<float> (&values)[N]) {
      float sums[N];
      reduce_sums(values, sums);
      for (int v = 0; v < N; ++v) totals_.set(item.index() * N + v, sums[v]);
    }
    LANGGS_INLINE void put_max(const Item& item, const Varying<float>& value) {
      static_assert(N == 1);
      totals_.set(item.index(), reduce_max(value));
    }
    /// Writes the sums that were put for item i, or zeros if no warp did, to the first N of the 16 floats at `line`.
    /// Only after a `sync`; `warps` are those of the item.
    LANGGS_INLINE void write_sums(int i, WarpRange warps, float* line) const {
      static_assert(N <= 16);
      alignas(64) float sums[16] = {};
      if (warps.first <= warps.last)
        for (int v = 0; v < N; ++v) sums[v] = totals_[i * N + v];
      stream_line(sums, line);
    }
    /// The maximum that was put for item i. Only after a `sync`; `warps` are those of the item, at least one.
    [[nodiscard]] LANGGS_INLINE float max(int i, WarpRange) const { return totals_[i]; }

   private:
    SharedArray<float, N * kItems> totals_;
  };

  explicit Block(int index, Permutation permutation = {}) : index_(index), permutation_(permutation) {
    if constexpr (kChecked) CheckContext::current() = &context_;
  }
  ~Block() {
    if constexpr (kChecked) CheckContext::current() = nullptr;
  }
  Block(const Block&) = delete;
  Block& operator=(const Block&) = delete;

  [[nodiscard]] LANGGS_INLINE int index() const { return index_; }
  /// 0 .. 31, as in every warp.
  [[nodiscard]] LANGGS_INLINE Varying<std::int32_t> lane_index() const { return host::lane_index(); }

  template <class F>
  LANGGS_INLINE void threads(F&& body) {
    threads(kThreads, body);
  }
  /// The first n threads only, n <= kThreads.
  template <class F>
  LANGGS_INLINE void threads(int n, F&& body) {
    phase(n, 0, [&](int t) LANGGS_INLINE_LAMBDA { body(Thread{t}); });
  }
  /// Says that the cache line at `address` will soon be loaded.
  LANGGS_INLINE void prefetch(const void* address) const { __builtin_prefetch(address); }
  template <class F>
  LANGGS_INLINE void warps(F&& body) {
    phase(kWarps, kThreads, [&](int w) LANGGS_INLINE_LAMBDA {
      const Warp warp(w);
      body(warp);
    });
  }
  /// Calls `body(item)` for the items 0 .. n-1, in ascending order, with the warps [first, last] that each concerns;
  /// items without any are left out. A phase.
  template <class WarpsOf, class F>
  LANGGS_INLINE void for_each_item(int n, WarpsOf&& warps_of, F&& body) {
    if constexpr (kChecked) {
      if (context_.in_phase) ::langgs::detail::raise<Error>("a phase inside a phase");
      context_.in_phase = true;
    }
    for (int j = 0; j < n; ++j) {
      // Each warp of the item reads what belongs to it; here the first does so for all.
      if constexpr (kChecked) context_.agent = kThreads;
      const WarpRange warps = warps_of(j);
      if (warps.last < warps.first) continue;
      body(Item(*this, j, warps));
    }
    if constexpr (kChecked) {
      context_.agent = CheckContext::kBlockScope;
      context_.in_phase = false;
    }
  }
  LANGGS_INLINE void sync() {
    if constexpr (kChecked) {
      if (context_.in_phase) ::langgs::detail::raise<Error>("block.sync() inside a phase would deadlock on a GPU");
      ++context_.epoch;
    }
  }
  /// Whether `mask_of(warp)` holds in every lane of every warp.
  template <class MaskOf>
  [[nodiscard]] LANGGS_INLINE bool all(MaskOf&& mask_of) {
    bool result = true;
    for (int w = 0; w < kWarps; ++w) result = result && host::all(mask_of(Warp(w)));
    return result;
  }
  /// Adds 1 to counters[indices[i]] for each lane and i. Only this block may touch these counters meanwhile; integers
  /// commute, so the result does not depend on the order.
  template <int N>
  LANGGS_INLINE void count(std::int32_t* counters, const Varying<std::int32_t> (&indices)[N]) const {
    alignas(64) std::int32_t where[N][kLanes];
    for (int i = 0; i < N; ++i) indices[i].store(where[i]);
    // Neighbouring lanes often count the same, and each addition waits for the one before: take turns.
    for (int lane = 0; lane < kLanes; ++lane)
      for (int i = 0; i < N; ++i) ++counters[where[i][lane]];
  }

 private:
  template <class F>
  LANGGS_INLINE void phase(int n, [[maybe_unused]] int first_agent, F&& body) {
    if constexpr (kChecked) {
      if (context_.in_phase) ::langgs::detail::raise<Error>("a phase inside a phase");
      context_.in_phase = true;
      for (int i = 0; i < n; ++i) {
        const int chosen = permutation_(i, n);
        context_.agent = first_agent + chosen;
        body(chosen);
      }
      context_.agent = CheckContext::kBlockScope;
      context_.in_phase = false;
    } else {
      for (int i = 0; i < n; ++i) body(i);
    }
  }

  struct Nothing {};
  int index_;
  [[maybe_unused]] Permutation permutation_;
  [[no_unique_address]] std::conditional_t<kChecked, CheckContext, Nothing> context_;
};

}  // namespace langgs::host
