// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "langgs/cuda/error.hpp"

/// @file Owners of CUDA streams and events.

namespace langgs::gpu {

/// A point in a stream's work that the host or another stream can wait for. Move-only.
class Event {
 public:
  Event() : handle_(create()) {}
  /// Throws DeviceError.
  void record(cudaStream_t stream) { detail::check_cuda(cudaEventRecord(handle_.get(), stream), "recording an event"); }
  /// Waits on the host for the work before the last `record`; throws DeviceError if it failed.
  void synchronize() const { detail::check_cuda(cudaEventSynchronize(handle_.get()), "waiting for an event"); }
  /// Whether that work is done; throws DeviceError if it failed.
  [[nodiscard]] bool is_done() const {
    const cudaError_t status = cudaEventQuery(handle_.get());
    if (status == cudaErrorNotReady) return false;
    detail::check_cuda(status, "asking for an event");
    return true;
  }
  [[nodiscard]] cudaEvent_t get() const { return handle_.get(); }

 private:
  [[nodiscard]] static cudaEvent_t create() {
    cudaEvent_t event = nullptr;
    detail::check_cuda(cudaEventCreateWithFlags(&event, cudaEventDisableTiming), "creating an event");
    return event;
  }
  detail::UniqueHandle<cudaEvent_t, &cudaEventDestroy> handle_;
};

/// A queue of device work that does not wait for the default stream. Move-only.
class Stream {
 public:
  Stream() : handle_(create()) {}
  /// Waits on the host for all of its work; throws DeviceError if any of it failed.
  void synchronize() const { detail::check_cuda(cudaStreamSynchronize(handle_.get()), "waiting for a stream"); }
  /// What comes later on this stream waits for the event's last `record`.
  void wait(const Event& event) const {
    detail::check_cuda(cudaStreamWaitEvent(handle_.get(), event.get(), 0), "making a stream wait for an event");
  }
  [[nodiscard]] cudaStream_t get() const { return handle_.get(); }

 private:
  [[nodiscard]] static cudaStream_t create() {
    cudaStream_t stream = nullptr;
    detail::check_cuda(cudaStreamCreateWithFlags(&stream, cudaStreamNonBlocking), "creating a stream");
    return stream;
  }
  detail::UniqueHandle<cudaStream_t, &cudaStreamDestroy> handle_;
};

}  // namespace langgs::gpu
