// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "langgs/device/launch.hpp"

#if defined(__CUDACC__)
#include "langgs/cuda/graph.hpp"
#endif

namespace langgs {

/// Work that is done again and again with the same arguments, which have ==. On the host it simply is; a device may
/// remember it.
template <class Arguments, class Backend>
class Replay {
 public:
  /// Does `work()`, whose kernels and memory must depend on `arguments` alone.
  template <class Work>
  void operator()(const Executor<Backend>&, const Arguments&, const Work& work) {
    work();
  }
};

}  // namespace langgs
