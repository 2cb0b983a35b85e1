// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <thrust/iterator/counting_iterator.h>
#include <thrust/iterator/tabulate_output_iterator.h>
#include <thrust/iterator/transform_iterator.h>

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cub/device/device_radix_sort.cuh>
#include <cub/device/device_scan.cuh>
#include <cub/device/device_segmented_reduce.cuh>
#include <cub/device/device_select.cuh>

#include "langgs/cuda/buffer.hpp"
#include "langgs/cuda/copy.hpp"
#include "langgs/device/key_value.hpp"
#include "langgs/device/list_size.hpp"

/// @file The CUDA twin of host/algorithm.hpp, by CUB. Templates, so that a file which calls none of them does not
/// compile CUB's kernels. All pointers are to device memory. What returns a number waits for the stream; nothing else
/// does.

namespace langgs {

/// Sorting takes what it needs from the executor's workspace.
template <>
struct SortScratch<Cuda> {};

namespace detail {

/// Sizes of the parts of a workspace, each aligned as device memory is.
[[nodiscard]] inline std::size_t part_bytes(std::size_t bytes) { return (bytes + 255) / 256 * 256; }

/// Runs a CUB algorithm: `call(temporary, bytes, own)` with a null `temporary` asks for bytes, then works. `own` is
/// memory of `own_bytes` for the caller; all of it is in the executor's workspace. Returns `own`.
template <class Call>
std::byte* run_cub(const Executor<Cuda>& executor, const char* what, std::size_t own_bytes, const Call& call) {
  std::size_t bytes = 0;
  check_cuda(call(nullptr, bytes, nullptr), "asking for the workspace of ", what);
  auto* own = static_cast<std::byte*>(executor.workspace(part_bytes(own_bytes) + std::max<std::size_t>(bytes, 1)));
  check_cuda(call(own + part_bytes(own_bytes), bytes, own), what);
  return own;
}

/// counts[i], and 0 behind the last of them, so that an exclusive scan ends with the total.
struct CountOrZero {
  const std::int32_t* counts;
  int n;
  LANGGS_HD std::int64_t operator()(int i) const { return i < n ? counts[i] : 0; }
};
struct PutOffset {
  std::int32_t* offsets;
  std::int64_t* total;
  int n;
  LANGGS_HD void operator()(std::int64_t i, std::int64_t sum) const {
    offsets[i] = static_cast<std::int32_t>(sum);
    if (i == n) *total = sum;
  }
};

struct SizeOfGroup {
  const std::int32_t *which, *begin;
  ListSize size;
  LANGGS_HD std::int32_t operator()(int i) const { return i < size.get() ? begin[which[i] + 1] - begin[which[i]] : 0; }
};
struct PutGroupOffset {
  const std::int32_t* which;
  std::int32_t* offsets;
  ListSize size;
  LANGGS_HD void operator()(std::int64_t i, std::int32_t sum) const {
    if (i < size.get()) offsets[which[i]] = sum;
  }
};

struct ToDouble {
  LANGGS_HD double operator()(float value) const { return static_cast<double>(value); }
};
/// Where the pieces of rows begin, or end: rows are cut into as many pieces of kSize elements as they need.
struct RowPiece {
  static constexpr int kSize = 4096;
  std::ptrdiff_t stride;
  ListSize size;
  int pieces, shift;  ///< shift: 0 for the begin, 1 for the end
  LANGGS_HD std::ptrdiff_t operator()(int piece) const {
    const std::int64_t first = (piece % pieces + shift) * static_cast<std::int64_t>(kSize);
    const int n = size.get();
    return piece / pieces * stride + (first < n ? first : n);
  }
};
struct TimesPieces {
  int pieces;
  LANGGS_HD int operator()(int row) const { return row * pieces; }
};

/// offsets[k] = how many of the n sorted keys are smaller than k.
template <class Item>
struct FindGroups {
  const Item* sorted;
  int n;
  std::int32_t* offsets;
  LANGGS_HD void operator()(int k) const {
    int first = 0, last = n;
    while (first < last) {
      const int middle = first + (last - first) / 2;
      if (key(sorted[middle]) < static_cast<std::uint32_t>(k))
        first = middle + 1;
      else
        last = middle;
    }
    offsets[k] = first;
  }

 private:
  LANGGS_HD static std::uint32_t key(std::uint32_t item) { return item; }
  LANGGS_HD static std::uint32_t key(const KeyValue& item) { return item.key; }
};
struct TakeValues {
  const KeyValue* pairs;
  std::int32_t* values;
  LANGGS_HD void operator()(int i) const { values[i] = pairs[i].value; }
};

/// Gives what follows the last element of a list a key that is larger than any, so that it stays behind when sorted: in
/// place, or in a copy.
template <class Item>
struct EndList {
  ListSize size;
  const Item* items;
  Item* ended;
  Item largest;
  LANGGS_HD void operator()(int i) const {
    if (i >= size.get())
      ended[i] = largest;
    else if (ended != items)
      ended[i] = items[i];
  }
};

/// Bits of the keys 0 .. num_keys - 1, at least one.
[[nodiscard]] inline int key_bits(int num_keys) {
  return std::max(1, static_cast<int>(std::bit_width(static_cast<unsigned>(num_keys - 1))));
}

template <class Function>
[[nodiscard]] auto indexed(Function function) {
  return thrust::make_transform_iterator(thrust::counting_iterator<int>(0), function);
}

}  // namespace detail

template <detail::CudaBackend Backend>
void sort_by_key(const Executor<Backend>& executor, std::uint32_t* keys, std::int32_t* values, const ListSize& size,
                 SortScratch<Cuda>&) {
  const int n = size.most;
  if (n == 0) return;
  if (size.exact != nullptr) for_each_n(executor, n, detail::EndList<std::uint32_t>{size, keys, keys, UINT32_MAX});
  const std::size_t bytes = static_cast<std::size_t>(n) * 4, part = detail::part_bytes(bytes);
  cub::DoubleBuffer<std::uint32_t> sorted_keys;
  cub::DoubleBuffer<std::int32_t> sorted_values;
  detail::run_cub(executor, "sort_by_key", 2 * part,
                  [&](void* temporary, std::size_t& temporary_bytes, std::byte* own) {
                    sorted_keys = {keys, reinterpret_cast<std::uint32_t*>(own)};
                    sorted_values = {values, reinterpret_cast<std::int32_t*>(own + part)};
                    return cub::DeviceRadixSort::SortPairs(temporary, temporary_bytes, sorted_keys, sorted_values, n, 0,
                                                           32, executor.stream());
                  });
  const auto bring = [&](void* to, const void* from) {
    if (from != to)
      detail::check_cuda(cudaMemcpyAsync(to, from, bytes, cudaMemcpyDeviceToDevice, executor.stream()), "sort_by_key");
  };
  bring(keys, sorted_keys.Current());
  bring(values, sorted_values.Current());
}

namespace detail {

/// An exclusive scan, for whose total nobody waits: it is left at `total`, or where that is null in the workspace.
/// Returns where.
template <CudaBackend Backend>
const std::int64_t* start_scan(const Executor<Backend>& executor, const CountsAndOffsets& scan, int n,
                               std::int64_t* total = nullptr) {
  const auto place = [&](std::byte* own) { return total != nullptr ? total : reinterpret_cast<std::int64_t*>(own); };
  return place(run_cub(executor, "exclusive_scan", sizeof(std::int64_t),
                       [&](void* temporary, std::size_t& temporary_bytes, std::byte* own) {
                         return cub::DeviceScan::ExclusiveSum(
                             temporary, temporary_bytes, indexed(CountOrZero{scan.counts, n}),
                             thrust::make_tabulate_output_iterator(PutOffset{scan.offsets, place(own), n}), n + 1,
                             executor.stream());
                       }));
}
[[nodiscard]] inline int checked_total(std::int64_t total) {
  if (total > INT32_MAX) raise<Error>("more than 2^31 items in a scan; render fewer Gaussians at once");
  return static_cast<int>(total);
}

}  // namespace detail

/// Waits for the stream.
template <detail::CudaBackend Backend>
int exclusive_scan(const Executor<Backend>& executor, const std::int32_t* counts, std::int32_t* offsets, int n) {
  std::int64_t total = 0;
  copy_to_host(executor, detail::start_scan(executor, {counts, offsets}, n), 1, &total);
  return detail::checked_total(total);
}

template <detail::CudaBackend Backend>
ListSize list_size(const Executor<Backend>&, const std::int32_t* exact, int most) {
  return {most, exact};
}

template <detail::CudaBackend Backend>
ListSize exclusive_scan(const Executor<Backend>& executor, const std::int32_t* counts, std::int32_t* offsets, int n,
                        int most) {
  (void)detail::start_scan(executor, {counts, offsets}, n);
  return list_size(executor, offsets + n, most);
}

template <detail::CudaBackend Backend>
void scan_in_order(const Executor<Backend>& executor, const std::int32_t* which, const std::int32_t* begin,
                   std::int32_t* offsets, const ListSize& size) {
  detail::run_cub(executor, "scan_in_order", 0, [&](void* temporary, std::size_t& temporary_bytes, std::byte*) {
    return cub::DeviceScan::ExclusiveSum(
        temporary, temporary_bytes, detail::indexed(detail::SizeOfGroup{which, begin, size}),
        thrust::make_tabulate_output_iterator(detail::PutGroupOffset{which, offsets, size}), size.most,
        executor.stream());
  });
}

/// Waits for the stream.
template <detail::CudaBackend Backend>
int select_flagged(const Executor<Backend>& executor, const std::int32_t* flags, std::int32_t* selected, int n) {
  const std::byte* const count = detail::run_cub(
      executor, "select_flagged", sizeof(std::int32_t),
      [&](void* temporary, std::size_t& temporary_bytes, std::byte* own) {
        return cub::DeviceSelect::Flagged(temporary, temporary_bytes, thrust::counting_iterator<std::int32_t>(0), flags,
                                          selected, reinterpret_cast<std::int32_t*>(own), n, executor.stream());
      });
  std::int32_t result = 0;
  copy_to_host(executor, reinterpret_cast<const std::int32_t*>(count), 1, &result);
  return result;
}

/// Long rows are summed piece by piece, and then the pieces.
template <detail::CudaBackend Backend>
void sum_rows(const Executor<Backend>& executor, const float* rows, std::ptrdiff_t stride, const ListSize& size,
              int num_rows, double* sums) {
  const int pieces = std::max(1, (size.most + detail::RowPiece::kSize - 1) / detail::RowPiece::kSize);
  const auto values = thrust::make_transform_iterator(rows, detail::ToDouble{});
  detail::run_cub(executor, "sum_rows", static_cast<std::size_t>(pieces) * num_rows * sizeof(double),
                  [&](void* temporary, std::size_t& temporary_bytes, std::byte* own) {
                    auto* const parts = reinterpret_cast<double*>(own);
                    std::size_t first_bytes = temporary_bytes, second_bytes = temporary_bytes;
                    const cudaError_t status = cub::DeviceSegmentedReduce::Sum(
                        temporary, first_bytes, values, parts, pieces * num_rows,
                        detail::indexed(detail::RowPiece{stride, size, pieces, 0}),
                        detail::indexed(detail::RowPiece{stride, size, pieces, 1}), executor.stream());
                    if (status != cudaSuccess) return status;
                    const auto begin = detail::indexed(detail::TimesPieces{pieces});
                    const cudaError_t second = cub::DeviceSegmentedReduce::Sum(
                        temporary, second_bytes, parts, sums, num_rows, begin, begin + 1, executor.stream());
                    temporary_bytes = std::max(first_bytes, second_bytes);
                    return second;
                  });
}

template <class T, detail::CudaBackend Backend>
void group_by_key(const Executor<Backend>& executor, const std::uint32_t* keys, const T* values, const ListSize& size,
                  T* grouped, Buffer<std::int32_t, Cuda>& offsets, int num_keys, SortScratch<Cuda>&) {
  const int n = size.most;
  const bool is_known = size.exact == nullptr;
  const std::size_t part = detail::part_bytes(static_cast<std::size_t>(n) * 4);
  offsets.resize_discard(executor, static_cast<std::size_t>(num_keys) + 1);
  const std::byte* const sorted = detail::run_cub(
      executor, "group_by_key", is_known ? part : 2 * part,
      [&](void* temporary, std::size_t& temporary_bytes, std::byte* own) {
        auto* const ended = reinterpret_cast<std::uint32_t*>(own + part);
        if (!is_known && temporary != nullptr)
          for_each_n(executor, n,
                     detail::EndList<std::uint32_t>{size, keys, ended, static_cast<std::uint32_t>(num_keys)});
        return cub::DeviceRadixSort::SortPairs(temporary, temporary_bytes, is_known ? keys : ended,
                                               reinterpret_cast<std::uint32_t*>(own), values, grouped, n, 0,
                                               detail::key_bits(is_known ? num_keys : num_keys + 1), executor.stream());
      });
  for_each_n(executor, num_keys + 1,
             detail::FindGroups<std::uint32_t>{reinterpret_cast<const std::uint32_t*>(sorted), n, offsets.data()});
}

template <detail::CudaBackend Backend>
void group_by_key(const Executor<Backend>& executor, KeyValue* pairs, const ListSize& size, std::int32_t* grouped,
                  Buffer<std::int32_t, Cuda>& offsets, int num_keys, SortScratch<Cuda>&) {
  const int n = size.most;
  // A pair is sorted as one number, by the bits of its key, which are its lowest.
  static_assert(sizeof(KeyValue) == sizeof(std::uint64_t) && offsetof(KeyValue, key) == 0);
  offsets.resize_discard(executor, static_cast<std::size_t>(num_keys) + 1);
  // One key more than there are groups, for what follows the last pair.
  if (size.exact != nullptr)
    for_each_n(executor, n, detail::EndList<KeyValue>{size, pairs, pairs, {static_cast<std::uint32_t>(num_keys), 0}});
  const int bits = detail::key_bits(size.exact != nullptr ? num_keys + 1 : num_keys);
  cub::DoubleBuffer<std::uint64_t> sorted;
  detail::run_cub(executor, "group_by_key", static_cast<std::size_t>(n) * sizeof(KeyValue),
                  [&](void* temporary, std::size_t& temporary_bytes, std::byte* own) {
                    sorted = {reinterpret_cast<std::uint64_t*>(pairs), reinterpret_cast<std::uint64_t*>(own)};
                    return cub::DeviceRadixSort::SortKeys(temporary, temporary_bytes, sorted, n, 0, bits,
                                                          executor.stream());
                  });
  const auto* const result = reinterpret_cast<const KeyValue*>(sorted.Current());
  for_each_n(executor, size, detail::TakeValues{result, grouped});
  for_each_n(executor, num_keys + 1, detail::FindGroups<KeyValue>{result, n, offsets.data()});
}

}  // namespace langgs
