// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cuda_runtime_api.h>

#include "langgs/core/error.hpp"
#include "langgs/host/backend.hpp"

/// @file The CUDA backend: its tag, its errors, and the stream on which kernels are launched.

namespace langgs {

/// Backend tag: kernels run on the current CUDA device.
struct Cuda {
  static constexpr bool kChecked = false;
};

/// The CUDA runtime refused a call, or a kernel failed.
class DeviceError : public Error {
 public:
  using Error::Error;
};

namespace detail {

/// Throws DeviceError unless `status` is success; `parts` say what was being done.
template <class... Parts>
void check_cuda(cudaError_t status, const Parts&... parts) {
  if (status == cudaSuccess) return;
  raise<DeviceError>(parts..., ": ", cudaGetErrorName(status), ", ", cudaGetErrorString(status));
}

}  // namespace detail

/// A stream that somebody else owns; null is the default stream. Launches return before their kernels have run.
template <>
class Executor<Cuda> {
 public:
  explicit Executor(cudaStream_t stream = nullptr) : stream_(stream) {}
  [[nodiscard]] cudaStream_t stream() const { return stream_; }
  /// Waits for everything on the stream; throws DeviceError if any of it failed.
  void synchronize() const { detail::check_cuda(cudaStreamSynchronize(stream_), "waiting for a CUDA stream"); }

 private:
  cudaStream_t stream_;
};

}  // namespace langgs
