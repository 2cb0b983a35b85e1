// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "langgs/core/error.hpp"
#include "langgs/core/image.hpp"
#include "langgs/eval/semantics.hpp"

/// @file Protocol `agreement_f3dgs`: how Feature 3DGS (Zhou et al. 2024) scores a distilled feature field against its
/// teacher. It ignores rare labels and fine detail, so its figures compare with those of that family only.

namespace langgs {

/// The constants of the protocol.
struct F3dgsProtocol {
  int max_width = 480;                              ///< wider images have their maps resized before the argmax
  int resized_width = 480, resized_height = 360;    ///< to this size, bilinear, corners aligned
  int label_width = 159, label_height = 119;        ///< label maps are resized to this size, nearest
  int num_labels = 7;                               ///< the IoU is averaged over so many most frequent labels
  std::vector<std::pair<int, int>> label_merges{};  ///< (from, to), applied once each in this order to every label
};

inline void validate(const F3dgsProtocol& p) {
  LANGGS_EXPECTS(
      p.max_width >= 1 && p.resized_width >= 1 && p.resized_height >= 1 && p.label_width >= 1 && p.label_height >= 1 &&
          p.num_labels >= 1,
      "a size of the agreement_f3dgs protocol is not positive; its defaults are 480, 480x360, 159x119 and 7");
}

/// A map of `channels` values per pixel that need not exist as an image: `read(x, y, out)` writes them to `out`.
template <class Read>
struct PixelMap {
  int width = 0, height = 0, channels = 0;
  Read read;
};

/// Label map of the protocol for one image. `map` holds features or scores of any resolution, `image_width` is the
/// width of the camera's image, which decides about the first resize; `classify(const float* values)` gives the label
/// of one pixel's `map.channels` values. Only the pixels that survive the last resize are computed.
template <class Read, class Classify>
[[nodiscard]] LabelImage f3dgs_labels(const PixelMap<Read>& map, int image_width, Classify&& classify,
                                      const F3dgsProtocol& protocol = {}) {
  validate(protocol);
  LANGGS_EXPECTS(map.width > 0 && map.height > 0 && map.channels > 0, "map is [", map.height, ", ", map.width, ", ",
                 map.channels, "]; it must not be empty");
  LANGGS_EXPECTS(image_width > 0, "image width is ", image_width, "; it must be positive");
  const bool resize = image_width > protocol.max_width;
  const int width = resize ? protocol.resized_width : map.width;
  const int height = resize ? protocol.resized_height : map.height;
  const std::size_t channels = static_cast<std::size_t>(map.channels);
  std::vector<float> corner[4], values(channels);
  for (std::vector<float>& c : corner) c.resize(channels);

  const auto sample = [&](int x, int y) {
    // Corners aligned: the first and last pixel centres of both grids coincide.
    const double u = width > 1 ? double(x) * (map.width - 1) / (width - 1) : 0;
    const double v = height > 1 ? double(y) * (map.height - 1) / (height - 1) : 0;
    const int x0 = static_cast<int>(u), y0 = static_cast<int>(v);
    const int x1 = std::min(x0 + 1, map.width - 1), y1 = std::min(y0 + 1, map.height - 1);
    const float ax = static_cast<float>(u - x0), ay = static_cast<float>(v - y0);
    map.read(x0, y0, corner[0].data());
    map.read(x1, y0, corner[1].data());
    map.read(x0, y1, corner[2].data());
    map.read(x1, y1, corner[3].data());
    for (std::size_t c = 0; c < channels; ++c)
      values[c] =
          (1 - ay) * ((1 - ax) * corner[0][c] + ax * corner[1][c]) + ay * ((1 - ax) * corner[2][c] + ax * corner[3][c]);
  };

  LabelImage labels(protocol.label_width, protocol.label_height);
  for (int j = 0; j < protocol.label_height; ++j) {
    const int y = static_cast<int>(std::int64_t{j} * height / protocol.label_height);
    for (int i = 0; i < protocol.label_width; ++i) {
      const int x = static_cast<int>(std::int64_t{i} * width / protocol.label_width);
      if (resize)
        sample(x, y);
      else
        map.read(x, y, values.data());
      std::int32_t label = classify(static_cast<const float*>(values.data()));
      for (const auto& [from, to] : protocol.label_merges)
        if (label == from) label = to;
      labels(i, j) = label;
    }
  }
  return labels;
}

/// The same for a score map [H, W, P] by argmax over P. The scores must be dot products of unit prompts with features
/// as stored or rendered: resizing such scores equals resizing the features, and their length does not move the argmax.
[[nodiscard]] inline LabelImage f3dgs_labels(const Image<float>& scores, int image_width,
                                             const F3dgsProtocol& protocol = {}) {
  const auto read = [&](int x, int y, float* out) { std::copy_n(&scores(x, y), scores.channels(), out); };
  LANGGS_EXPECTS(!scores.empty(), "score map is empty");
  const std::size_t channels = static_cast<std::size_t>(scores.channels());
  const PixelMap<decltype(read)> map{scores.width(), scores.height(), scores.channels(), read};
  return f3dgs_labels(
      map, image_width,
      [&](const float* v) {
        return argmax({v, channels});
      },
      protocol);
}

/// Score of one image from two label maps of f3dgs_labels: fraction of equal pixels, and IoU averaged over the labels
/// most frequent in both maps together (of equally frequent ones the lower label first).
[[nodiscard]] inline SemanticScore agreement_f3dgs(const LabelImage& teacher, const LabelImage& student,
                                                   const F3dgsProtocol& protocol = {}) {
  validate(protocol);
  LANGGS_EXPECTS(!teacher.empty() && teacher.width() == student.width() && teacher.height() == student.height() &&
                     teacher.channels() == 1 && student.channels() == 1,
                 "label maps are ", teacher.width(), "x", teacher.height(), " and ", student.width(), "x",
                 student.height(), "; they must be of one size and not empty");
  struct Count {
    std::size_t both = 0, sum = 0;
  };
  std::map<std::int32_t, Count> counts;
  std::size_t equal = 0;
  for (std::size_t i = 0; i < teacher.size(); ++i) {
    const std::int32_t a = teacher.data()[i], b = student.data()[i];
    ++counts[a].sum;
    ++counts[b].sum;
    if (a == b) {
      ++counts[a].both;
      ++equal;
    }
  }
  std::vector<Count> order;  // by rising label
  for (const auto& [label, count] : counts) order.push_back(count);
  std::stable_sort(order.begin(), order.end(), [](const Count& a, const Count& b) { return a.sum > b.sum; });
  order.resize(std::min(order.size(), static_cast<std::size_t>(protocol.num_labels)));
  double iou = 0;
  for (const Count& count : order) iou += static_cast<double>(count.both) / static_cast<double>(count.sum - count.both);
  return {static_cast<double>(equal) / static_cast<double>(teacher.size()), iou / static_cast<double>(order.size())};
}

/// Mean over images; nothing if there are none.
[[nodiscard]] inline std::optional<SemanticScore> mean_score(std::span<const SemanticScore> images) {
  if (images.empty()) return std::nullopt;
  SemanticScore mean;
  for (const SemanticScore& image : images) {
    mean.accuracy += image.accuracy / static_cast<double>(images.size());
    mean.mean_iou += image.mean_iou / static_cast<double>(images.size());
  }
  return mean;
}

}  // namespace langgs
