// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <cstdint>

#include "langgs/core/camera.hpp"
#include "langgs/device/algorithm.hpp"
#include "langgs/device/buffer.hpp"
#include "langgs/device/launch.hpp"
#include "langgs/device/list_size.hpp"
#include "langgs/render/tiles.hpp"
#include "langgs/render/topk_rasterizer.hpp"

namespace langgs {

/// What one Gaussian gives to the feature of one sampled pixel.
struct Contribution {
  std::int32_t pixel;
  float weight;
};

/// Which Gaussians make up the feature of each sampled pixel, and with which weights:
/// F(p) = sum over i in [begin[p], begin[p + 1]) of contribution[i].weight f[gaussian[i]].
struct ContributionView {
  int width = 0, height = 0;                   ///< of the grid of samples
  ListSize size;                               ///< begin[num_pixels()]
  const std::int32_t* begin = nullptr;         ///< [num_pixels() + 1]
  const std::int32_t* gaussian = nullptr;      ///< [size]
  const Contribution* contribution = nullptr;  ///< [size]; pixels ascend

  [[nodiscard]] LANGGS_HD int num_pixels() const { return width * height; }
  friend bool operator==(const ContributionView&, const ContributionView&) = default;
};

/// A grid of width x height sample points that covers the image of a camera: the pixel centres of a feature map.
struct SampleGrid {
  int width = 0, height = 0;
  Camera camera;

  /// The image pixel nearest to the centre of sample p (row-major); both grids cover the same rectangle.
  [[nodiscard]] LANGGS_HD int pixel(int p) const {
    return nearest(p / width, height, camera.height) * camera.width + nearest(p % width, width, camera.width);
  }

 private:
  [[nodiscard]] LANGGS_HD static int nearest(int i, int count, int size) {
    // floor((i + 1/2) size / count), in integers: exact on every machine
    return static_cast<int>((2 * static_cast<std::int64_t>(i) + 1) * size / (2 * static_cast<std::int64_t>(count)));
  }
};

namespace detail {

/// Top-K weights of the sampled pixels, renormalised over those present (paper Eq. 3).
template <int K>
struct CountTopK {
  SampleGrid grid;
  std::ptrdiff_t plane;
  const std::int32_t* id;
  const std::uint8_t* wanted;
  std::int32_t* count;
  LANGGS_HD void operator()(int p) const {
    const std::int32_t* const at = id + grid.pixel(p);
    int n = 0;
    if (wanted == nullptr || wanted[p] != 0)
      for (int i = 0; i < K; ++i) n += at[i * plane] >= 0 ? 1 : 0;
    count[p] = n;
  }
};
struct FillTopK {
  SampleGrid grid;
  std::ptrdiff_t plane;
  const std::int32_t* id;
  const float* weight;
  const std::int32_t* begin;
  std::int32_t* out_gaussian;
  Contribution* out;
  LANGGS_HD void operator()(int p) const {
    const int pixel = grid.pixel(p), n = begin[p + 1] - begin[p];
    float sum = 0;
    for (int i = 0; i < n; ++i) sum += weight[i * plane + pixel];
    for (int i = 0; i < n; ++i) {
      out_gaussian[begin[p] + i] = id[i * plane + pixel];
      out[begin[p] + i] = {p, weight[i * plane + pixel] / sum};
    }
  }
};

/// Walks every ray once more and counts (pass 1) or writes (pass 2) all hits of every pixel.
struct RecordHits {
  static constexpr int kThreads = TileGrid::kThreads;
  template <class Block>
  struct Shared {};

  TileGrid grid;
  InstanceView instances;
  const std::int32_t* begin;  ///< [H * W + 1]; null while counting
  std::int32_t* count;        ///< [H, W]
  std::int32_t* gaussian;
  float* weight;

  template <class Block>
  LANGGS_HD void operator()(Block& block, Shared<Block>&) const {
    using F = VaryingOf<float, Block>;
    using Int = VaryingOf<std::int32_t, Block>;
    const int first = instances.tile_begin[block.index()], last = instances.tile_begin[block.index() + 1];
    const F columns = pixel_columns(grid, block);
    block.warps([&](const auto& warp) {
      const WarpPixels<Block> pixels(grid, block.index(), warp);
      const F row = pixel_rows(grid, block, warp);
      F T = pixels.initial_transmittance(warp);
      Int hits(0), place(0);
      if (begin != nullptr) place = pixels.load(warp, begin, 0);
      for (int j = first; j < last; ++j) {
        const Instance& instance = instances.sorted(j);
        if (warp.index() < instance.first_warp || warp.index() > instance.last_warp) continue;
        const Splat& s = instances.splats[instance.splat];
        const BlendStep<F> step(Footprint<F>(s, SplatColumn<F>(s, columns), row), T);
        T = step.next_transmittance;
        const auto hit = step.weight > 0.f;
        if (begin != nullptr) {
          warp.scatter(gaussian, place + hits, hit, Int(instances.splat_gaussian[instance.splat]));
          warp.scatter(weight, place + hits, hit, step.weight);
        }
        hits += select(hit, Int(1), Int(0));
      }
      if (begin == nullptr) pixels.store(warp, count, hits);
    });
  }
};

struct CopyCounts {
  SampleGrid grid;
  const std::int32_t* begin;
  const std::uint8_t* wanted;
  std::int32_t* count;
  LANGGS_HD void operator()(int p) const {
    const bool is_wanted = wanted == nullptr || wanted[p] != 0;
    count[p] = is_wanted ? begin[grid.pixel(p) + 1] - begin[grid.pixel(p)] : 0;
  }
};
struct CopyHits {
  SampleGrid grid;
  const std::int32_t *from_begin, *from_gaussian, *begin;
  const float* from_weight;
  std::int32_t* gaussian;
  Contribution* out;
  LANGGS_HD void operator()(int p) const {
    const int from = from_begin[grid.pixel(p)];
    for (int i = begin[p]; i < begin[p + 1]; ++i) {
      gaussian[i] = from_gaussian[from + i - begin[p]];
      out[i] = {p, from_weight[from + i - begin[p]]};
    }
  }
};

}  // namespace detail

/// Owner of contributions; reuses its buffers. `wanted` [height, width] names the samples that may have any, those with
/// a teacher; null: all of them.
template <class Backend>
class Contributions {
 public:
  [[nodiscard]] ContributionView view() const {
    return {width_, height_, size_, begin_.data(), gaussian_.data(), contribution_.data()};
  }
  [[nodiscard]] std::size_t bytes() const {
    return count_.bytes() + begin_.bytes() + gaussian_.bytes() + contribution_.bytes() + ray_count_.bytes() +
           ray_begin_.bytes() + ray_gaussian_.bytes() + ray_weight_.bytes();
  }

  /// The Top-K records of the rasteriser's last render, at the samples (paper Eqs. 2 and 3). Waits for nothing: there
  /// is room for K at each sample.
  template <int K>
  void from_topk(const Executor<Backend>& executor, const TopKRasterizer<K, Backend>& rasterizer,
                 const SampleGrid& grid, const std::uint8_t* wanted = nullptr) {
    const std::ptrdiff_t plane = grid.camera.num_pixels();
    resize_pixels(executor, grid);
    const int pixels = grid.width * grid.height;
    for_each_n(executor, pixels, detail::CountTopK<K>{grid, plane, rasterizer.topk_id(), wanted, count_.data()});
    resize_hits(executor, exclusive_scan(executor, count_.data(), begin_.data(), pixels, K * pixels));
    for_each_n(executor, pixels,
               detail::FillTopK{grid, plane, rasterizer.topk_id(), rasterizer.topk_weight(), begin_.data(),
                                gaussian_.data(), contribution_.data()});
  }

  /// Every hit of every ray with its raw blending weight: the full alpha blending of the paper's baseline
  /// (section 4.3). Waits for how many there are.
  void from_blending(const Executor<Backend>& executor, const SplatList<Backend>& splats, const SampleGrid& grid,
                     const std::uint8_t* wanted = nullptr) {
    const int all = grid.camera.num_pixels(), tiles = splats.grid().count(), pixels = grid.width * grid.height;
    ray_count_.resize_discard(executor, all);
    ray_begin_.resize_discard(executor, all + 1);
    launch(executor, tiles,
           detail::RecordHits{splats.grid(), splats.instances(), nullptr, ray_count_.data(), nullptr, nullptr});
    const int hits = exclusive_scan(executor, ray_count_.data(), ray_begin_.data(), all);
    ray_gaussian_.resize_discard(executor, hits);
    ray_weight_.resize_discard(executor, hits);
    launch(executor, tiles,
           detail::RecordHits{splats.grid(), splats.instances(), ray_begin_.data(), ray_count_.data(),
                              ray_gaussian_.data(), ray_weight_.data()});
    resize_pixels(executor, grid);
    for_each_n(executor, pixels, detail::CopyCounts{grid, ray_begin_.data(), wanted, count_.data()});
    resize_hits(executor, exclusive_scan(executor, count_.data(), begin_.data(), pixels));
    for_each_n(executor, pixels,
               detail::CopyHits{grid, ray_begin_.data(), ray_gaussian_.data(), begin_.data(), ray_weight_.data(),
                                gaussian_.data(), contribution_.data()});
  }

 private:
  void resize_pixels(const Executor<Backend>& executor, const SampleGrid& grid) {
    width_ = grid.width;
    height_ = grid.height;
    count_.resize_discard(executor, static_cast<std::size_t>(width_) * height_);
    begin_.resize_discard(executor, static_cast<std::size_t>(width_) * height_ + 1);
  }
  void resize_hits(const Executor<Backend>& executor, const ListSize& size) {
    size_ = size;
    gaussian_.resize_discard(executor, size.most);
    contribution_.resize_discard(executor, size.most);
  }

  int width_ = 0, height_ = 0;
  ListSize size_;
  Buffer<std::int32_t, Backend> count_, begin_, gaussian_, ray_count_, ray_begin_, ray_gaussian_;
  Buffer<Contribution, Backend> contribution_;
  Buffer<float, Backend> ray_weight_;
};

}  // namespace langgs
