// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

#include "langgs/core/error.hpp"

namespace langgs {

/// A host image of shape [height, width, channels], row-major and interleaved, without row padding.
template <class T>
class Image {
 public:
  Image() = default;
  Image(int width, int height, int channels = 1, T fill = T{}) : width_(width), height_(height), channels_(channels) {
    LANGGS_EXPECTS(width >= 0 && height >= 0 && channels >= 1, "image shape is [", height, ", ", width, ", ", channels,
                   "]; sizes must not be negative");
    data_.assign(static_cast<std::size_t>(width) * height * channels, fill);
  }

  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }
  [[nodiscard]] int channels() const { return channels_; }
  [[nodiscard]] bool empty() const { return data_.empty(); }
  [[nodiscard]] std::size_t size() const { return data_.size(); }  ///< elements, channels included
  [[nodiscard]] T* data() { return data_.data(); }
  [[nodiscard]] const T* data() const { return data_.data(); }

  [[nodiscard]] T& operator()(int x, int y, int c = 0) { return data_[index(x, y, c)]; }
  [[nodiscard]] const T& operator()(int x, int y, int c = 0) const { return data_[index(x, y, c)]; }

  friend bool operator==(const Image&, const Image&) = default;

 private:
  [[nodiscard]] std::size_t index(int x, int y, int c) const {
    return (static_cast<std::size_t>(y) * width_ + x) * channels_ + c;
  }

  int width_ = 0, height_ = 0, channels_ = 1;
  std::vector<T> data_;
};

}  // namespace langgs
