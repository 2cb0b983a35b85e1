// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>

#include "langgs/cuda/error.hpp"
#include "langgs/cuda/memory.hpp"
#include "langgs/cuda/stream.hpp"
#include "langgs/host/backend.hpp"

/// @file The CUDA backend: its tag, and what its kernels run on.
///
/// What is CUDA's own lies in the namespace langgs::gpu. Were it langgs::cuda, `using namespace langgs` would make the
/// toolkit's ::cuda ambiguous.

namespace langgs {

/// Backend tag: kernels run on the CUDA device that was current when the executor was made.
struct Cuda {
  static constexpr bool kChecked = false;
};

namespace detail {

template <class Backend>
concept CudaBackend = std::is_same_v<Backend, Cuda>;

}  // namespace detail

/// When a kernel's error is looked for: where the host waits anyway, or after each launch, which then waits and can
/// name its kernel (slow; for finding mistakes).
enum class LaunchChecks { at_synchronize, after_each_launch };

/// A stream, the memory for work on it, and the last launch. Copies are the same executor. Launches return before their
/// kernels have run; the last copy waits for the stream. Not for use by two threads at a time.
template <>
class Executor<Cuda> {
 public:
  /// On a stream that somebody else owns, and that outlives the executor and the buffers made on it; null is the
  /// default stream. Without `memory`, a pool of its own.
  explicit Executor(cudaStream_t stream = nullptr, std::shared_ptr<gpu::DeviceMemory> memory = nullptr)
      : shared_(std::make_shared<Shared>(std::nullopt, stream, std::move(memory))) {}
  /// Takes a stream over.
  explicit Executor(gpu::Stream stream, std::shared_ptr<gpu::DeviceMemory> memory = nullptr) {
    const cudaStream_t handle = stream.get();
    shared_ = std::make_shared<Shared>(std::move(stream), handle, std::move(memory));
  }

  [[nodiscard]] cudaStream_t stream() const { return shared_->stream; }
  [[nodiscard]] const std::shared_ptr<gpu::DeviceMemory>& memory() const { return shared_->memory; }
  /// Waits for everything on the stream; throws DeviceError if any of it failed.
  void synchronize() const {
    ++shared_->num_waits;
    detail::check_cuda(cudaStreamSynchronize(stream()), "waiting for a CUDA stream whose last launch was ",
                       shared_->last_launch());
  }
  /// Waits for what was on the stream when `event` was recorded; throws DeviceError if any of it failed.
  void wait(const gpu::Event& event) const {
    detail::check_cuda(cudaEventSynchronize(event.get()), "waiting for part of a CUDA stream whose last launch was ",
                       shared_->last_launch());
  }
  /// How often `synchronize` has been called: each time the device ran out of work.
  [[nodiscard]] int num_waits() const { return shared_->num_waits; }
  /// Whether what is put on the stream can be recorded for a graph.
  [[nodiscard]] bool can_capture() const {
    return stream() != nullptr && stream() != cudaStreamLegacy && shared_->checks == LaunchChecks::at_synchronize;
  }
  /// Whether it is being recorded now.
  [[nodiscard]] bool is_capturing() const {
    cudaStreamCaptureStatus status = cudaStreamCaptureStatusNone;
    detail::check_cuda(cudaStreamIsCapturing(stream(), &status), "asking whether a stream is captured");
    return status == cudaStreamCaptureStatusActive;
  }

  /// Makes the executor's device that of the calling thread: to be said by another thread before it uses the executor.
  void make_current() const { detail::check_cuda(cudaSetDevice(shared_->device), "choosing device ", shared_->device); }

  void set_launch_checks(LaunchChecks checks) { shared_->checks = checks; }
  /// For whoever launches kernels: what a later error is to name. `name` makes the kernel's name.
  void launched(std::string (*name)(), int num_blocks, int num_threads) const {
    shared_->name = name;
    shared_->num_blocks = num_blocks;
    shared_->num_threads = num_threads;
    if (shared_->checks == LaunchChecks::after_each_launch) synchronize();
  }

  /// Temporary device memory, the caller's until the next call. Allocates only for more bytes than ever before.
  [[nodiscard]] void* workspace(std::size_t bytes) const { return shared_->grown_workspace(bytes); }

 private:
  struct Shared {
    Shared(std::optional<gpu::Stream> owned_, cudaStream_t stream_, std::shared_ptr<gpu::DeviceMemory> memory_)
        : owned(std::move(owned_)),
          stream(stream_),
          memory(memory_ != nullptr ? std::move(memory_) : std::make_shared<gpu::StreamOrderedMemory>()) {
      detail::check_cuda(cudaGetDevice(&device), "asking for the current device");
    }
    Shared(const Shared&) = delete;
    Shared& operator=(const Shared&) = delete;
    ~Shared() {
      if (workspace != nullptr) memory->release(workspace, workspace_bytes, stream);
      (void)cudaStreamSynchronize(stream);  // no work outlives the memory that it was given
    }
    [[nodiscard]] void* grown_workspace(std::size_t bytes) {
      if (bytes > workspace_bytes) {
        const std::size_t enough = std::max(bytes, workspace_bytes + workspace_bytes / 2);
        void* fresh = memory->allocate(enough, stream);
        if (workspace != nullptr) memory->release(workspace, workspace_bytes, stream);
        workspace = fresh;
        workspace_bytes = enough;
      }
      return workspace;
    }
    [[nodiscard]] std::string last_launch() const {
      if (name == nullptr) return "none";
      return detail::concat(name(), " with ", num_blocks, " blocks of ", num_threads, " threads");
    }

    std::optional<gpu::Stream> owned;
    cudaStream_t stream;
    std::shared_ptr<gpu::DeviceMemory> memory;
    int device = 0;
    void* workspace = nullptr;
    std::size_t workspace_bytes = 0;
    LaunchChecks checks = LaunchChecks::at_synchronize;
    std::string (*name)() = nullptr;
    int num_blocks = 0, num_threads = 0, num_waits = 0;
  };
  std::shared_ptr<Shared> shared_;
};

template <detail::CudaBackend Backend>
[[nodiscard]] Executor<Backend> make_executor(int) {
  return Executor<Backend>(gpu::Stream());
}

}  // namespace langgs
