// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <utility>

#include "langgs/cuda/error.hpp"

/// @file Where device memory comes from, and page-locked host memory for copies that need not wait.

namespace langgs::gpu {

/// Where an Executor<Cuda> takes device memory from. Derive from it to bring a pool of your own.
class DeviceMemory {
 public:
  DeviceMemory() = default;
  DeviceMemory(const DeviceMemory&) = delete;
  DeviceMemory& operator=(const DeviceMemory&) = delete;
  virtual ~DeviceMemory() = default;

  /// At least `bytes` > 0 bytes, aligned to 256, for work that is put on `stream` from now on. Throws DeviceError.
  [[nodiscard]] virtual void* allocate(std::size_t bytes, cudaStream_t stream) = 0;
  /// Takes back what `allocate` gave, for reuse after the work that is on `stream` now.
  virtual void release(void* pointer, std::size_t bytes, cudaStream_t stream) noexcept = 0;
};

/// A memory pool of the CUDA driver, on the device that is current when it is made. What was released stays in the
/// pool, so that a program in its steady state asks the driver for nothing.
class StreamOrderedMemory : public DeviceMemory {
 public:
  StreamOrderedMemory() : pool_(create()) {}
  [[nodiscard]] void* allocate(std::size_t bytes, cudaStream_t stream) override {
    void* pointer = nullptr;
    detail::check_cuda(cudaMallocFromPoolAsync(&pointer, bytes, pool_.get(), stream), "allocating ", bytes,
                       " bytes of device memory");
    return pointer;
  }
  void release(void* pointer, std::size_t, cudaStream_t stream) noexcept override {
    (void)cudaFreeAsync(pointer, stream);
  }

 private:
  [[nodiscard]] static cudaMemPool_t create() {
    int device = 0, supported = 0;
    detail::check_cuda(cudaGetDevice(&device), "asking for the current device");
    detail::check_cuda(cudaDeviceGetAttribute(&supported, cudaDevAttrMemoryPoolsSupported, device),
                       "asking for memory pools");
    if (supported == 0)
      detail::raise<DeviceError>("device ", device, " has no memory pools; give the Executor a DeviceMemory of yours");
    cudaMemPoolProps properties{};
    properties.allocType = cudaMemAllocationTypePinned;
    properties.location.type = cudaMemLocationTypeDevice;
    properties.location.id = device;
    cudaMemPool_t pool = nullptr;
    detail::check_cuda(cudaMemPoolCreate(&pool, &properties), "creating a memory pool");
    std::uint64_t keep_all = UINT64_MAX;
    detail::check_cuda(cudaMemPoolSetAttribute(pool, cudaMemPoolAttrReleaseThreshold, &keep_all),
                       "setting up a memory pool");
    return pool;
  }
  detail::UniqueHandle<cudaMemPool_t, &cudaMemPoolDestroy> pool_;
};

/// A move-only array in page-locked host memory, which the device copies to and from by itself. Slow to allocate: keep
/// it. Contents are not initialised.
template <class T>
class PinnedBuffer {
  static_assert(std::is_trivially_copyable_v<T>, "a PinnedBuffer holds values that can be copied as bytes");

 public:
  PinnedBuffer() = default;
  explicit PinnedBuffer(std::size_t size) { resize_discard(size); }
  PinnedBuffer(PinnedBuffer&& other) noexcept { swap(other); }
  PinnedBuffer& operator=(PinnedBuffer&& other) noexcept {
    swap(other);
    return *this;
  }

  void swap(PinnedBuffer& other) noexcept {
    std::swap(memory_, other.memory_);
    std::swap(size_, other.size_);
    std::swap(capacity_, other.capacity_);
  }

  /// Changes the size; the old contents are lost, and no copy may be under way. Allocates only when the size exceeds
  /// every size before. Throws DeviceError.
  void resize_discard(std::size_t size) {
    if (size > capacity_) {
      const std::size_t capacity = std::max(size, capacity_ + capacity_ / 2);
      void* fresh = nullptr;
      detail::check_cuda(cudaMallocHost(&fresh, capacity * sizeof(T)), "allocating ", capacity * sizeof(T),
                         " bytes of page-locked memory");
      memory_ = Memory(fresh);
      capacity_ = capacity;
    }
    size_ = size;
  }
  [[nodiscard]] T* data() { return static_cast<T*>(memory_.get()); }
  [[nodiscard]] const T* data() const { return static_cast<const T*>(memory_.get()); }
  [[nodiscard]] std::size_t size() const { return size_; }

 private:
  using Memory = detail::UniqueHandle<void*, &cudaFreeHost>;
  Memory memory_;
  std::size_t size_ = 0, capacity_ = 0;
};

}  // namespace langgs::gpu
