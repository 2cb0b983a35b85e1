// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>

#include "langgs/cuda/backend.hpp"

/// @file The CUDA twin of device/copy.hpp.

namespace langgs {

template <class T>
void copy_from_host(const Executor<Cuda>& executor, const T* from, std::size_t n, T* to) {
  // Pageable memory: the call returns when `from` has been read.
  detail::check_cuda(cudaMemcpyAsync(to, from, n * sizeof(T), cudaMemcpyHostToDevice, executor.stream()), "copying ",
                     n * sizeof(T), " bytes to the device");
}
/// Throws DeviceError if work on the executor's stream failed.
template <class T>
void copy_to_host(const Executor<Cuda>& executor, const T* from, std::size_t n, T* to) {
  detail::check_cuda(cudaMemcpyAsync(to, from, n * sizeof(T), cudaMemcpyDeviceToHost, executor.stream()), "copying ",
                     n * sizeof(T), " bytes to the host");
  executor.synchronize();
}

template <class T, class Backend>
class Readback;

/// Copies into page-locked memory in stream order. May be captured in a graph: then `values` are those of its last
/// launch on the executor.
template <class T>
class Readback<T, Cuda> {
 public:
  Readback() = default;
  Readback(Readback&& other) noexcept { swap(other); }
  Readback& operator=(Readback&& other) noexcept {
    swap(other);
    return *this;
  }
  ~Readback() {
    if (executor_) (void)cudaStreamSynchronize(executor_->stream());  // a copy into the memory may be under way
  }

  void swap(Readback& other) noexcept {
    executor_.swap(other.executor_);
    values_.swap(other.values_);
  }

  void start(const Executor<Cuda>& executor, const T* from, std::size_t n) {
    if (n > values_.size()) synchronize();  // a copy into the memory that is about to go may be under way
    if (n != values_.size()) values_.resize_discard(n);
    executor_ = executor;
    detail::check_cuda(cudaMemcpyAsync(values_.data(), from, n * sizeof(T), cudaMemcpyDeviceToHost, executor.stream()),
                       "copying ", n * sizeof(T), " bytes to the host");
  }
  [[nodiscard]] std::size_t size() const { return values_.size(); }
  /// Waits for the executor's stream. Throws DeviceError if its work failed.
  [[nodiscard]] const T* values() const {
    synchronize();
    return values_.data();
  }

 private:
  void synchronize() const {
    if (executor_) executor_->synchronize();
  }
  std::optional<Executor<Cuda>> executor_;
  gpu::PinnedBuffer<T> values_;
};

}  // namespace langgs
