// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "langgs/core/config.hpp"
#include "langgs/device/buffer.hpp"
#include "langgs/device/copy.hpp"
#include "langgs/device/launch.hpp"
#include "langgs/map/gaussian_map.hpp"
#include "langgs/render/contributions.hpp"
#include "langgs/render/feature_compositor.hpp"
#include "langgs/render/topk_rasterizer.hpp"
#include "langgs/slam/report.hpp"
#include "langgs/slam/teacher_cosine.hpp"

namespace langgs {

namespace detail {

/// score(g, r) = f_g . prompt_r for one Gaussian and all prompts. Prompts are transposed, so that the innermost loop
/// runs over them and needs no reordered sums to become SIMD.
template <int FeatDim, class Scalar>
struct ScorePrompts {
  const Scalar* features;  ///< [N, FeatDim]
  const float* columns;    ///< [FeatDim, rows]
  int rows;
  float* scores;  ///< [N, rows]
  LANGGS_HD void operator()(int g) const {
    const Scalar* const feature = features + static_cast<std::ptrdiff_t>(g) * FeatDim;
    float* const score = scores + static_cast<std::ptrdiff_t>(g) * rows;
    for (int r = 0; r < rows; ++r) score[r] = 0;
    for (int c = 0; c < FeatDim; ++c) {
      const float* const column = columns + static_cast<std::ptrdiff_t>(c) * rows;
      const float value = static_cast<float>(feature[c]);
      for (int r = 0; r < rows; ++r) score[r] += value * column[r];
    }
  }
};

/// The row from 1 on with the largest composited score; 0 where nothing is seen.
struct PickLabel {
  ContributionView hits;
  const float* scores;  ///< [N, rows]
  int rows;
  std::uint16_t* label;
  LANGGS_HD void operator()(int p) const {
    int best = 0;
    float best_score = 0;
    for (int r = 1; r < rows && hits.begin[p] < hits.begin[p + 1]; ++r) {
      float score = 0;
      for (int i = hits.begin[p]; i < hits.begin[p + 1]; ++i)
        score += hits.contribution[i].weight * scores[static_cast<std::ptrdiff_t>(hits.gaussian[i]) * rows + r];
      if (best == 0 || score > best_score) {
        best = r;
        best_score = score;
      }
    }
    label[p] = static_cast<std::uint16_t>(best);
  }
};

}  // namespace detail

/// Renders a map for looking at and for evaluation; mapping has its own rasteriser.
template <int FeatDim, int K, class Backend = Host>
class ViewRenderer {
 public:
  template <class Map>
  [[nodiscard]] RenderedImages images(const Executor<Backend>& executor, const Map& map, const View& view) {
    rasterizer_.render(executor, map.geometry(), view, /*record_topk=*/false);
    const int width = view.camera.width, height = view.camera.height, n = view.camera.num_pixels();
    RenderedImages images{Image<float>(width, height, 3), Image<float>(width, height), Image<float>(width, height)};
    // [5, H, W]: colour, depth, transmittance
    const float* const planes = planes_(executor, rasterizer_.rendered().colour, static_cast<std::size_t>(5) * n);
    const auto plane = [&](int i) { return planes + static_cast<std::ptrdiff_t>(i) * n; };
    for (int p = 0; p < n; ++p) {
      for (int c = 0; c < 3; ++c) images.colour.data()[3 * p + c] = plane(c)[p];
      images.depth.data()[p] = plane(3)[p];
      images.transmittance.data()[p] = plane(4)[p];
    }
    return images;
  }

  /// [grid.height, grid.width, FeatDim] (paper Eq. 4); zeros where nothing is seen.
  template <class Map>
  [[nodiscard]] std::vector<float> features(const Executor<Backend>& executor, const Map& map, const View& view,
                                            const SampleGrid& grid) {
    LANGGS_EXPECTS(grid.width > 0 && grid.height > 0 && grid.width <= 16384 && grid.height <= 16384,
                   "feature image is ", grid.width, "x", grid.height, "; each side must be in [1, 16384]");
    rasterizer_.render(executor, map.geometry(), view);
    contributions_.from_topk(executor, rasterizer_, grid);
    std::vector<float> out(static_cast<std::size_t>(grid.width) * grid.height * FeatDim);
    compute_to_host(executor, out.data(), out.size(), [&](float* to) {
      composite_features<FeatDim>(executor, contributions_.view(), map.features().data(), to);
    });
    return out;
  }

  /// How near the features of the view come to a teacher's at the samples of `grid`; `cosine` takes the sum. `teacher`:
  /// its features and where there are any, in the backend's memory.
  template <class Map>
  void compare(const Executor<Backend>& executor, const Map& map, const View& view, const SampleGrid& grid,
               const std::pair<const Half*, const std::uint8_t*>& teacher, TeacherCosine& cosine) {
    rasterizer_.render(executor, map.geometry(), view);
    contributions_.from_topk(executor, rasterizer_, grid, teacher.second);
    cosine.add<FeatDim>(executor, contributions_.view(), map.features().data(), teacher.first);
  }

  /// argmax over the rows of `class_vectors` of F(p) . t / |t|. The compositing is linear, so each Gaussian is compared
  /// with the prompts once and the scores are composited instead of the features.
  template <class Map>
  [[nodiscard]] Image<std::uint16_t> labels(const Executor<Backend>& executor, const Map& map, const View& view,
                                            const std::vector<float>& class_vectors) {
    LANGGS_EXPECTS(!class_vectors.empty() && class_vectors.size() % FeatDim == 0, "class vectors hold ",
                   class_vectors.size(), " values; give [num_classes + 1, ", FeatDim, "]");
    const int rows = static_cast<int>(class_vectors.size() / FeatDim);
    LANGGS_EXPECTS(rows <= 65536, "there are ", rows, " class vectors; labels have 16 bits: give at most 65536");
    const std::vector<float> prompts = unit_rows(class_vectors);
    std::vector<float> columns(prompts.size());
    for (int r = 0; r < rows; ++r)
      for (int c = 0; c < FeatDim; ++c)
        columns[static_cast<std::size_t>(c) * rows + r] = prompts[static_cast<std::size_t>(r) * FeatDim + c];
    Upload<float, Backend> upload;
    using Scalar = typename Map::Scalar;
    scores_.resize_discard(executor, static_cast<std::size_t>(map.size()) * rows);
    for_each_n(executor, map.size(),
               detail::ScorePrompts<FeatDim, Scalar>{
                   map.features().data(), upload(executor, columns.data(), columns.size()), rows, scores_.data()});
    rasterizer_.render(executor, map.geometry(), view);
    contributions_.from_topk(executor, rasterizer_, {view.camera.width, view.camera.height, view.camera});
    const ContributionView hits = contributions_.view();
    Image<std::uint16_t> labels(view.camera.width, view.camera.height);
    compute_to_host(executor, labels.data(), labels.size(), [&](std::uint16_t* to) {
      for_each_n(executor, hits.num_pixels(), detail::PickLabel{hits, scores_.data(), rows, to});
    });
    return labels;
  }

 private:
  /// Each row at unit length, zeros where it has none: the class with the longest vector must not win by that.
  [[nodiscard]] static std::vector<float> unit_rows(std::vector<float> rows) {
    for (std::size_t begin = 0; begin < rows.size(); begin += FeatDim) {
      double norm2 = 0;
      for (std::size_t i = begin; i < begin + FeatDim; ++i) norm2 += static_cast<double>(rows[i]) * rows[i];
      LANGGS_EXPECTS(std::isfinite(norm2), "class vector ", begin / FeatDim,
                     " holds a value that is not finite; check the file it comes from");
      const double scale = norm2 > 0 ? 1 / std::sqrt(norm2) : 0;
      for (std::size_t i = begin; i < begin + FeatDim; ++i) rows[i] = static_cast<float>(rows[i] * scale);
    }
    return rows;
  }

  TopKRasterizer<K, Backend> rasterizer_;
  Contributions<Backend> contributions_;
  Buffer<float, Backend> scores_;
  Download<float, Backend> planes_;
};

}  // namespace langgs
