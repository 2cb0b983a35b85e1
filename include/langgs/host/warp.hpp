// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "langgs/core/half.hpp"
#include "langgs/host/lane_math.hpp"
#include "langgs/host/lane_memory.hpp"
#include "langgs/host/lane_reductions.hpp"
#include "langgs/host/varying.hpp"

namespace langgs::host {

struct Thread {
  int index;
};

/// Warps first .. last of a block, inclusive; none where last < first.
struct WarpRange {
  int first, last;
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
  /// base[0 .. 31] = v.
  template <class T>
  LANGGS_INLINE void store(T* base, const Varying<T>& v) const {
    v.store(base);
  }
  /// Says that `bytes` bytes from base on will soon be loaded, if there is such memory.
  LANGGS_INLINE void prefetch(const void* base, std::size_t bytes) const {
    const char* const first = static_cast<const char*>(base);
    for (std::size_t i = 0; i < bytes; i += 64) __builtin_prefetch(first + i);
    __builtin_prefetch(first + bytes - 1);
  }
  /// base[0 .. 31] of a row of channels, stored as float or half; lanes from `count` on are 0 and are not read.
  template <class T>
  [[nodiscard]] LANGGS_INLINE Varying<float> load_channels(const T* base, int count) const {
    if (count < kLanes) {
      alignas(64) T lanes[kLanes] = {};
      for (int i = 0; i < kLanes; ++i)  // not up to count: GCC 12 cannot tell that it is less
        if (i < count) lanes[i] = base[i];
      return whole_channels(lanes);
    }
    return whole_channels(base);
  }
  /// base[0 .. 31] = v in the lanes before `count`, rounded to the nearest T.
  template <class T>
  LANGGS_INLINE void store_channels(T* base, int count, const Varying<float>& v) const {
    if (count < kLanes) {
      alignas(64) T lanes[kLanes];
      put_channels(lanes, v);
      for (int i = 0; i < kLanes; ++i)
        if (i < count) base[i] = lanes[i];
    } else {
      put_channels(base, v);
    }
  }
  /// The same past the caches, for what is not read soon.
  template <class T>
  LANGGS_INLINE void stream_channels(T* base, int count, const Varying<float>& v) const {
    if constexpr (sizeof(T) == sizeof(float)) {
      if (count >= kLanes) return v.template stream_rows<kLanes>(base, kLanes);
    } else {
      if (count >= kLanes) return stream_half(base, v);
    }
    store_channels(base, count, v);
  }
  /// *to = value, which is the same in all lanes, after all of them have come here.
  template <class T>
  LANGGS_INLINE void store_uniform(T* to, T value) const {
    *to = value;
  }
  /// Bit i is set where the mask holds in lane i.
  [[nodiscard]] LANGGS_INLINE std::uint32_t ballot(const Mask& mask) const { return bits_of(mask); }
  /// The mask whose bits are set in `word`.
  [[nodiscard]] LANGGS_INLINE Mask unballot(std::uint32_t word) const {
    return (Varying<std::int32_t>(static_cast<std::int32_t>(word)) & lane_bits()) != 0;
  }
  /// base[index] = v in the lanes where `wanted`.
  template <class T>
  LANGGS_INLINE void scatter(T* base, const Varying<std::int32_t>& index, const Mask& wanted,
                             const Varying<T>& v) const {
    host::scatter(base, index, wanted, v);
  }
  /// base[index] in the lanes where `wanted`, `otherwise` in the others, which do not read.
  template <class T>
  [[nodiscard]] LANGGS_INLINE Varying<T> gather(const T* base, const Varying<std::int32_t>& index, const Mask& wanted,
                                                T otherwise) const {
    return host::gather(base, index, wanted, otherwise);
  }
  /// base[index]; every lane reads.
  template <class T>
  [[nodiscard]] LANGGS_INLINE Varying<T> gather(const T* base, const Varying<std::int32_t>& index) const {
    return host::gather(base, index);
  }

  /// The warp's threads as rows of kColumns pixels: base[row * pitch + column], or `outside` beyond the valid part.
  template <int kColumns, class T>
  [[nodiscard]] LANGGS_INLINE Varying<T> load_rect(const T* base, std::ptrdiff_t pitch, int columns, int rows,
                                                   T outside) const {
    if (columns >= kColumns && rows >= kLanes / kColumns) return Varying<T>::template load_rows<kColumns>(base, pitch);
    alignas(64) T lanes[kLanes];
    for (int i = 0; i < kLanes; ++i) lanes[i] = outside;
    for (int r = 0; r < std::min(rows, kLanes / kColumns); ++r)
      std::copy_n(base + r * pitch, std::min(columns, kColumns), lanes + r * kColumns);
    return Varying<T>::load(lanes);
  }
  template <int kColumns, class T>
  LANGGS_INLINE void store_rect(T* base, std::ptrdiff_t pitch, int columns, int rows, const Varying<T>& v) const {
    if (columns >= kColumns && rows >= kLanes / kColumns) return v.template stream_rows<kColumns>(base, pitch);
    alignas(64) T lanes[kLanes];
    v.store(lanes);
    for (int r = 0; r < std::min(rows, kLanes / kColumns); ++r)
      std::copy_n(lanes + r * kColumns, std::min(columns, kColumns), base + r * pitch);
  }

 private:
  static LANGGS_INLINE Varying<float> whole_channels(const float* base) { return Varying<float>::load(base); }
  static LANGGS_INLINE Varying<float> whole_channels(const Half* base) { return load_half(base); }
  static LANGGS_INLINE void put_channels(float* base, const Varying<float>& v) { v.store(base); }
  static LANGGS_INLINE void put_channels(Half* base, const Varying<float>& v) { store_half(base, v); }

  int index_;
};

}  // namespace langgs::host
