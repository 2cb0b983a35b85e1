// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <type_traits>
#include <utility>

#include "langgs/cuda/launch.hpp"
#include "langgs/device/growth.hpp"

/// @file The CUDA twin of device/buffer.hpp.

namespace langgs {
namespace detail {

template <class T>
struct FillElements {
  T* to;
  T value;
  LANGGS_HD void operator()(int i) const { to[i] = value; }
};

}  // namespace detail

template <class T, class Backend>
class Buffer;

/// A move-only array in the memory of an Executor<Cuda>. It is given back in the order of the stream on which it was
/// last resized: whoever uses it on another stream makes that stream's work come first.
template <class T>
class Buffer<T, Cuda> {
  static_assert(std::is_trivially_copyable_v<T>, "a Buffer holds values that can be copied as bytes");

 public:
  Buffer() = default;
  Buffer(const Executor<Cuda>& executor, std::size_t size) { resize_discard(executor, size); }
  Buffer(Buffer&& other) noexcept { swap(other); }
  Buffer& operator=(Buffer&& other) noexcept {
    swap(other);
    return *this;
  }
  ~Buffer() {
    if (data_ != nullptr) executor_->memory()->release(data_, allocated_bytes(), executor_->stream());
  }

  void swap(Buffer& other) noexcept {
    executor_.swap(other.executor_);
    std::swap(data_, other.data_);
    std::swap(size_, other.size_);
    std::swap(capacity_, other.capacity_);
  }

  /// Changes the size; the old contents are lost. Allocates only when the size exceeds every size before.
  /// Throws InvalidArgument, DeviceError.
  void resize_discard(const Executor<Cuda>& executor, std::size_t size) {
    if (size > capacity_) {
      Buffer fresh;
      fresh.allocate(executor, std::max(size, capacity_ + capacity_ / 2));
      swap(fresh);
    }
    size_ = size;
  }
  /// Changes the size and keeps the first min(old, new) elements. Throws InvalidArgument, DeviceError.
  void resize_keep(const Executor<Cuda>& executor, std::size_t size) {
    if (size > capacity_) {
      Buffer grown;
      grown.allocate(executor, grown_capacity(size));
      if (size_ > 0)
        detail::check_cuda(
            cudaMemcpyAsync(grown.data_, data_, size_ * sizeof(T), cudaMemcpyDeviceToDevice, executor.stream()),
            "copying ", size_ * sizeof(T), " bytes on the device");
      swap(grown);
    }
    size_ = size;
  }
  void fill(const Executor<Cuda>& executor, T value) {
    LANGGS_EXPECTS(size_ <= INT32_MAX, "a buffer of ", size_, " elements is filled; at most 2^31 - 1 can be");
    for_each_n(executor, static_cast<int>(size_), detail::FillElements<T>{data_, value});
  }

  [[nodiscard]] T* data() { return data_; }
  [[nodiscard]] const T* data() const { return data_; }
  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] std::size_t bytes() const { return capacity_ * sizeof(T); }

 private:
  /// As on the host: a 32-lane access that begins at any element stays inside.
  static constexpr std::size_t kPadding = 32;

  [[nodiscard]] std::size_t allocated_bytes() const { return (capacity_ + kPadding) * sizeof(T); }
  void allocate(const Executor<Cuda>& executor, std::size_t capacity) {
    LANGGS_EXPECTS(capacity <= (std::size_t{1} << 46) / sizeof(T), "buffer of ", capacity, " elements asked for");
    executor_ = executor;
    capacity_ = capacity;
    data_ = static_cast<T*>(executor.memory()->allocate(allocated_bytes(), executor.stream()));
  }

  std::optional<Executor<Cuda>> executor_;
  T* data_ = nullptr;
  std::size_t size_ = 0, capacity_ = 0;
};

}  // namespace langgs
