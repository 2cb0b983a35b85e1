// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

#include "langgs/core/error.hpp"
#include "langgs/host/varying.hpp"

/// @file Shared memory of a block, and the check that two agents do not use an element without a sync between.

namespace langgs::host {

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

}  // namespace langgs::host
