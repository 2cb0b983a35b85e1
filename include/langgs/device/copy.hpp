// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>

#include "langgs/device/buffer.hpp"
#include "langgs/host/backend.hpp"

#if defined(__CUDACC__)
#include "langgs/cuda/copy.hpp"
#endif

/// @file Copies between a backend's memory and the host's. On the host both are the same.

namespace langgs {

/// Copies `n` values from the host to the backend; the host's may be overwritten afterwards.
template <detail::HostBackend Backend, class T>
void copy_from_host(const Executor<Backend>&, const T* from, std::size_t n, T* to) {
  std::copy_n(from, n, to);
}
/// Copies `n` values from the backend to the host, once all work of the executor is done.
template <detail::HostBackend Backend, class T>
void copy_to_host(const Executor<Backend>&, const T* from, std::size_t n, T* to) {
  std::copy_n(from, n, to);
}

/// Values that a backend computes and the host looks at later, or never: asking for them does not wait, looking does.
template <class T, class Backend>
class Readback {
 public:
  /// Asks for `n` values as they are after the work of the executor so far.
  void start(const Executor<Backend>&, const T* from, std::size_t n) {
    values_.resize_discard(n);
    std::copy_n(from, n, values_.data());
  }
  /// 0 before the first `start`.
  [[nodiscard]] std::size_t size() const { return values_.size(); }
  [[nodiscard]] const T* values() const { return values_.data(); }

 private:
  Buffer<T, Backend> values_;
};

}  // namespace langgs
