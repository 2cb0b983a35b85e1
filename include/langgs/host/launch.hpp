// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>

#include "langgs/device/list_size.hpp"
#include "langgs/host/backend.hpp"
#include "langgs/host/block.hpp"

namespace langgs {
namespace detail {

[[nodiscard]] inline host::Permutation permutation(const Executor<Host>&) { return {}; }
[[nodiscard]] inline host::Permutation permutation(const Executor<CheckedHost>& executor) {
  return {executor.order, executor.seed};
}

/// Elements per task of element-wise loops: fixed, so that reductions by task never depend on the thread count.
inline constexpr int kElementsPerTask = 1024;

}  // namespace detail

/// Runs `kernel(block, shared)` for `num_blocks` blocks of Kernel::kThreads threads, in any order.
template <class Backend, class Kernel>
void launch(const Executor<Backend>& executor, int num_blocks, const Kernel& kernel) {
  using Block = host::Block<Kernel::kThreads, Backend>;
  const host::Permutation order = detail::permutation(executor);
  executor.pool().run(num_blocks, [&](int i) {
    Block block(order(i, num_blocks), order);
    typename Kernel::template Shared<Block> shared;
    kernel(block, shared);
  });
}

/// Calls `body(lanes)` for consecutive groups of up to 32 elements of [0, size).
template <class Backend, class Body>
void for_each_lanes(const Executor<Backend>& executor, const ListSize& size, const Body& body) {
  const int n = size.most;
  const int num_tasks = (n + detail::kElementsPerTask - 1) / detail::kElementsPerTask;
  const host::Permutation order = detail::permutation(executor);
  executor.pool().run(num_tasks, [&](int i) {
    const int task = order(i, num_tasks);
    const int end = std::min(n, (task + 1) * detail::kElementsPerTask);
    for (int first = task * detail::kElementsPerTask; first < end; first += host::kLanes)
      body(host::Lanes(first, std::min(host::kLanes, end - first)));
  });
}

/// Calls `body(i)` for each i in [0, size).
template <class Backend, class Body>
void for_each_n(const Executor<Backend>& executor, const ListSize& size, const Body& body) {
  const int n = size.most;
  const int num_tasks = (n + detail::kElementsPerTask - 1) / detail::kElementsPerTask;
  const host::Permutation order = detail::permutation(executor);
  executor.pool().run(num_tasks, [&](int i) {
    const int task = order(i, num_tasks);
    const int end = std::min(n, (task + 1) * detail::kElementsPerTask);
    for (int element = task * detail::kElementsPerTask; element < end; ++element) body(element);
  });
}

}  // namespace langgs
