// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

#include "langgs/host/lane_math.hpp"
#include "langgs/host/lane_memory.hpp"
#include "langgs/host/lane_reductions.hpp"
#include "langgs/host/varying.hpp"

namespace langgs::host {

/// The lanes of a Varying as an array, for code that goes from lane to lane.
template <class T>
struct LaneValues {
  alignas(64) T values[kLanes];

  LANGGS_INLINE explicit LaneValues(const Varying<T>& v) { v.store(values); }
  [[nodiscard]] LANGGS_INLINE T operator[](int lane) const { return values[lane]; }
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
  /// The lanes inside the range.
  [[nodiscard]] LANGGS_INLINE Mask active() const { return lane_index() < count_; }
  [[nodiscard]] LANGGS_INLINE bool any(const Mask& mask) const { return host::any(mask); }
  [[nodiscard]] LANGGS_INLINE std::int32_t max(const Varying<std::int32_t>& v) const { return reduce_max(v); }
  /// Rounded towards zero.
  [[nodiscard]] LANGGS_INLINE Varying<std::int32_t> truncate(const Varying<float>& v) const {
    return convert<std::int32_t>(v);
  }
  template <class T>
  [[nodiscard]] LANGGS_INLINE LaneValues<T> values(const Varying<T>& v) const {
    return LaneValues<T>(v);
  }
  /// Calls `body(lane)` for each lane where the mask holds, ascending; `values` tell what the lane has.
  template <class F>
  LANGGS_INLINE void each(const Mask& mask, F&& body) const {
    for (std::uint32_t left = bits_of(mask); left != 0; left &= left - 1) body(__builtin_ctz(left));
  }
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
    return host::gather(base, index, active(), T(0));
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
  /// Says that base[index] will soon be written.
  template <class T>
  LANGGS_INLINE void prefetch(T* base, const Varying<std::int32_t>& index) const {
    const LaneValues<std::int32_t> where(index);
    for (int i = 0; i < count_; ++i) __builtin_prefetch(base + where[i], 1);
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
