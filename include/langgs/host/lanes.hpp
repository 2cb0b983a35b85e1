// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

#include "langgs/host/lane_math.hpp"
#include "langgs/host/lane_reductions.hpp"
#include "langgs/host/varying.hpp"

namespace langgs::host {

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
  /// sums[v] = the sum over the rows begin[index()] .. begin[index() + 1] of rows[row * kStride + v], in row order.
  template <int kStride, int N>
  LANGGS_INLINE void sum_segments(const std::int32_t* begin, const float* rows, Varying<float> (&sums)[N]) const {
    alignas(64) float lanes[N][kLanes] = {};
    for (int i = 0; i < count_; ++i) {
      float total[N] = {};
      for (std::int32_t r = begin[first_ + i]; r < begin[first_ + i + 1]; ++r)
        for (int v = 0; v < N; ++v) total[v] += rows[static_cast<std::ptrdiff_t>(r) * kStride + v];
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
