// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "langgs/map/gaussian_map.hpp"
#include "langgs/render/contributions.hpp"
#include "langgs/render/feature_compositor.hpp"
#include "langgs/render/topk_rasterizer.hpp"
#include "langgs/slam/report.hpp"
#include "langgs/slam/teacher_cosine.hpp"

namespace langgs {

/// Renders a map for looking at and for evaluation; mapping has its own rasteriser.
template <int FeatDim, int K>
class ViewRenderer {
 public:
  template <class Map>
  [[nodiscard]] RenderedImages images(const Executor<Host>& executor, const Map& map, const View& view) {
    rasterizer_.render(executor, map.geometry(), view, /*record_topk=*/false);
    const int width = view.camera.width, height = view.camera.height, n = view.camera.num_pixels();
    RenderedImages images{Image<float>(width, height, 3), Image<float>(width, height), Image<float>(width, height)};
    const RenderPlanes planes = rasterizer_.rendered();
    for (int p = 0; p < n; ++p) {
      for (int c = 0; c < 3; ++c)
        images.colour.data()[3 * p + c] = planes.colour[static_cast<std::ptrdiff_t>(c) * n + p];
      images.depth.data()[p] = planes.depth[p];
      images.transmittance.data()[p] = planes.transmittance[p];
    }
    return images;
  }

  /// [grid.height, grid.width, FeatDim] (paper Eq. 4); zeros where nothing is seen.
  template <class Map>
  [[nodiscard]] std::vector<float> features(const Executor<Host>& executor, const Map& map, const View& view,
                                            const SampleGrid& grid) {
    LANGGS_EXPECTS(grid.width > 0 && grid.height > 0 && grid.width <= 16384 && grid.height <= 16384,
                   "feature image is ", grid.width, "x", grid.height, "; each side must be in [1, 16384]");
    rasterizer_.render(executor, map.geometry(), view);
    contributions_.from_topk(executor, rasterizer_, grid);
    std::vector<float> out(static_cast<std::size_t>(grid.width) * grid.height * FeatDim);
    composite_features<FeatDim>(executor, contributions_.view(), map.features().data(), out.data());
    return out;
  }

  /// How near the features of the view come to a teacher's; `cosine` takes the sum.
  template <class Map>
  void compare(const Executor<Host>& executor, const Map& map, const View& view, const FeatureMap<FeatDim>& teacher,
               TeacherCosine& cosine) {
    rasterizer_.render(executor, map.geometry(), view);
    contributions_.from_topk(executor, rasterizer_, {teacher.width(), teacher.height(), view.camera},
                             teacher.present());
    cosine.add(executor, contributions_.view(), map.features().data(), teacher);
  }

  /// argmax over the rows of `class_vectors` of F(p) . t / |t|. The compositing is linear, so each Gaussian is compared
  /// with the prompts once and the scores are composited instead of the features.
  template <class Map>
  [[nodiscard]] Image<std::uint16_t> labels(const Executor<Host>& executor, const Map& map, const View& view,
                                            const std::vector<float>& class_vectors) {
    LANGGS_EXPECTS(!class_vectors.empty() && class_vectors.size() % FeatDim == 0, "class vectors hold ",
                   class_vectors.size(), " values; give [num_classes + 1, ", FeatDim, "]");
    const int rows = static_cast<int>(class_vectors.size() / FeatDim);
    LANGGS_EXPECTS(rows <= 65536, "there are ", rows, " class vectors; labels have 16 bits: give at most 65536");
    const std::vector<float> prompts = unit_rows(class_vectors);
    // Transposed, so that the innermost loop runs over prompts and needs no reordered sums to become SIMD.
    std::vector<float> columns(prompts.size());
    for (int r = 0; r < rows; ++r)
      for (int c = 0; c < FeatDim; ++c)
        columns[static_cast<std::size_t>(c) * rows + r] = prompts[static_cast<std::size_t>(r) * FeatDim + c];
    scores_.assign(static_cast<std::size_t>(map.size()) * rows, 0.f);
    for_each_n(executor, map.size(), [&](int g) {
      const auto* feature = map.features().row(g);
      float* score = scores_.data() + static_cast<std::size_t>(g) * rows;
      for (int c = 0; c < FeatDim; ++c) {
        const float* column = columns.data() + static_cast<std::size_t>(c) * rows;
        const float value = static_cast<float>(feature[c]);
        for (int r = 0; r < rows; ++r) score[r] += value * column[r];
      }
    });
    rasterizer_.render(executor, map.geometry(), view);
    contributions_.from_topk(executor, rasterizer_, {view.camera.width, view.camera.height, view.camera});
    const ContributionView hits = contributions_.view();
    Image<std::uint16_t> labels(view.camera.width, view.camera.height);
    for_each_n(executor, hits.num_pixels(), [&](int p) {
      int best = 0;
      float best_score = 0;
      for (int r = 1; r < rows && hits.begin[p] < hits.begin[p + 1]; ++r) {
        float score = 0;
        for (int i = hits.begin[p]; i < hits.begin[p + 1]; ++i)
          score += hits.contribution[i].weight * scores_[static_cast<std::size_t>(hits.gaussian[i]) * rows + r];
        if (best == 0 || score > best_score) {
          best = r;
          best_score = score;
        }
      }
      labels.data()[p] = static_cast<std::uint16_t>(best);
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

  TopKRasterizer<K, Host> rasterizer_;
  Contributions<Host> contributions_;
  std::vector<float> scores_;
};

}  // namespace langgs
