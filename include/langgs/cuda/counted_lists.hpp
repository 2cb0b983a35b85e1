// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "langgs/cuda/algorithm.hpp"
#include "langgs/cuda/copy.hpp"
#include "langgs/device/list_size.hpp"

/// @file The CUDA twin of device/counted_lists.hpp.

namespace langgs {
namespace detail {

/// The sizes of lists as kernels see them: zero for all if there is no room for one.
template <std::size_t N>
struct AdmitLists {
  const std::int64_t* totals;  ///< [N]
  int room[N];
  std::int32_t* sizes;  ///< [N]
  LANGGS_HD void operator()(int) const {
    bool fit = true;
    for (std::size_t k = 0; k < N; ++k) fit = fit && totals[k] <= room[k];
    for (std::size_t k = 0; k < N; ++k) sizes[k] = fit ? static_cast<std::int32_t>(totals[k]) : 0;
  }
};

}  // namespace detail

template <class Backend, std::size_t N>
class CountedLists;

/// Until the host has asked, lists have the room that the largest so far needed, with a quarter to spare.
template <std::size_t N>
class CountedLists<Cuda, N> {
 public:
  void scan(const Executor<Cuda>& executor, const CountsAndOffsets (&scans)[N], int n) {
    totals_.resize_discard(executor, N);
    sizes_.resize_discard(executor, N);
    for (std::size_t k = 0; k < N; ++k) (void)detail::start_scan(executor, scans[k], n, totals_.data() + k);
    read_totals_.start(executor, totals_.data(), N);
    is_known_ = false;
  }
  /// Waits for `scan`, and not for what came after it. Asked again, answers for what was begun in the meantime: true.
  [[nodiscard]] bool fits() {
    if (is_known_) return true;
    const std::int64_t* const totals = read_totals_.values();
    bool fit = true;
    for (std::size_t k = 0; k < N; ++k) {
      known_[k] = detail::checked_total(totals[k]);
      if (known_[k] <= room_[k]) continue;
      fit = false;
      room_[k] = static_cast<int>(std::min<std::int64_t>(INT32_MAX, std::int64_t{known_[k]} + known_[k] / 4));
    }
    is_known_ = true;
    return fit;
  }
  void begin(const Executor<Cuda>& executor) {
    if (is_known_) return;
    detail::AdmitLists<N> admit{totals_.data(), {}, sizes_.data()};
    std::copy_n(room_, N, admit.room);
    for_each_n(executor, 1, admit);
  }
  [[nodiscard]] ListSize operator[](std::size_t k) const {
    return is_known_ ? ListSize(known_[k]) : ListSize(room_[k], sizes_.data() + k);
  }

 private:
  Buffer<std::int64_t, Cuda> totals_;
  Buffer<std::int32_t, Cuda> sizes_;
  Readback<std::int64_t, Cuda> read_totals_;
  int room_[N] = {}, known_[N] = {};
  bool is_known_ = true;  ///< of lists that were never scanned: empty
};

}  // namespace langgs
