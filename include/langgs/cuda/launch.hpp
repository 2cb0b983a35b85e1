// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string>
#include <type_traits>

#include "langgs/cuda/backend.hpp"
#include "langgs/cuda/block.hpp"
#include "langgs/device/list_size.hpp"

namespace langgs {
namespace detail {

/// Threads of a block in element-wise loops.
inline constexpr int kElementsPerBlock = 128;
/// What a block may have without asking the driver for more.
inline constexpr std::size_t kMaxSharedBytes = 48 * 1024;

// One block a multiprocessor is asked for: left to guess, ptxas lowers the registers for occupancy until some spill.
template <class Kernel>
__global__ void __launch_bounds__(Kernel::kThreads, 1) run_blocks(const Kernel kernel) {
  using Block = gpu::Block<Kernel::kThreads>;
  using Shared = typename Kernel::template Shared<Block>;
  static_assert(sizeof(Shared) <= kMaxSharedBytes, "a kernel's Shared must fit 48 KiB; make its batches smaller");
  __shared__ Shared shared;
  Block block;
  kernel(block, shared);
}

template <class Body>
__global__ void __launch_bounds__(kElementsPerBlock) run_lanes(const Body body, const ListSize size) {
  const int i = static_cast<int>(blockIdx.x * kElementsPerBlock + threadIdx.x);
  if (i < size.get()) body(gpu::Lanes(i));
}

template <class Body>
__global__ void __launch_bounds__(kElementsPerBlock) run_elements(const Body body, const ListSize size) {
  const int i = static_cast<int>(blockIdx.x * kElementsPerBlock + threadIdx.x);
  if (i < size.get()) body(i);
}

/// The name of T as the compiler spells it.
template <class T>
[[nodiscard]] std::string type_name() {
  const std::string text = __PRETTY_FUNCTION__;
  const std::size_t begin = text.find("T = ");
  return begin == std::string::npos ? text : text.substr(begin + 4, text.find_first_of(";]", begin) - begin - 4);
}

/// Launches `function(arguments...)` and names `Kernel` in the error.
template <class Kernel, class... Arguments>
void launch_cuda(const Executor<Cuda>& executor, void (*function)(Arguments...), int num_blocks, int num_threads,
                 std::type_identity_t<Arguments>... arguments) {
  static_assert(std::is_trivially_copyable_v<Kernel>, "a kernel is copied to the device as bytes");
  LANGGS_EXPECTS(num_blocks >= 0, "launch of ", type_name<Kernel>(), " with ", num_blocks, " blocks");
  if (num_blocks == 0) return;
  void* pointers[] = {const_cast<void*>(static_cast<const void*>(&arguments))...};
  const cudaError_t status =
      cudaLaunchKernel(reinterpret_cast<const void*>(function), dim3(static_cast<unsigned>(num_blocks)),
                       dim3(static_cast<unsigned>(num_threads)), pointers, 0, executor.stream());
  if (status != cudaSuccess)
    check_cuda(status, "launch of ", type_name<Kernel>(), " with ", num_blocks, " blocks of ", num_threads, " threads");
  executor.launched(&type_name<Kernel>, num_blocks, num_threads);
}

[[nodiscard]] inline int num_element_blocks(int n) {
  LANGGS_EXPECTS(n >= 0, "a loop over ", n, " elements");
  return n / kElementsPerBlock + (n % kElementsPerBlock != 0 ? 1 : 0);
}

}  // namespace detail

/// Runs `kernel(block, shared)` for `num_blocks` blocks of Kernel::kThreads threads, in any order.
template <class Kernel>
void launch(const Executor<Cuda>& executor, int num_blocks, const Kernel& kernel) {
  detail::launch_cuda<Kernel>(executor, &detail::run_blocks<Kernel>, num_blocks, Kernel::kThreads, kernel);
}

/// Calls `body(lanes)` for each element of [0, size), one thread an element.
template <class Body>
void for_each_lanes(const Executor<Cuda>& executor, const ListSize& size, const Body& body) {
  detail::launch_cuda<Body>(executor, &detail::run_lanes<Body>, detail::num_element_blocks(size.most),
                            detail::kElementsPerBlock, body, size);
}

/// Calls `body(i)` for each i in [0, size).
template <class Body>
void for_each_n(const Executor<Cuda>& executor, const ListSize& size, const Body& body) {
  detail::launch_cuda<Body>(executor, &detail::run_elements<Body>, detail::num_element_blocks(size.most),
                            detail::kElementsPerBlock, body, size);
}

}  // namespace langgs
