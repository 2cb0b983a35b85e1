// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cuda_runtime_api.h>

#include "langgs/core/error.hpp"

namespace langgs {

/// The CUDA runtime refused a call, or a kernel failed. The message names the call or the kernel with its launch shape,
/// the runtime's error, and what can be done.
class DeviceError : public Error {
 public:
  using Error::Error;
};

namespace detail {

/// What a user can do about an error of the CUDA runtime.
[[nodiscard]] inline const char* remedy(cudaError_t status) {
  switch (status) {
    case cudaErrorMemoryAllocation:
      return "free device memory, or give the Executor a DeviceMemory that has more";
    case cudaErrorInvalidConfiguration:
      return "a launch takes 1 to 2^31 - 1 blocks of at most 1024 threads; work on less at once";
    case cudaErrorNoKernelImageForDevice:
    case cudaErrorInvalidPtx:
    case cudaErrorUnsupportedPtxVersion:
      return "compile for this GPU: add its architecture to CMAKE_CUDA_ARCHITECTURES";
    case cudaErrorNoDevice:
    case cudaErrorInsufficientDriver:
      return "install a driver that is at least as new as the toolkit, and check nvidia-smi";
    case cudaErrorIllegalAddress:
    case cudaErrorMisalignedAddress:
    case cudaErrorLaunchFailure:
    case cudaErrorAssert:
      return "the process has lost its device; LaunchChecks::after_each_launch names the kernel, compute-sanitizer the "
             "line";
    case cudaErrorStreamCaptureUnsupported:
    case cudaErrorStreamCaptureInvalidated:
      return "while a graph is captured nothing may wait for its stream; run once before, so that buffers have grown";
    default:
      return "see the CUDA runtime's description of this error";
  }
}

/// Throws DeviceError unless `status` is success; `parts` say what was being done.
template <class... Parts>
void check_cuda(cudaError_t status, const Parts&... parts) {
  if (status == cudaSuccess) return;
  (void)cudaGetLastError();  // reported here: the next launch must not report it again
  raise<DeviceError>(parts..., ": ", cudaGetErrorName(status), ", ", cudaGetErrorString(status), "; ", remedy(status));
}

/// Owns a handle of the CUDA runtime. Destructors cannot report: an error shows at the next call that can.
template <class Handle, cudaError_t (*kDestroy)(Handle)>
class UniqueHandle {
 public:
  UniqueHandle() = default;
  explicit UniqueHandle(Handle handle) : handle_(handle) {}
  UniqueHandle(UniqueHandle&& other) noexcept : handle_(other.handle_) { other.handle_ = nullptr; }
  UniqueHandle& operator=(UniqueHandle&& other) noexcept {
    Handle mine = handle_;
    handle_ = other.handle_;
    other.handle_ = mine;
    return *this;
  }
  ~UniqueHandle() {
    if (handle_ != nullptr) (void)kDestroy(handle_);
  }
  [[nodiscard]] Handle get() const { return handle_; }

 private:
  Handle handle_ = nullptr;
};

}  // namespace detail
}  // namespace langgs
