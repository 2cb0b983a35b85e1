// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "langgs/core/error.hpp"
#include "langgs/core/half.hpp"
#include "langgs/device/algorithm.hpp"
#include "langgs/device/buffer.hpp"
#include "langgs/device/copy.hpp"
#include "langgs/device/launch.hpp"
#include "langgs/frame/feature_map.hpp"
#include "langgs/optimize/masked_images.hpp"
#include "langgs/render/contributions.hpp"
#include "langgs/render/topk_rasterizer.hpp"
#include "langgs/render/weight_gradient.hpp"

/// @file The gradient of the feature loss with respect to the recorded blending weights, for those who want language to
/// move geometry. The paper decouples the two (section 3.4); nothing here runs unless it is asked for.

namespace langgs {
namespace detail {

/// The loss of each sample and what it says about the sample's recorded weights, one warp a sample:
///   F = sum_k w'_k f_k,  w'_k = w_k / sum_j w_j,  slope_k = (f_k - F) . sign(F - F*) / sum_j w_j.
/// With one hit F = f, and the slope is exactly 0.
template <int FeatDim, int K, class T>
struct FeatureWeightSlopes {
  static constexpr int kThreads = 128;
  static constexpr int kWarps = kThreads / 32;
  template <class Block>
  struct Shared {};

  SampleGrid grid;         ///< of n samples
  const std::int32_t* id;  ///< [K, H, W]
  const float* weight;     ///< [K, H, W]
  const T* features;       ///< [N, FeatDim]
  const Half* teacher;     ///< [n, FeatDim]; all zeros where there is no teacher
  float* slope;            ///< [K, n]; 0 where empty and where the sample teaches nothing
  float* loss;             ///< [n] sum over channels of |F - F*|; 0 where the sample teaches nothing
  float* teaches;          ///< [n] 1 or 0

  template <class Block>
  LANGGS_HD void operator()(Block& block, Shared<Block>&) const {
    using F = VaryingOf<float, Block>;
    block.warps([&](const auto& warp) {
      const int p = block.index() * kWarps + warp.index(), n = grid.width * grid.height;
      if (p >= n) return;
      const std::ptrdiff_t plane = grid.camera.num_pixels(), pixel = grid.pixel(p);
      int gaussian[K];
      float share[K], total = 0;
      LANGGS_UNROLL
      for (int k = 0; k < K; ++k) {
        gaussian[k] = id[k * plane + pixel];
        share[k] = gaussian[k] >= 0 ? weight[k * plane + pixel] : 0.f;
        total += share[k];
      }
      const bool is_hit = total > 0.f;
      LANGGS_UNROLL
      for (int k = 0; k < K; ++k) share[k] = is_hit ? share[k] / total : 0.f;

      F difference_sum(0.f), teacher_sum(0.f), slopes[K];
      LANGGS_UNROLL
      for (int k = 0; k < K; ++k) slopes[k] = F(0.f);
      for (int c = 0; c < FeatDim; c += 32) {
        F mean(0.f), feature[K];
        LANGGS_UNROLL
        for (int k = 0; k < K; ++k) {
          feature[k] = F(0.f);
          if (gaussian[k] < 0) continue;
          feature[k] =
              warp.load_channels(features + static_cast<std::ptrdiff_t>(gaussian[k]) * FeatDim + c, FeatDim - c);
          mean += share[k] * feature[k];
        }
        const F target = warp.load_channels(teacher + static_cast<std::ptrdiff_t>(p) * FeatDim + c, FeatDim - c);
        const F difference = mean - target, sign = l1_gradient(difference, 1.f);  // 0 in the lanes beyond the row
        difference_sum += abs(difference);
        teacher_sum += abs(target);
        LANGGS_UNROLL
        for (int k = 0; k < K; ++k) slopes[k] += (feature[k] - mean) * sign;
      }
      const bool does_teach = is_hit && warp.sum(teacher_sum) > 0.f;
      loss[p] = does_teach ? warp.sum(difference_sum) : 0.f;
      teaches[p] = does_teach ? 1.f : 0.f;
      LANGGS_UNROLL
      for (int k = 0; k < K; ++k)
        slope[static_cast<std::ptrdiff_t>(k) * n + p] =
            does_teach && gaussian[k] >= 0 ? warp.sum(slopes[k]) / total : 0.f;
    });
  }
};

/// gradient[k, pixel of sample p] = weight / values * slope[k, p], where `values` are the channels of the samples that
/// teach. No two samples may share a pixel.
struct ScatterSlopes {
  SampleGrid grid;
  int k, channels;
  float weight;
  const double* num_teaching;  ///< of the samples
  const float* slope;          ///< [K, n]
  float* gradient;             ///< [K, H, W]

  LANGGS_HD void operator()(int p) const {
    const std::ptrdiff_t n = grid.width * grid.height, plane = grid.camera.num_pixels();
    const double values = *num_teaching * channels;
    const float scale = values > 0 ? static_cast<float>(static_cast<double>(weight) / values) : 0.f;
    for (int i = 0; i < k; ++i) gradient[i * plane + grid.pixel(p)] = scale * slope[i * n + p];
  }
};

}  // namespace detail

/// dL/dw [K, H, W] of L = weight * mean |F - F*| (mean over the samples that teach and all channels, as FeatureStep),
/// through the Top-K weights that a rasteriser recorded. Which Gaussians are among the K is taken as given.
///
///     const double loss = on_weights.evaluate(executor, rasterizer, grid, features, teacher, lambda);
///     rasterizer.backward(executor, map, upstream, gradient, on_weights.view());
template <int FeatDim, int K, class Backend = Host>
class FeatureWeightGradient {
 public:
  /// Returns mean |F - F*|; 0 where no sample teaches, and then the gradient is 0 too.
  /// The last render must have recorded Top-K with the grid's camera. `features` are [N, FeatDim], float or Half; the
  /// teacher has a pixel for each sample of the grid, which must not be finer than the image.
  template <class T>
  double evaluate(const Executor<Backend>& executor, const TopKRasterizer<K, Backend>& rasterizer,
                  const SampleGrid& grid, const T* features, const FeatureMap<FeatDim>& teacher, float weight = 1) {
    LANGGS_EXPECTS(grid.width == teacher.width() && grid.height == teacher.height(), "there are ", grid.width, "x",
                   grid.height, " samples, the teacher has ", teacher.width(), "x", teacher.height());
    const std::size_t values = static_cast<std::size_t>(grid.width) * grid.height * FeatDim;
    start(executor, rasterizer, grid, features, teacher_(executor, teacher.pixel(0, 0), values), weight);
    double sums[2];
    copy_to_host(executor, sums_.data(), 2, sums);
    return sums[1] > 0 ? sums[0] / (sums[1] * FeatDim) : 0;
  }

  /// The gradient alone, for whoever does not want to wait for the loss. `teacher` [grid.height, grid.width, FeatDim]
  /// is in the backend's memory, with zeros where there is none.
  template <class T>
  void start(const Executor<Backend>& executor, const TopKRasterizer<K, Backend>& rasterizer, const SampleGrid& grid,
             const T* features, const Half* teacher, float weight = 1) {
    using Slopes = detail::FeatureWeightSlopes<FeatDim, K, T>;
    LANGGS_EXPECTS(grid.camera.num_pixels() == rasterizer.num_pixels(), "the samples are for an image of ",
                   grid.camera.width, "x", grid.camera.height, ", the rendered one has ", rasterizer.num_pixels(),
                   " pixels");
    LANGGS_EXPECTS(
        grid.width >= 1 && grid.width <= grid.camera.width && grid.height >= 1 && grid.height <= grid.camera.height,
        grid.width, "x", grid.height, " samples of an image of ", grid.camera.width, "x", grid.camera.height,
        "; for gradients there must be some, and no two may share a pixel");
    LANGGS_EXPECTS(std::isfinite(weight), "the weight of the feature loss is ", weight);
    const int n = grid.width * grid.height;
    const std::size_t places = static_cast<std::size_t>(K) * grid.camera.num_pixels();
    slope_.resize_discard(executor, static_cast<std::size_t>(K) * n);
    rows_.resize_discard(executor, static_cast<std::size_t>(2) * n);
    launch(executor, (n + Slopes::kWarps - 1) / Slopes::kWarps,
           Slopes{grid, rasterizer.topk_id(), rasterizer.topk_weight(), features, teacher, slope_.data(), rows_.data(),
                  rows_.data() + n});
    sums_.resize_discard(executor, 2);
    sum_rows(executor, rows_.data(), n, n, 2, sums_.data());
    gradient_.resize_discard(executor, places);
    gradient_.fill(executor, 0.f);
    view_ = {rasterizer.topk_id(), rasterizer.topk_weight(), gradient_.data()};
    for_each_n(executor, n,
               detail::ScatterSlopes{grid, K, FeatDim, weight, sums_.data() + 1, slope_.data(), gradient_.data()});
  }

  /// For TopKRasterizer::backward; valid until the rasteriser's next render.
  [[nodiscard]] const TopKWeightGradient<K>& view() const { return view_; }

 private:
  TopKWeightGradient<K> view_;
  Upload<Half, Backend> teacher_;
  Buffer<float, Backend> slope_, rows_, gradient_;
  Buffer<double, Backend> sums_;  ///< of the losses, and the number of samples that teach
};

}  // namespace langgs
