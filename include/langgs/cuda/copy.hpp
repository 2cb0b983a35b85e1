// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "langgs/cuda/buffer.hpp"

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

template <class T>
void copy_within(const Executor<Cuda>& executor, const T* from, std::size_t n, T* to) {
  detail::check_cuda(cudaMemcpyAsync(to, from, n * sizeof(T), cudaMemcpyDeviceToDevice, executor.stream()), "copying ",
                     n * sizeof(T), " bytes on the device");
}
/// Zeros of T are zero bytes.
template <class T>
void set_zero(const Executor<Cuda>& executor, T* to, std::size_t n) {
  if (n > 0) detail::check_cuda(cudaMemsetAsync(to, 0, n * sizeof(T), executor.stream()), "zeroing device memory");
}

namespace detail {

template <class T>
struct TakeRows {
  const T* rows;
  const std::int32_t* which;
  int width;
  T* to;
  LANGGS_HD void operator()(int i) const {
    to[i] = rows[static_cast<std::ptrdiff_t>(which[i / width]) * width + i % width];
  }
};

}  // namespace detail

/// By way of the executor's workspace, a piece of at most `elements` after the other: no row has moved to a place that
/// a later one is still read from, since kept[i] >= i.
template <class T>
void keep_rows(const Executor<Cuda>& executor, T* rows, int width, const std::int32_t* kept, int n,
               int elements = 1 << 24) {
  const int at_once = std::min(n, std::max(1, elements / width));
  for (int first = 0; first < n; first += at_once) {
    const int count = std::min(at_once, n - first) * width;
    auto* const taken = static_cast<T*>(executor.workspace(count * sizeof(T)));
    for_each_n(executor, count, detail::TakeRows<T>{rows, kept + first, width, taken});
    copy_within(executor, taken, count, rows + static_cast<std::ptrdiff_t>(first) * width);
  }
}
template <class T, class Write>
void write_from_host(const Executor<Cuda>& executor, T* to, std::size_t n, const Write& write) {
  std::vector<T> values(n);
  write(values.data());
  copy_from_host(executor, values.data(), n, to);
}
/// Waits for the stream.
template <class T, class Compute>
void compute_to_host(const Executor<Cuda>& executor, T* to, std::size_t n, const Compute& compute) {
  Buffer<T, Cuda> values(executor, n);
  compute(values.data());
  copy_to_host(executor, values.data(), n, to);
}

template <class T, class Backend>
class Upload;

/// A copy in device memory, reused from call to call.
template <class T>
class Upload<T, Cuda> {
 public:
  const T* operator()(const Executor<Cuda>& executor, const T* from, std::size_t n) {
    values_.resize_discard(executor, n);
    copy_from_host(executor, from, n, values_.data());
    return values_.data();
  }
  [[nodiscard]] std::size_t bytes() const { return values_.bytes(); }

 private:
  Buffer<T, Cuda> values_;
};

template <class T, class Backend>
class Download;

/// A copy on the host, reused from call to call.
template <class T>
class Download<T, Cuda> {
 public:
  const T* operator()(const Executor<Cuda>& executor, const T* from, std::size_t n) {
    values_.resize(n);
    copy_to_host(executor, from, n, values_.data());
    return values_.data();
  }

 private:
  std::vector<T> values_;
};

template <class T, class Backend>
class Readback;

/// Copies into page-locked memory in stream order. May be captured in a graph: from then on `values` are those of the
/// last launch on the executor, and since nobody says when that was, they wait for the whole stream.
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
    copied_.swap(other.copied_);
    std::swap(is_captured_, other.is_captured_);
  }

  void start(const Executor<Cuda>& executor, const T* from, std::size_t n) {
    if (n > values_.size()) wait();  // a copy into the memory that is about to go may be under way
    if (n != values_.size()) values_.resize_discard(n);
    executor_ = executor;
    detail::check_cuda(cudaMemcpyAsync(values_.data(), from, n * sizeof(T), cudaMemcpyDeviceToHost, executor.stream()),
                       "copying ", n * sizeof(T), " bytes to the host");
    is_captured_ = is_captured_ || executor.is_capturing();
    if (is_captured_) return;
    if (!copied_) copied_.emplace();
    copied_->record(executor.stream());
  }
  [[nodiscard]] std::size_t size() const { return values_.size(); }
  /// Waits for the copy, and not for what came after it. Throws DeviceError if work before it failed.
  [[nodiscard]] const T* values() const {
    wait();
    return values_.data();
  }

 private:
  void wait() const {
    if (is_captured_)
      executor_->synchronize();
    else if (copied_)
      executor_->wait(*copied_);
  }
  std::optional<Executor<Cuda>> executor_;
  gpu::PinnedBuffer<T> values_;
  std::optional<gpu::Event> copied_;
  bool is_captured_ = false;
};

}  // namespace langgs
