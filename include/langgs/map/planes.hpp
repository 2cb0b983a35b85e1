// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

#include "langgs/core/config.hpp"
#include "langgs/device/buffer.hpp"
#include "langgs/device/copy.hpp"

namespace langgs {

/// The 14 geometric parameters of a Gaussian, one plane of the map each.
enum Plane : int {
  kMeanX,
  kMeanY,
  kMeanZ,
  kLogScaleX,
  kLogScaleY,
  kLogScaleZ,
  kRotationW,
  kRotationX,
  kRotationY,
  kRotationZ,
  kOpacityLogit,
  kRed,
  kGreen,
  kBlue,
  kNumPlanes
};

/// Trivially copyable view of [kNumPlanes, size] floats; plane p begins at base + p * stride.
struct PlanesView {
  float* base = nullptr;
  int stride = 0;
  int size = 0;

  friend bool operator==(const PlanesView&, const PlanesView&) = default;
  [[nodiscard]] LANGGS_INLINE float* plane(int p) const { return base + static_cast<std::ptrdiff_t>(p) * stride; }
};

/// Owner of [kNumPlanes, size] floats, structure of arrays. Rows beyond `size` may be read (padding), never written.
template <class Backend>
class Planes {
 public:
  [[nodiscard]] int size() const { return size_; }
  [[nodiscard]] std::size_t bytes() const { return storage_.bytes(); }
  [[nodiscard]] PlanesView view() { return {storage_.data(), stride_, size_}; }
  [[nodiscard]] PlanesView view() const { return {const_cast<float*>(storage_.data()), stride_, size_}; }

  /// Changes the number of rows; kept rows keep their values, new rows are zero.
  void resize(const Executor<Backend>& executor, int size) {
    if (size > stride_) {
      const int stride = (static_cast<int>(grown_capacity(size)) / 32 + 1) * 32;
      Buffer<float, Backend> grown(executor, static_cast<std::size_t>(stride) * kNumPlanes);
      set_zero(executor, grown.data(), grown.size());
      for (int p = 0; p < kNumPlanes && size_ > 0; ++p)
        copy_within(executor, view().plane(p), size_, grown.data() + static_cast<std::size_t>(p) * stride);
      storage_.swap(grown);
      stride_ = stride;
    } else if (size > size_) {
      for (int p = 0; p < kNumPlanes; ++p) set_zero(executor, view().plane(p) + size_, size - size_);
    }
    size_ = size;
  }

  /// Keeps the rows kept[0..n), which must be ascending, in this order. `kept` is in the backend's memory.
  void compact(const Executor<Backend>& executor, const std::int32_t* kept, int n) {
    for (int p = 0; p < kNumPlanes; ++p) keep_rows(executor, view().plane(p), 1, kept, n);
    size_ = n;
  }

 private:
  Buffer<float, Backend> storage_;
  int stride_ = 0, size_ = 0;
};

/// Planes of a backend as the host sees them; valid until the next call with the same `download`.
template <class Backend>
[[nodiscard]] PlanesView planes_on_host(const Executor<Backend>& executor, const PlanesView& planes,
                                        Download<float, Backend>& download) {
  const float* base = download(executor, planes.base, static_cast<std::size_t>(planes.stride) * kNumPlanes);
  return {const_cast<float*>(base), planes.stride, planes.size};
}

/// Owner of [size, width] values, rows contiguous.
template <class T, class Backend>
class Rows {
 public:
  explicit Rows(int width = 1) : width_(width) {}
  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] std::size_t bytes() const { return storage_.bytes(); }
  [[nodiscard]] T* data() { return storage_.data(); }
  [[nodiscard]] const T* data() const { return storage_.data(); }
  [[nodiscard]] T* row(int i) { return storage_.data() + static_cast<std::size_t>(i) * width_; }
  [[nodiscard]] const T* row(int i) const { return storage_.data() + static_cast<std::size_t>(i) * width_; }

  /// Changes the number of rows; kept rows keep their values, new rows are zero.
  void resize(const Executor<Backend>& executor, int size) {
    const std::size_t before = storage_.size(), after = static_cast<std::size_t>(size) * width_;
    storage_.resize_keep(executor, after);
    if (after > before) set_zero(executor, storage_.data() + before, after - before);
  }
  /// Keeps the rows kept[0..n), which must be ascending, in this order. `kept` is in the backend's memory.
  void compact(const Executor<Backend>& executor, const std::int32_t* kept, int n) {
    keep_rows(executor, storage_.data(), width_, kept, n);
    storage_.resize_keep(executor, static_cast<std::size_t>(n) * width_);
  }

 private:
  Buffer<T, Backend> storage_;
  int width_;
};

}  // namespace langgs
