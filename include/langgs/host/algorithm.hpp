// SPDX-License-Identifier: Apache-2.0
#pragma once

// Thrust chooses its device system by a macro for the whole translation unit; without nvcc only the host is possible.
#if !defined(THRUST_DEVICE_SYSTEM) && !defined(__CUDACC__)
#define THRUST_DEVICE_SYSTEM 4  // THRUST_DEVICE_SYSTEM_CPP
#endif
#include <thrust/sort.h>
#include <thrust/system/cpp/execution_policy.h>

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <new>
#include <utility>
#include <vector>

#include "langgs/device/buffer.hpp"
#include "langgs/device/key_value.hpp"
#include "langgs/device/list_size.hpp"
#include "langgs/host/backend.hpp"
#include "langgs/host/launch.hpp"

namespace langgs {

namespace detail {

/// A range cut into chunks that are worked on in parallel. For whole numbers alone: their sums and places do not depend
/// on where the cuts are.
class Chunks {
 public:
  static constexpr int kMost = 16;

  Chunks(int n, int num_threads) : n_(n), number_(std::min(num_threads, kMost)), size_((n + number_ - 1) / number_) {}
  [[nodiscard]] int number() const { return number_; }
  [[nodiscard]] int begin(int chunk) const { return std::min(n_, chunk * size_); }
  [[nodiscard]] int end(int chunk) const { return std::min(n_, (chunk + 1) * size_); }

 private:
  int n_, number_, size_;
};

/// Calls `put(i, sum of count_of(j) over j < i)` for each i in [0, n), and returns the sum of all.
template <class Backend, class CountOf, class Put>
int scan_counts(const Executor<Backend>& executor, int n, const CountOf& count_of, const Put& put) {
  const auto sweep = [&](int begin, int end, std::int64_t sum) {
    for (int i = begin; i < end; ++i) {
      const std::int32_t count = count_of(i);
      put(i, static_cast<std::int32_t>(sum));
      sum += count;
    }
    return sum;
  };
  std::int64_t total = 0;
  if (executor.num_threads() == 1) {  // one sweep instead of two
    total = sweep(0, n, 0);
  } else {
    const Chunks chunks(n, executor.num_threads());
    std::int64_t sums[Chunks::kMost] = {};
    executor.pool().run(chunks.number(), [&](int c) {
      std::int64_t sum = 0;
      for (int i = chunks.begin(c); i < chunks.end(c); ++i) sum += count_of(i);
      sums[c] = sum;
    });
    for (int c = 0; c < chunks.number(); ++c) total += std::exchange(sums[c], total);
    executor.pool().run(chunks.number(), [&](int c) { sweep(chunks.begin(c), chunks.end(c), sums[c]); });
  }
  if (total > INT32_MAX) raise<Error>("more than 2^31 items in a scan; render fewer Gaussians at once");
  return static_cast<int>(total);
}

/// A stable counting sort of [0, n) by the keys key_of(i) in [0, num_keys): calls `put(place, i)` for each i; group k
/// has the places offsets[k] .. offsets[k + 1].
template <class Backend, class KeyOf, class Put>
void group(const Executor<Backend>& executor, int n, int num_keys, const KeyOf& key_of, const Put& put,
           std::int32_t* offsets, std::vector<std::int32_t>& scratch) {
  const Chunks chunks(n, executor.num_threads());
  scratch.resize(static_cast<std::size_t>(chunks.number()) * num_keys);
  const auto row = [&](int c) { return scratch.data() + static_cast<std::size_t>(c) * num_keys; };
  executor.pool().run(chunks.number(), [&](int c) {
    std::int32_t* count = row(c);
    std::fill_n(count, num_keys, 0);
    for (int i = chunks.begin(c); i < chunks.end(c); ++i) ++count[key_of(i)];
  });
  std::int32_t total = 0;
  for (int k = 0; k < num_keys; ++k) {
    offsets[k] = total;
    for (int c = 0; c < chunks.number(); ++c) total += std::exchange(row(c)[k], total);
  }
  offsets[num_keys] = total;
  executor.pool().run(chunks.number(), [&](int c) {
    std::int32_t* next = row(c);
    for (int i = chunks.begin(c); i < chunks.end(c); ++i) put(next[key_of(i)]++, i);
  });
}

/// What Thrust takes its temporary memory from: a piece of memory front to back, then the heap.
class PieceAllocator {
 public:
  using value_type = char;

  PieceAllocator(void* begin, std::size_t bytes) : begin_(static_cast<char*>(begin)), end_(begin_ + bytes) {}
  [[nodiscard]] char* allocate(std::ptrdiff_t bytes) {
    if (end_ - begin_ < bytes) return static_cast<char*>(::operator new(static_cast<std::size_t>(bytes)));
    return std::exchange(begin_, begin_ + bytes);
  }
  void deallocate(char* pointer, std::size_t) {
    const std::less<const char*> before;
    if (before(pointer, first_) || !before(pointer, end_)) ::operator delete(pointer);
  }

 private:
  char* begin_;
  char* const end_;
  char* const first_ = begin_;
};

}  // namespace detail

/// Stable ascending sort of `keys` [n] with their `values` [n]. Thrust's sequential sort is a radix sort for integers;
/// several threads sort ranges of keys, which a counting sort has brought together.
template <detail::HostBackend Backend>
void sort_by_key(const Executor<Backend>& executor, std::uint32_t* keys, std::int32_t* values, const ListSize& size,
                 SortScratch<Backend>& scratch) {
  const int n = size.most;
  constexpr int kRangeBits = 8, kWorthRanges = 4096;
  scratch.pairs.resize(static_cast<std::size_t>(n));
  // Thrust asks for as many keys and values as it sorts.
  const auto sort = [&](int begin, int end) {
    detail::PieceAllocator memory(scratch.pairs.data() + begin,
                                  static_cast<std::size_t>(end - begin) * sizeof(KeyValue));
    thrust::stable_sort_by_key(thrust::cpp::par(memory), keys + begin, keys + end, values + begin);
  };
  // There is one stable order: how it was found does not show.
  if (executor.num_threads() == 1 || n < kWorthRanges) return sort(0, n);
  std::uint32_t first = keys[0], last = keys[0];
  for (int i = 1; i < n; ++i) {
    first = std::min(first, keys[i]);
    last = std::max(last, keys[i]);
  }
  const std::uint32_t span = last - first;
  const int shift = std::max(0, 32 - kRangeBits - std::countl_zero(span));  // at most 2^kRangeBits ranges
  const int num_ranges = static_cast<int>(span >> shift) + 1;
  scratch.offsets.resize(static_cast<std::size_t>(num_ranges) + 1);
  detail::group(
      executor, n, num_ranges, [&](int i) { return (keys[i] - first) >> shift; },
      [&](int place, int i) {
        scratch.pairs[place] = {keys[i], values[i]};
      },
      scratch.offsets.data(), scratch.counts);
  executor.pool().run(num_ranges, [&](int range) {
    const int begin = scratch.offsets[range], end = scratch.offsets[range + 1];
    for (int i = begin; i < end; ++i) {
      keys[i] = scratch.pairs[i].key;
      values[i] = scratch.pairs[i].value;
    }
    if (end - begin > 1) sort(begin, end);
  });
}

/// offsets[i] = sum of counts[0..i), for i in [0, n]; returns offsets[n], the total.
template <detail::HostBackend Backend>
int exclusive_scan(const Executor<Backend>& executor, const std::int32_t* counts, std::int32_t* offsets, int n) {
  return offsets[n] = detail::scan_counts(
             executor, n, [&](int i) { return counts[i]; }, [&](int i, std::int32_t sum) { offsets[i] = sum; });
}

/// A list's size as kernels read it from `exact`, in the backend's memory; known to be at most `most`. The host looks.
template <detail::HostBackend Backend>
ListSize list_size(const Executor<Backend>&, const std::int32_t* exact, int) {
  return *exact;
}

/// The scan for whose total nobody waits: it is known to be at most `most`.
template <detail::HostBackend Backend>
ListSize exclusive_scan(const Executor<Backend>& executor, const std::int32_t* counts, std::int32_t* offsets, int n,
                        int) {
  return exclusive_scan(executor, counts, offsets, n);
}

/// offsets[which[i]] = sum of the sizes of the groups which[j] over j < i, for i in [0, n): the place of each group
/// when they follow each other in the order of `which`. Group g has begin[g + 1] - begin[g] members. On one thread:
/// several that write all over `offsets` wait for each other's cache lines, and take twice as long.
template <detail::HostBackend Backend>
void scan_in_order(const Executor<Backend>&, const std::int32_t* which, const std::int32_t* begin,
                   std::int32_t* offsets, const ListSize& size) {
  const int n = size.most;
  std::int32_t next = 0;
  for (int i = 0; i < n; ++i) {
    offsets[which[i]] = next;
    next += begin[which[i] + 1] - begin[which[i]];
  }
}

/// Writes the indices i in [0, n) with flags[i] != 0 to `selected`, ascending; returns how many.
template <detail::HostBackend Backend>
int select_flagged(const Executor<Backend>&, const std::int32_t* flags, std::int32_t* selected, int n) {
  int count = 0;
  for (int i = 0; i < n; ++i) {
    selected[count] = i;  // branch-free: overwritten by the next index unless this one is wanted
    count += flags[i] != 0 ? 1 : 0;
  }
  return count;
}

/// sums[r] = the sum of the n values at rows + r * stride, for r in [0, num_rows), in the backend's memory. The order
/// of the additions depends on n alone.
template <detail::HostBackend Backend>
void sum_rows(const Executor<Backend>& executor, const float* rows, std::ptrdiff_t stride, const ListSize& size,
              int num_rows, double* sums) {
  const int n = size.most;
  executor.pool().run(num_rows, [&](int r) {
    constexpr int kPartialSums = 16;  // an addition waits for the one before
    const float* row = rows + r * stride;
    double partial[kPartialSums] = {}, sum = 0;
    int i = 0;
    for (; i + kPartialSums <= n; i += kPartialSums)
      for (int k = 0; k < kPartialSums; ++k) partial[k] += static_cast<double>(row[i + k]);
    for (; i < n; ++i) sum += static_cast<double>(row[i]);
    for (const double p : partial) sum += p;
    sums[r] = sum;
  });
}

/// Groups `values` [size] by their small keys in [0, num_keys), stably: group k is grouped[offsets[k] .. offsets[k +
/// 1]). `scratch` is kept by the caller so that no memory is allocated per call.
template <class T, detail::HostBackend Backend>
void group_by_key(const Executor<Backend>& executor, const std::uint32_t* keys, const T* values, const ListSize& size,
                  T* grouped, Buffer<std::int32_t, Backend>& offsets, int num_keys, SortScratch<Backend>& scratch) {
  offsets.resize_discard(executor, static_cast<std::size_t>(num_keys) + 1);
  detail::group(
      executor, size.most, num_keys, [&](int i) { return keys[i]; },
      [&](int place, int i) { grouped[place] = values[i]; }, offsets.data(), scratch.counts);
}

/// The same for keys with their values next to them, which may be overwritten.
template <detail::HostBackend Backend>
void group_by_key(const Executor<Backend>& executor, KeyValue* pairs, const ListSize& size, std::int32_t* grouped,
                  Buffer<std::int32_t, Backend>& offsets, int num_keys, SortScratch<Backend>& scratch) {
  const int n = size.most;
  offsets.resize_discard(executor, static_cast<std::size_t>(num_keys) + 1);
  detail::group(
      executor, n, num_keys, [&](int i) { return pairs[i].key; },
      [&](int place, int i) { grouped[place] = pairs[i].value; }, offsets.data(), scratch.counts);
}

}  // namespace langgs
