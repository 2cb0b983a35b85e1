// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

#include "langgs/cuda/backend.hpp"

namespace langgs::test {

/// Memory as a user would bring it; counts what is asked for.
struct CountedMemory : gpu::DeviceMemory {
  void* allocate(std::size_t bytes, cudaStream_t) override {
    void* pointer = nullptr;
    detail::check_cuda(cudaMalloc(&pointer, bytes), "allocating");
    ++allocations;
    live += static_cast<long>(bytes);
    return pointer;
  }
  void release(void* pointer, std::size_t bytes, cudaStream_t stream) noexcept override {
    (void)cudaStreamSynchronize(stream);
    (void)cudaFree(pointer);
    live -= static_cast<long>(bytes);
  }
  int allocations = 0;
  long live = 0;
};

}  // namespace langgs::test
