// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "langgs/device/buffer.hpp"
#include "langgs/host/backend.hpp"

#if defined(__CUDACC__)
#include "langgs/cuda/copy.hpp"
#endif

/// @file Copies between a backend's memory and the host's, and within the former. On the host both are the same, and
/// nothing is copied that need not be.

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

/// Copies `n` values within the backend's memory; the two ranges must not overlap.
template <detail::HostBackend Backend, class T>
void copy_within(const Executor<Backend>&, const T* from, std::size_t n, T* to) {
  std::copy_n(from, n, to);
}
/// Sets `n` values in the backend's memory to zero.
template <detail::HostBackend Backend, class T>
void set_zero(const Executor<Backend>&, T* to, std::size_t n) {
  std::fill_n(to, n, T{});
}
/// Moves row kept[i] of `rows` [?, width] to row i, for i in [0, n). `kept` is in the backend's memory and ascending.
template <detail::HostBackend Backend, class T>
void keep_rows(const Executor<Backend>&, T* rows, int width, const std::int32_t* kept, int n) {
  const auto row = [&](std::int32_t i) { return rows + static_cast<std::ptrdiff_t>(i) * width; };
  if (width == 1)
    for (int i = 0; i < n; ++i) rows[i] = rows[kept[i]];
  else
    for (int i = 0; i < n; ++i)
      if (kept[i] != i) std::memcpy(row(i), row(kept[i]), width * sizeof(T));
}
/// Calls `write(values)` on the host to write the `n` values at `to` in the backend's memory.
template <detail::HostBackend Backend, class T, class Write>
void write_from_host(const Executor<Backend>&, T* to, std::size_t, const Write& write) {
  write(to);
}
/// Has `compute(values)` compute `n` values in the backend's memory, and brings them to `to` on the host.
template <detail::HostBackend Backend, class T, class Compute>
void compute_to_host(const Executor<Backend>&, T* to, std::size_t, const Compute& compute) {
  compute(to);
}

/// A host's array as kernels see it.
template <class T, class Backend>
class Upload {
 public:
  /// Here `from` itself, which must stay as it is while kernels read it. A backend with memory of its own copies it to
  /// where the values before it were.
  const T* operator()(const Executor<Backend>&, const T* from, std::size_t) { return from; }
  [[nodiscard]] std::size_t bytes() const { return 0; }
};

/// A backend's array as the host sees it, after all work of the executor.
template <class T, class Backend>
class Download {
 public:
  /// Here `from` itself. A backend with memory of its own copies it to where the values before it were, and waits.
  const T* operator()(const Executor<Backend>&, const T* from, std::size_t) { return from; }
};

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
