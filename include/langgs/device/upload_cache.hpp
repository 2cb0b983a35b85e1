// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>

#include "langgs/device/launch.hpp"

#if defined(__CUDACC__)
#include "langgs/cuda/upload_cache.hpp"
#endif

namespace langgs {

/// Pairs of arrays on the host that kernels read again and again, each with a key. A backend with memory of its own
/// keeps copies of those used last; on the host they are where they are.
template <class Backend>
class UploadCache {
 public:
  /// The copies may hold so many bytes; the pair asked for last is always there.
  explicit UploadCache(std::size_t) {}
  /// The two arrays of `key`, for work that is put on the executor before the next call of either function.
  template <class First, class Second>
  std::pair<const First*, const Second*> operator()(const Executor<Backend>&, std::int64_t,
                                                    std::span<const First> first, std::span<const Second> second) {
    return {first.data(), second.data()};
  }
  /// Begins to copy what will be asked for soon, beside the work of the executor.
  template <class First, class Second>
  void prefetch(const Executor<Backend>&, std::int64_t, std::span<const First>, std::span<const Second>) {}
  [[nodiscard]] std::size_t bytes() const { return 0; }
};

}  // namespace langgs
