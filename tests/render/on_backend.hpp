// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <vector>

#include "langgs/render/topk_rasterizer.hpp"
#include "render/render_scene.hpp"
#include "support/backend.hpp"

/// @file Rendering a scene on the backend that a test is compiled for.

namespace langgs::test {

template <int K>
using TestRasterizer = TopKRasterizer<K, TestBackend>;

/// The Gaussians of a scene in the backend's memory.
class MapOnBackend {
 public:
  MapOnBackend(const TestExecutor& executor, const RenderScene& scene) {
    const GaussianMap<1> map = scene.map();
    view_.size = map.size();
    view_.stride = (map.size() / 32 + 1) * 32;
    std::vector<float> planes(static_cast<std::size_t>(view_.stride) * kNumPlanes);
    for (int p = 0; p < kNumPlanes && map.size() > 0; ++p)
      std::copy_n(map.geometry().plane(p), map.size(), planes.begin() + static_cast<std::ptrdiff_t>(p) * view_.stride);
    memory_.resize_discard(executor, planes.size());
    copy_from_host(executor, planes.data(), planes.size(), memory_.data());
    view_.base = memory_.data();
  }
  [[nodiscard]] const PlanesView& view() const { return view_; }

 private:
  Buffer<float, TestBackend> memory_;
  PlanesView view_;
};

/// The host's copy of a rendered view.
struct Picture {
  template <int K>
  Picture(const TestExecutor& executor, TestRasterizer<K>& rasterizer)
      : num_pixels(rasterizer.num_pixels()), values(fetch(executor, rasterizer.rendered().colour, 5 * num_pixels)) {}
  [[nodiscard]] RenderPlanes planes() {
    return {values.data(), values.data() + 3 * num_pixels, values.data() + 4 * num_pixels};
  }

  std::size_t num_pixels;
  std::vector<float> values;  ///< [5, H, W]
};

}  // namespace langgs::test
