// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <type_traits>

#include "langgs/core/error.hpp"
#include "langgs/core/rng.hpp"
#include "langgs/host/backend.hpp"
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

  explicit Block(int index, Permutation permutation = {}) : index_(index), permutation_(permutation) {
    if constexpr (kChecked) CheckContext::current() = &context_;
  }
  ~Block() {
    if constexpr (kChecked) CheckContext::current() = nullptr;
  }
  Block(const Block&) = delete;
  Block& operator=(const Block&) = delete;

  [[nodiscard]] LANGGS_INLINE int index() const { return index_; }

  template <class F>
  LANGGS_INLINE void threads(F&& body) {
    phase(kThreads, 0, [&](int t) { body(Thread{t}); });
  }
  template <class F>
  LANGGS_INLINE void warps(F&& body) {
    phase(
        kWarps, kThreads, [&](int w) __attribute__((always_inline)) {
          const Warp warp(w);
          body(warp);
        });
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
  /// Adds 1 to counters[index] for each lane where `wanted`. Only this block may touch these counters meanwhile;
  /// integers commute, so the result does not depend on the order.
  LANGGS_INLINE void count(std::int32_t* counters, const Varying<std::int32_t>& index, const Mask& wanted) const {
    for (int i = 0; i < kLanes; ++i)
      if (wanted.lane(i) != 0) ++counters[index.lane(i)];
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
