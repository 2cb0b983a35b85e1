// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "langgs/core/camera.hpp"
#include "langgs/core/image.hpp"
#include "langgs/host/worker_pool.hpp"

namespace langgs {

/// Grey values of a colour image, averaged over squares: smooth enough that a step of some pixels stays in reach of its
/// gradient.
struct IntensityImage {
  Camera camera;              ///< of the smaller image
  std::vector<float> values;  ///< [camera.height, camera.width] in [0, 1]; empty without a colour image

  [[nodiscard]] bool empty() const { return values.empty(); }

  /// Bilinear at full-size pixel (u, v); -1 outside.
  [[nodiscard]] float sample(const Camera& full, float u, float v) const {
    if (empty()) return -1;
    const float x = (u - full.cx) * (camera.fx / full.fx) + camera.cx;
    const float y = (v - full.cy) * (camera.fy / full.fy) + camera.cy;
    if (!(x >= 0 && y >= 0 && x < static_cast<float>(camera.width - 1) && y < static_cast<float>(camera.height - 1)))
      return -1;
    const int x0 = static_cast<int>(x), y0 = static_cast<int>(y);
    const float a = x - static_cast<float>(x0), b = y - static_cast<float>(y0);
    const float* const p = values.data() + static_cast<std::ptrdiff_t>(y0) * camera.width + x0;
    return (1 - b) * ((1 - a) * p[0] + a * p[1]) + b * ((1 - a) * p[camera.width] + a * p[camera.width + 1]);
  }
};

/// colour: [H, W, 3]. Squares of `size` pixels; what they do not cover at the right and at the bottom is left out.
[[nodiscard]] inline IntensityImage make_intensity_image(const Image<std::uint8_t>& colour, const Camera& camera,
                                                         int size, WorkerPool& pool) {
  IntensityImage result;
  const int width = colour.width() / size, height = colour.height() / size;
  if (width < 2 || height < 2) return result;
  const auto scale = static_cast<float>(size);
  const float shift = 0.5f * (scale - 1);  // of the first square's centre
  result.camera = {
      camera.fx / scale, camera.fy / scale, (camera.cx - shift) / scale, (camera.cy - shift) / scale, width, height};
  result.values.resize(static_cast<std::size_t>(width) * height);
  pool.run(height, [&](int y) {
    std::vector<std::int32_t> sums(3 * static_cast<std::size_t>(size) * width, 0);  // of columns, per channel
    for (int j = 0; j < size; ++j) {
      const std::uint8_t* const row = colour.data() + static_cast<std::ptrdiff_t>(y * size + j) * 3 * colour.width();
      for (std::size_t i = 0; i < sums.size(); ++i) sums[i] += row[i];
    }
    for (int x = 0; x < width; ++x) {
      float rgb[3] = {};
      for (int i = 0; i < size; ++i)
        for (int c = 0; c < 3; ++c)
          rgb[c] += static_cast<float>(sums[3 * (static_cast<std::size_t>(x) * size + i) + c]);
      const float grey = 0.299f * rgb[0] + 0.587f * rgb[1] + 0.114f * rgb[2];
      result.values[static_cast<std::size_t>(y) * width + x] = grey / (255 * scale * scale);
    }
  });
  return result;
}

}  // namespace langgs
