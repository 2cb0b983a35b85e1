// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <utility>
#include <vector>

#include "langgs/device/copy.hpp"
#include "langgs/device/launch.hpp"

#if defined(__CUDACC__)
#include "cuda/device_array.hpp"
#endif

/// @file What a test needs to be written once and run on each backend. A file named *_test.inc is included by a shim of
/// the same name for each compiler: *_test.cpp beside it for the host, tests/cuda/*_test.cu for CUDA.

namespace langgs::test {

#if defined(__CUDACC__)

using TestBackend = Cuda;
inline constexpr int kThreadCounts[] = {1};
/// More than one tile of any algorithm; what runs CUDA without a GPU is slow.
inline constexpr int kManyItems = 12'000;
inline constexpr bool kIsSlow = true;
inline Executor<Cuda> test_executor(int = 1) { return Executor<Cuda>(gpu::Stream()); }
template <class T>
using Array = DeviceArray<T>;

#else

using TestBackend = Host;
inline constexpr int kThreadCounts[] = {1, 2, 5};
inline constexpr int kManyItems = 100'000;
inline constexpr bool kIsSlow = false;
inline Executor<Host> test_executor(int num_threads = 1) { return Executor<Host>(num_threads); }

/// A fixed array in the backend's memory.
template <class T>
class Array {
 public:
  explicit Array(std::size_t size) : values_(size) {}
  explicit Array(std::vector<T> values) : values_(std::move(values)) {}
  [[nodiscard]] T* data() const { return const_cast<T*>(values_.data()); }
  [[nodiscard]] const std::vector<T>& values() const { return values_; }

 private:
  std::vector<T> values_;
};

#endif

using TestExecutor = Executor<TestBackend>;

/// All of `cases`, or the first few where the backend is slow: put first what shows most.
template <class T, std::size_t N>
[[nodiscard]] std::span<const T> first_few(const T (&cases)[N], std::size_t few) {
  return {cases, kIsSlow ? few : N};
}

/// The host's copy of n values in the backend's memory.
template <class T>
[[nodiscard]] std::vector<T> fetch(const TestExecutor& executor, const T* from, std::size_t n) {
  std::vector<T> result(n);
  copy_to_host(executor, from, n, result.data());
  return result;
}

}  // namespace langgs::test
