// SPDX-License-Identifier: Apache-2.0
#pragma once

// Thrust chooses its device system by a macro for the whole translation unit; without nvcc only the host is possible.
#if !defined(THRUST_DEVICE_SYSTEM) && !defined(__CUDACC__)
#define THRUST_DEVICE_SYSTEM 4  // THRUST_DEVICE_SYSTEM_CPP
#endif
#include <thrust/sort.h>
#include <thrust/system/cpp/execution_policy.h>

#include <algorithm>
#include <cstdint>
#include <vector>

#include "langgs/host/backend.hpp"
#include "langgs/host/launch.hpp"

namespace langgs {

/// Stable ascending sort of `keys` [n] with their `values` [n]. Thrust's sequential sort is a radix sort for integers.
template <class Backend>
requires(std::is_same_v<Backend, Host> ||
         std::is_same_v<Backend, CheckedHost>) void sort_by_key(const Executor<Backend>&, std::uint32_t* keys,
                                                                std::int32_t* values, int n) {
  thrust::stable_sort_by_key(thrust::cpp::par, keys, keys + n, values);
}

/// offsets[i] = sum of counts[0..i), for i in [0, n]; returns offsets[n], the total.
template <class Backend>
requires(std::is_same_v<Backend, Host> ||
         std::is_same_v<Backend, CheckedHost>) int exclusive_scan(const Executor<Backend>&, const std::int32_t* counts,
                                                                  std::int32_t* offsets, int n) {
  std::int64_t total = 0;
  for (int i = 0; i < n; ++i) {
    offsets[i] = static_cast<std::int32_t>(total);
    total += counts[i];
    if (total > INT32_MAX) detail::raise<Error>("more than 2^31 items in a scan; render fewer Gaussians at once");
  }
  offsets[n] = static_cast<std::int32_t>(total);
  return static_cast<int>(total);
}

/// Writes the indices i in [0, n) with flags[i] != 0 to `selected`, ascending; returns how many.
template <class Backend>
requires(std::is_same_v<Backend, Host> ||
         std::is_same_v<Backend, CheckedHost>) int select_flagged(const Executor<Backend>&, const std::int32_t* flags,
                                                                  std::int32_t* selected, int n) {
  int count = 0;
  for (int i = 0; i < n; ++i) {
    selected[count] = i;  // branch-free: overwritten by the next index unless this one is wanted
    count += flags[i] != 0 ? 1 : 0;
  }
  return count;
}

/// Groups `values` [n] by their small keys in [0, num_keys), stably: group k is grouped[offsets[k] .. offsets[k + 1]).
/// A counting sort over chunks of fixed size; `scratch` is kept by the caller so that no memory is allocated per call.
template <class Backend>
requires(std::is_same_v<Backend, Host> || std::is_same_v<Backend, CheckedHost>) void group_by_key(
    const Executor<Backend>& executor, const std::uint32_t* keys, const std::int32_t* values, int n,
    std::int32_t* grouped, std::vector<std::int32_t>& offsets, int num_keys, std::vector<std::int32_t>& scratch) {
  constexpr int kNumChunks = 8;
  const int chunk = (n + kNumChunks - 1) / kNumChunks;
  offsets.resize(num_keys + 1);
  scratch.assign(static_cast<std::size_t>(kNumChunks) * num_keys, 0);
  executor.pool().run(kNumChunks, [&](int c) {
    std::int32_t* count = scratch.data() + static_cast<std::size_t>(c) * num_keys;
    for (int i = c * chunk; i < std::min(n, (c + 1) * chunk); ++i) ++count[keys[i]];
  });
  std::int32_t total = 0;
  for (int k = 0; k < num_keys; ++k) {
    offsets[k] = total;
    for (int c = 0; c < kNumChunks; ++c) {
      std::int32_t& slot = scratch[static_cast<std::size_t>(c) * num_keys + k];
      const std::int32_t count = slot;
      slot = total;
      total += count;
    }
  }
  offsets[num_keys] = total;
  executor.pool().run(kNumChunks, [&](int c) {
    std::int32_t* next = scratch.data() + static_cast<std::size_t>(c) * num_keys;
    for (int i = c * chunk; i < std::min(n, (c + 1) * chunk); ++i) grouped[next[keys[i]]++] = values[i];
  });
}

}  // namespace langgs
