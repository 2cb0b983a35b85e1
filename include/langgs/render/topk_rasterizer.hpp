// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstdint>

#include "langgs/core/pose.hpp"
#include "langgs/device/buffer.hpp"
#include "langgs/device/launch.hpp"
#include "langgs/render/map_gradient.hpp"
#include "langgs/render/splat_list.hpp"
#include "langgs/render/tile_backward.hpp"
#include "langgs/render/tile_forward.hpp"
#include "langgs/render/weight_gradient.hpp"

namespace langgs {

/// Per-splat statistics of a render with Top-K recording.
struct SplatStatistics {
  const float* max_weight = nullptr;         ///< [V] largest blending weight over the image (S_i of one view)
  const std::int32_t* topk_count = nullptr;  ///< [V] pixels that have the Gaussian among their K largest weights
};

/// Per-splat statistics from those of its instances.
struct ReduceStatistics {
  const std::int32_t* slot_begin;
  const InstanceStatistics* slot;
  std::int32_t* topk_count;
  float* max_weight;
  LANGGS_HD void operator()(int c) const {
    std::int32_t count = 0;
    float most = 0;
    for (int s = slot_begin[c]; s < slot_begin[c + 1]; ++s) {
      count += slot[s].topk_count;
      most = max(most, slot[s].max_weight);
    }
    topk_count[c] = count;
    max_weight[c] = most;
  }
};

/// Renders colour and depth by alpha blending (paper Eq. 1) and records, in the same pass, the K Gaussians with the
/// largest blending weights of every pixel (Eq. 2); computes all gradients of a loss on colour and depth.
///
/// Only the recording depends on K. Buffers are reused from call to call. Results are the same bits for any number of
/// threads: one block owns a tile, one writer owns every value.
template <int K, class Backend = Host>
class TopKRasterizer {
  static_assert(K >= 1 && K <= 16, "TopKRasterizer<K>: K must be in [1, 16]; the paper uses 3");

 public:
  static constexpr int kK = K;

  /// Renders the map as seen by `view`. An empty map gives a black image.
  void render(const Executor<Backend>& executor, const PlanesView& map, const View& view, bool record_topk = true) {
    project(executor, map, view);
    (void)fits();
    draw(executor, map, record_topk);
  }

  /// `render` in two halves, for whoever does not want to wait in between: see SplatList. If it turns out that the view
  /// did not fit, its images are those of an empty map, and `draw` is to be said again.
  void project(const Executor<Backend>& executor, const PlanesView& map, const View& view) {
    splats_.count(executor, map, view);
  }
  [[nodiscard]] bool fits() { return splats_.fits(); }
  void draw(const Executor<Backend>& executor, const PlanesView& map, bool record_topk = true) {
    splats_.fill(executor, map);
    num_pixels_ = splats_.grid().width * splats_.grid().height;
    planes_.resize_discard(executor, static_cast<std::size_t>(5) * num_pixels_);
    if (record_topk)
      render_recording(executor);
    else
      launch(executor, splats_.grid().count(), TileForward<0>{splats_.grid(), splats_.instances(), rendered(), {}});
  }

  /// dL/d(parameters) of every visible Gaussian and dL/d(pose) of the view of the last `render`, which must have been
  /// given the same map. A TopKWeightGradient adds a loss on the weights that this render recorded.
  template <class WeightGradient = NoWeightGradient>
  void backward(const Executor<Backend>& executor, const PlanesView& map, const RenderGradient& upstream,
                MapGradient<Backend>& gradient, const WeightGradient& weight_gradient = {}) {
    slot_sums_.resize_discard(executor, static_cast<std::size_t>(splats_.num_instances()) * kSplatSumStride);
    launch(executor, splats_.grid().count(),
           TileBackwardWith<WeightGradient>{splats_.grid(), splats_.instances(), rendered(), upstream,
                                            slot_sums_.data(), weight_gradient});
    gradient.from_slot_sums(executor, map, splats_, slot_sums_.data());
  }

  [[nodiscard]] int num_pixels() const { return num_pixels_; }
  /// Colour [3, H, W], depth [H, W], transmittance [H, W] of the last render.
  [[nodiscard]] RenderPlanes rendered() {
    float* base = planes_.data();
    const std::ptrdiff_t n = num_pixels_;
    return {base, base + 3 * n, base + 4 * n};
  }
  /// [K, H, W] Gaussian indices, -1 where fewer than K contributed; largest weight first.
  [[nodiscard]] const std::int32_t* topk_id() const { return topk_id_.data(); }
  /// [K, H, W] raw blending weights, 0 where empty.
  [[nodiscard]] const float* topk_weight() const { return topk_weight_.data(); }
  [[nodiscard]] const SplatList<Backend>& splats() const { return splats_; }
  [[nodiscard]] SplatStatistics statistics() const { return {splat_max_weight_.data(), splat_topk_count_.data()}; }

 private:
  void render_recording(const Executor<Backend>& executor) {
    const int instances = splats_.num_instances(), places = instances + splats_.grid().count();
    for (auto* buffer : {&place_gaussian_, &place_count_}) buffer->resize_discard(executor, places);
    place_max_weight_.resize_discard(executor, places);
    slot_statistics_.resize_discard(executor, instances);
    topk_id_.resize_discard(executor, static_cast<std::size_t>(K) * num_pixels_);
    topk_weight_.resize_discard(executor, static_cast<std::size_t>(K) * num_pixels_);
    const TopKPlanes top{topk_id_.data(),        topk_weight_.data(), slot_statistics_.data(),
                         place_gaussian_.data(), place_count_.data(), place_max_weight_.data()};
    launch(executor, splats_.grid().count(), TileForward<K>{splats_.grid(), splats_.instances(), rendered(), top});

    splat_max_weight_.resize_discard(executor, splats_.num_splats());
    splat_topk_count_.resize_discard(executor, splats_.num_splats());
    for_each_n(executor, splats_.splats_size(),
               ReduceStatistics{splats_.slot_begin(), slot_statistics_.data(), splat_topk_count_.data(),
                                splat_max_weight_.data()});
  }

  SplatList<Backend> splats_;
  int num_pixels_ = 0;
  Buffer<float, Backend> planes_, slot_sums_, topk_weight_, place_max_weight_, splat_max_weight_;
  Buffer<std::int32_t, Backend> topk_id_, place_gaussian_, place_count_, splat_topk_count_;
  Buffer<InstanceStatistics, Backend> slot_statistics_;
};

}  // namespace langgs
