// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <new>
#include <type_traits>

#include "langgs/core/error.hpp"
#include "langgs/host/worker_pool.hpp"

namespace langgs {

/// Backend tag: kernels run on the CPU, one worker thread a block, 32 lanes as SIMD vectors.
struct Host {
  static constexpr bool kChecked = false;
};

/// The host with its races made visible: execution orders can be changed and a missing `sync` is an Error. Slow.
struct CheckedHost {
  static constexpr bool kChecked = true;
};

/// In which order a checked host runs the blocks of a launch, the warps of a block and the threads of a phase.
enum class ExecutionOrder { ascending, descending, shuffled };

/// What a launch runs on: for the host, a pool of worker threads. Results never depend on the number of threads.
template <class Backend>
class Executor;

namespace detail {

template <class Backend>
concept HostBackend = std::is_same_v<Backend, Host> || std::is_same_v<Backend, CheckedHost>;

class HostExecutor {
 public:
  explicit HostExecutor(int num_threads = 1) : pool_(std::make_unique<WorkerPool>(num_threads)) {}
  [[nodiscard]] WorkerPool& pool() const { return *pool_; }
  [[nodiscard]] int num_threads() const { return pool_->num_threads(); }
  /// For code that runs on any backend: here a launch returns when its kernel has run.
  void synchronize() const {}
  /// To be said by another thread before it uses the executor.
  void make_current() const {}

 private:
  std::unique_ptr<WorkerPool> pool_;
};

/// Memory of T, aligned to a cache line and padded so that a 32-lane access beginning at any element stays inside.
template <class T>
struct HostMemory {
  static constexpr std::size_t kAlignment = 64;
  static constexpr std::size_t kPadding = 32;

  [[nodiscard]] static T* allocate(std::size_t count) {
    if (count > (std::size_t{1} << 46) / sizeof(T)) raise<InvalidArgument>("buffer of ", count, " elements asked for");
    return static_cast<T*>(::operator new ((count + kPadding) * sizeof(T), std::align_val_t{kAlignment}));
  }
  static void release(T* pointer) { ::operator delete (pointer, std::align_val_t{kAlignment}); }
};

}  // namespace detail

template <>
class Executor<Host> : public detail::HostExecutor {
  using HostExecutor::HostExecutor;
};

template <>
class Executor<CheckedHost> : public detail::HostExecutor {
 public:
  using HostExecutor::HostExecutor;
  ExecutionOrder order = ExecutionOrder::ascending;
  std::uint64_t seed = 0;  ///< of the shuffled order
};

/// An executor for work of one's own: on the host of `num_threads` worker threads, elsewhere a stream.
template <detail::HostBackend Backend>
[[nodiscard]] Executor<Backend> make_executor(int num_threads) {
  return Executor<Backend>(num_threads);
}

}  // namespace langgs
