// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

#include "langgs/device/algorithm.hpp"
#include "langgs/device/list_size.hpp"

#if defined(__CUDACC__)
#include "langgs/cuda/counted_lists.hpp"
#endif

namespace langgs {

/// N lists that begin with counts: how many entries each of n elements has, and so where they begin. What comes next
/// need not wait until the host knows how long the lists are; on the host, it knows at once.
template <class Backend, std::size_t N>
class CountedLists {
 public:
  /// scans[k].offsets[i] = sum of scans[k].counts[0..i), for i in [0, n]: where the entries of element i begin in list
  /// k.
  void scan(const Executor<Backend>& executor, const CountsAndOffsets (&scans)[N], int n) {
    for (std::size_t k = 0; k < N; ++k) sizes_[k] = exclusive_scan(executor, scans[k].counts, scans[k].offsets, n);
  }
  /// Whether what worked with the lists since `scan` had room for them. Elsewhere than here this waits for the counts,
  /// and where there was none makes room: all lists were empty then, for whoever reads their sizes from the device.
  /// Throws Error for more than 2^31 - 1 entries.
  [[nodiscard]] bool fits() { return true; }
  /// To be said before the sizes are used.
  void begin(const Executor<Backend>&) {}
  /// Of list k.
  [[nodiscard]] ListSize operator[](std::size_t k) const { return sizes_[k]; }

 private:
  int sizes_[N] = {};
};

}  // namespace langgs
