// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

#include "langgs/cuda/backend.hpp"

namespace langgs::test {

/// A fixed array in device memory. Exactly as large as asked for, so that a memory checker sees a read beyond it.
template <class T>
class DeviceArray {
 public:
  explicit DeviceArray(std::size_t size) : size_(size) {
    detail::check_cuda(cudaMalloc(&data_, (size > 0 ? size : 1) * sizeof(T)), "cudaMalloc");
  }
  DeviceArray(std::size_t size, int byte) : DeviceArray(size) {
    detail::check_cuda(cudaMemset(data_, byte, size * sizeof(T)), "cudaMemset");
  }
  explicit DeviceArray(const std::vector<T>& values) : DeviceArray(values.size()) {
    detail::check_cuda(cudaMemcpy(data_, values.data(), size_ * sizeof(T), cudaMemcpyHostToDevice), "cudaMemcpy");
  }
  DeviceArray(const DeviceArray&) = delete;
  DeviceArray& operator=(const DeviceArray&) = delete;
  ~DeviceArray() { cudaFree(data_); }

  [[nodiscard]] T* data() const { return static_cast<T*>(data_); }
  [[nodiscard]] std::vector<T> values() const {
    std::vector<T> result(size_);
    detail::check_cuda(cudaMemcpy(result.data(), data_, size_ * sizeof(T), cudaMemcpyDeviceToHost), "cudaMemcpy");
    return result;
  }

 private:
  void* data_ = nullptr;
  std::size_t size_;
};

}  // namespace langgs::test
