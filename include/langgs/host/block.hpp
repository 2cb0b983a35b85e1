// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "langgs/core/error.hpp"
#include "langgs/core/half.hpp"
#include "langgs/core/rng.hpp"
#include "langgs/host/backend.hpp"
#include "langgs/host/varying.hpp"

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

/// Who runs at this moment inside a checked block, and in which epoch (number of syncs so far).
struct CheckContext {
  static constexpr int kBlockScope = -1;
  int agent = kBlockScope;  ///< thread index, or kThreads + warp index, or kBlockScope
  int epoch = 1;
  bool in_phase = false;

  /// The context of the block that this host thread is running. Shared arrays have no other way to know.
  static CheckContext*& current() {
    thread_local CheckContext* context = nullptr;
    return context;
  }
};

/// Shared memory of a block. Write with `set`, read with `[]` by value.
/// The checked form reports an element that is touched by two agents in one epoch, when one of them writes it.
template <class T, int N, bool Checked>
class SharedArray {
 public:
  static constexpr int kSize = N;
  LANGGS_INLINE const T& operator[](int i) const { return values_[i]; }
  LANGGS_INLINE void set(int i, const T& value) { values_[i] = value; }
  /// Elements first .. first + 31, one for each lane of a warp.
  template <class Warp>
  [[nodiscard]] LANGGS_INLINE Varying<T> load(int first, const Warp&) const {
    return Varying<T>::load(values_ + first);
  }
  template <class Warp>
  LANGGS_INLINE void store(int first, const Varying<T>& v, const Warp&) {
    v.store(values_ + first);
  }

 private:
  alignas(64) T values_[N];
};

template <class T, int N>
class SharedArray<T, N, true> {
 public:
  static constexpr int kSize = N;
  SharedArray() = default;

  T operator[](int i) const {
    check_index(i);
    const CheckContext& context = *CheckContext::current();
    Tag& tag = tags_[i];
    if (tag.write_epoch == context.epoch && tag.writer != context.agent) report("read", i, tag.writer, context);
    if (tag.read_epoch == context.epoch && tag.reader != context.agent) tag.reader = kManyReaders;
    if (tag.read_epoch != context.epoch) tag.reader = context.agent;
    tag.read_epoch = context.epoch;
    return values_[i];
  }
  void set(int i, const T& value) {
    check_index(i);
    const CheckContext& context = *CheckContext::current();
    Tag& tag = tags_[i];
    if (tag.write_epoch == context.epoch && tag.writer != context.agent) report("overwritten", i, tag.writer, context);
    if (tag.read_epoch == context.epoch && tag.reader != context.agent) report("overwritten", i, tag.reader, context);
    tag.write_epoch = context.epoch;
    tag.writer = context.agent;
    values_[i] = value;
  }
  template <class Warp>
  [[nodiscard]] Varying<T> load(int first, const Warp&) const {
    T lanes[kLanes];
    for (int i = 0; i < kLanes; ++i) lanes[i] = (*this)[first + i];
    return Varying<T>::load(lanes);
  }
  template <class Warp>
  void store(int first, const Varying<T>& v, const Warp&) {
    for (int i = 0; i < kLanes; ++i) set(first + i, v.lane(i));
  }

 private:
  static constexpr int kManyReaders = -2;
  struct Tag {
    int write_epoch = 0, writer = 0, read_epoch = 0, reader = 0;
  };

  static void check_index(int i) {
    if (i < 0 || i >= N) ::langgs::detail::raise<Error>("index ", i, " is outside a SharedArray of ", N, " elements");
  }
  [[noreturn]] static void report(const char* what, int i, int other, const CheckContext& context) {
    ::langgs::detail::raise<Error>("missing sync: SharedArray element ", i, " was ", what, " by agent ", context.agent,
                                   " in the same epoch in which agent ", other, " used it; call block.sync() between");
  }

  T values_[N]{};
  mutable std::array<Tag, N> tags_{};
};

struct Thread {
  int index;
};

/// 32 lanes in lock step. Code at warp scope is uniform; varying values live in Varying<T>.
template <int kThreads, bool Checked>
class Warp {
 public:
  explicit Warp(int index) : index_(index) {}
  [[nodiscard]] LANGGS_INLINE int index() const { return index_; }
  /// 0 .. 31.
  [[nodiscard]] LANGGS_INLINE Varying<std::int32_t> lane_index() const { return host::lane_index(); }
  [[nodiscard]] LANGGS_INLINE bool any(const Mask& mask) const { return host::any(mask); }
  [[nodiscard]] LANGGS_INLINE bool all(const Mask& mask) const { return host::all(mask); }
  template <class T>
  [[nodiscard]] LANGGS_INLINE T sum(const Varying<T>& value) const {
    return reduce_sum(value);
  }
  template <class T>
  [[nodiscard]] LANGGS_INLINE T max(const Varying<T>& value) const {
    return reduce_max(value);
  }
  /// base[0 .. 31] for the 32 lanes.
  template <class T>
  [[nodiscard]] LANGGS_INLINE Varying<T> load(const T* base) const {
    return Varying<T>::load(base);
  }
  /// The same from half precision; lanes from `count` on are 0 and are not read.
  [[nodiscard]] LANGGS_INLINE Varying<float> load_half(const Half* base, int count) const {
    alignas(64) float lanes[kLanes] = {};
    if (count >= kLanes) {
      for (int i = 0; i < kLanes; ++i) lanes[i] = static_cast<float>(base[i]);
    } else {
      for (int i = 0; i < count; ++i) lanes[i] = static_cast<float>(base[i]);
    }
    return Varying<float>::load(lanes);
  }
  /// Bit i is set where the mask holds in lane i.
  [[nodiscard]] LANGGS_INLINE std::uint32_t ballot(const Mask& mask) const { return reduce_or(mask & lane_bits()); }
  /// The mask whose bits are set in `word`.
  [[nodiscard]] LANGGS_INLINE Mask unballot(std::uint32_t word) const {
    return (Varying<std::int32_t>(static_cast<std::int32_t>(word)) & lane_bits()) != 0;
  }
  /// base[index] = v in the lanes where `wanted`.
  template <class T>
  LANGGS_INLINE void scatter(T* base, const Varying<std::int32_t>& index, const Mask& wanted,
                             const Varying<T>& v) const {
    for (int i = 0; i < kLanes; ++i)
      if (wanted.lane(i) != 0) base[index.lane(i)] = v.lane(i);
  }
  /// base[index] in the lanes where `wanted`, `otherwise` in the others.
  template <class T>
  [[nodiscard]] LANGGS_INLINE Varying<T> gather(const T* base, const Varying<std::int32_t>& index, const Mask& wanted,
                                                T otherwise) const {
    // The other lanes must not read at all: another block may be writing there.
    alignas(64) T lanes[kLanes];
    for (int i = 0; i < kLanes; ++i) lanes[i] = wanted.lane(i) != 0 ? base[index.lane(i)] : otherwise;
    return Varying<T>::load(lanes);
  }

  /// The warp's threads as rows of kColumns pixels: base[row * pitch + column], or `outside` beyond the valid part.
  template <int kColumns, class T>
  [[nodiscard]] LANGGS_INLINE Varying<T> load_rect(const T* base, std::ptrdiff_t pitch, int columns, int rows,
                                                   T outside) const {
    alignas(64) T lanes[kLanes];
    for (int i = 0; i < kLanes; ++i) lanes[i] = outside;
    for (int r = 0; r < std::min(rows, kLanes / kColumns); ++r)
      std::copy_n(base + r * pitch, std::min(columns, kColumns), lanes + r * kColumns);
    return Varying<T>::load(lanes);
  }
  template <int kColumns, class T>
  LANGGS_INLINE void store_rect(T* base, std::ptrdiff_t pitch, int columns, int rows, const Varying<T>& v) const {
    alignas(64) T lanes[kLanes];
    v.store(lanes);
    for (int r = 0; r < std::min(rows, kLanes / kColumns); ++r)
      std::copy_n(lanes + r * kColumns, std::min(columns, kColumns), base + r * pitch);
  }

  /// Calls `body(j)` for the j in [0, n), in ascending order, for which `wanted(j)` holds; `body` returns false to
  /// stop. The choice is made before the calls and without branches (CUDA: one lane per j and a ballot).
  template <class Wanted, class Body>
  LANGGS_INLINE void for_each_selected(int n, Wanted wanted, Body body) const {
    constexpr int kMaxSelected = 256;
    std::uint16_t selected[kMaxSelected];
    for (int begin = 0; begin < n; begin += kMaxSelected) {
      const int end = n - begin < kMaxSelected ? n : begin + kMaxSelected;
      int count = 0;
      for (int j = begin; j < end; ++j) {
        selected[count] = static_cast<std::uint16_t>(j - begin);
        count += wanted(j) ? 1 : 0;
      }
      for (int i = 0; i < count; ++i)
        if (!body(begin + selected[i])) return;
    }
  }

 private:
  int index_;
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

/// Up to 32 consecutive elements of a one-dimensional range.
class Lanes {
 public:
  template <class T>
  using Varying = host::Varying<T>;
  using Mask = host::Mask;

  LANGGS_INLINE Lanes(int first, int count) : first_(first), count_(count) {}
  [[nodiscard]] LANGGS_INLINE int first() const { return first_; }
  [[nodiscard]] LANGGS_INLINE int count() const { return count_; }
  [[nodiscard]] LANGGS_INLINE Varying<std::int32_t> index() const { return lane_index() + first_; }
  /// base[index()]. Reads past the end of the range; a Buffer is padded for it.
  template <class T>
  [[nodiscard]] LANGGS_INLINE Varying<T> load(const T* base) const {
    return Varying<T>::load(base + first_);
  }
  /// base[index()] = v, for the elements inside the range only.
  template <class T>
  LANGGS_INLINE void store(T* base, const Varying<T>& v) const {
    if (count_ == kLanes) {
      v.store(base + first_);
    } else {
      for (int i = 0; i < count_; ++i) base[first_ + i] = v.lane(i);
    }
  }
  template <class T>
  [[nodiscard]] LANGGS_INLINE Varying<T> gather(const T* base, const Varying<std::int32_t>& index) const {
    alignas(64) std::int32_t where[kLanes];
    alignas(64) T lanes[kLanes] = {};
    index.store(where);
    if (count_ == kLanes) {
      for (int i = 0; i < kLanes; ++i) lanes[i] = base[where[i]];
    } else {
      for (int i = 0; i < count_; ++i) lanes[i] = base[where[i]];
    }
    return Varying<T>::load(lanes);
  }
  /// sums[v] = the sum over the rows begin[index()] .. begin[index() + 1] of rows[row * N + v], in row order.
  template <int N>
  LANGGS_INLINE void sum_segments(const std::int32_t* begin, const float* rows, Varying<float> (&sums)[N]) const {
    alignas(64) float lanes[N][kLanes] = {};
    for (int i = 0; i < count_; ++i) {
      float total[N] = {};
      for (std::int32_t r = begin[first_ + i]; r < begin[first_ + i + 1]; ++r)
        for (int v = 0; v < N; ++v) total[v] += rows[static_cast<std::ptrdiff_t>(r) * N + v];
      for (int v = 0; v < N; ++v) lanes[v][i] = total[v];
    }
    for (int v = 0; v < N; ++v) sums[v] = Varying<float>::load(lanes[v]);
  }
  template <class T>
  LANGGS_INLINE void scatter(T* base, const Varying<std::int32_t>& index, const Varying<T>& v) const {
    alignas(64) std::int32_t where[kLanes];
    alignas(64) T lanes[kLanes];
    index.store(where);
    v.store(lanes);
    for (int i = 0; i < count_; ++i) base[where[i]] = lanes[i];
  }

 private:
  int first_, count_;
};

}  // namespace langgs::host
