// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

#include "langgs/core/config.hpp"
#include "langgs/device/buffer.hpp"

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
  void resize(int size) {
    if (size > stride_) {
      const int stride = (static_cast<int>(grown_capacity(size)) / 32 + 1) * 32;
      Buffer<float, Backend> grown(static_cast<std::size_t>(stride) * kNumPlanes);
      grown.fill(0.f);
      for (int p = 0; p < kNumPlanes && size_ > 0; ++p)
        std::memcpy(grown.data() + static_cast<std::size_t>(p) * stride, view().plane(p), size_ * sizeof(float));
      storage_.swap(grown);
      stride_ = stride;
    } else {
      for (int p = 0; p < kNumPlanes; ++p)
        for (int i = size_; i < size; ++i) view().plane(p)[i] = 0;
    }
    size_ = size;
  }

  /// Keeps the rows kept[0..n), which must be ascending, in this order.
  void compact(const std::int32_t* kept, int n) {
    for (int p = 0; p < kNumPlanes; ++p) {
      float* plane = view().plane(p);
      for (int i = 0; i < n; ++i) plane[i] = plane[kept[i]];
    }
    size_ = n;
  }

 private:
  Buffer<float, Backend> storage_;
  int stride_ = 0, size_ = 0;
};

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
  void resize(int size) {
    const std::size_t before = storage_.size();
    storage_.resize_keep(static_cast<std::size_t>(size) * width_);
    for (std::size_t i = before; i < storage_.size(); ++i) storage_.data()[i] = T{};
  }
  /// Keeps the rows kept[0..n), which must be ascending, in this order.
  void compact(const std::int32_t* kept, int n) {
    for (int i = 0; i < n; ++i)
      if (kept[i] != i) std::memcpy(row(i), row(kept[i]), width_ * sizeof(T));
    storage_.resize_keep(static_cast<std::size_t>(n) * width_);
  }

 private:
  Buffer<T, Backend> storage_;
  int width_;
};

}  // namespace langgs
