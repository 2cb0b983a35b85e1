// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "langgs/cuda/backend.hpp"

namespace langgs::gpu {

/// Work recorded once and launched as a whole: many small kernels for the price of one launch. Move-only.
class Graph {
 public:
  /// Calls `record()` and keeps what it puts on the executor's stream instead of running it. The stream must not be the
  /// default one. Nothing in `record` may wait for the stream or grow a buffer: run it once before.
  /// Throws DeviceError, and what `record` throws.
  template <class Record>
  Graph(const Executor<Cuda>& executor, const Record& record) {
    detail::check_cuda(cudaStreamBeginCapture(executor.stream(), cudaStreamCaptureModeThreadLocal),
                       "beginning to capture a graph");
    cudaGraph_t graph = nullptr;
    try {
      record();
    } catch (...) {
      (void)cudaStreamEndCapture(executor.stream(), &graph);
      const detail::UniqueHandle<cudaGraph_t, &cudaGraphDestroy> owner(graph);
      (void)cudaGetLastError();
      throw;
    }
    detail::check_cuda(cudaStreamEndCapture(executor.stream(), &graph), "capturing a graph");
    const detail::UniqueHandle<cudaGraph_t, &cudaGraphDestroy> owner(graph);
    cudaGraphExec_t instance = nullptr;
    detail::check_cuda(cudaGraphInstantiate(&instance, graph, 0), "instantiating a graph");
    instance_ = Instance(instance);
  }

  /// Runs the work on the executor's stream, with the pointers and values that were recorded. Throws DeviceError.
  void launch(const Executor<Cuda>& executor) const {
    detail::check_cuda(cudaGraphLaunch(instance_.get(), executor.stream()), "launching a graph");
  }

 private:
  using Instance = detail::UniqueHandle<cudaGraphExec_t, &cudaGraphExecDestroy>;
  Instance instance_;
};

}  // namespace langgs::gpu

namespace langgs {

template <class Arguments, class Backend>
class Replay;

/// The CUDA twin of device/replay.hpp. Work is done as it is when the arguments are new, which also lets buffers grow;
/// the second time it is captured, and from then on launched as one graph.
template <class Arguments>
class Replay<Arguments, Cuda> {
 public:
  template <class Work>
  void operator()(const Executor<Cuda>& executor, const Arguments& arguments, const Work& work) {
    const bool is_known = known_ && known_->arguments == arguments && known_->workspace == executor.workspace(0);
    if (!is_known || !executor.can_capture()) {
      graph_.reset();
      work();
      known_ = Known{arguments, executor.workspace(0)};
      return;
    }
    if (!graph_) graph_.emplace(executor, work);
    graph_->launch(executor);
  }

 private:
  struct Known {
    Arguments arguments;
    void* workspace;  ///< what work by others makes grow moves
  };
  std::optional<Known> known_;
  std::optional<gpu::Graph> graph_;
};

}  // namespace langgs
