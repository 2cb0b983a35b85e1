// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <type_traits>
#include <utility>

#include "langgs/core/error.hpp"
#include "langgs/device/growth.hpp"
#include "langgs/host/backend.hpp"

#if defined(__CUDACC__)
#include "langgs/cuda/buffer.hpp"
#endif

namespace langgs {

/// A move-only array in a backend's memory. Contents are not initialised: say `fill` where zeros matter.
/// Code for any backend passes the executor whose work is going to use the memory; the host needs none.
template <class T, class Backend>
class Buffer {
  static_assert(std::is_trivially_copyable_v<T>, "a Buffer holds values that can be copied as bytes");
  using Memory = detail::HostMemory<T>;

 public:
  Buffer() = default;
  explicit Buffer(std::size_t size) { resize_discard(size); }
  Buffer(const Executor<Backend>&, std::size_t size) { resize_discard(size); }
  Buffer(Buffer&& other) noexcept
      : data_(std::exchange(other.data_, nullptr)),
        size_(std::exchange(other.size_, 0)),
        capacity_(std::exchange(other.capacity_, 0)) {}
  Buffer& operator=(Buffer&& other) noexcept {
    swap(other);
    return *this;
  }
  ~Buffer() { Memory::release(data_); }

  void swap(Buffer& other) noexcept {
    std::swap(data_, other.data_);
    std::swap(size_, other.size_);
    std::swap(capacity_, other.capacity_);
  }

  /// Changes the size; the old contents are lost. Allocates only when the size exceeds every size before.
  void resize_discard(std::size_t size) {
    if (size > capacity_) {
      const std::size_t capacity = std::max(size, capacity_ + capacity_ / 2);
      T* fresh = Memory::allocate(capacity);
      Memory::release(data_);
      data_ = fresh;
      capacity_ = capacity;
    }
    size_ = size;
  }
  void resize_discard(const Executor<Backend>&, std::size_t size) { resize_discard(size); }
  /// Changes the size and keeps the first min(old, new) elements.
  void resize_keep(std::size_t size) {
    if (size > capacity_) {
      Buffer grown(grown_capacity(size));
      if (size_ > 0) std::memcpy(grown.data_, data_, size_ * sizeof(T));
      swap(grown);
    }
    size_ = size;
  }
  void resize_keep(const Executor<Backend>&, std::size_t size) { resize_keep(size); }
  void fill(T value) { std::fill(data_, data_ + size_, value); }
  void fill(const Executor<Backend>&, T value) { fill(value); }

  [[nodiscard]] T* data() { return data_; }
  [[nodiscard]] const T* data() const { return data_; }
  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] std::size_t bytes() const { return capacity_ * sizeof(T); }

 private:
  T* data_ = nullptr;
  std::size_t size_ = 0, capacity_ = 0;
};

}  // namespace langgs
