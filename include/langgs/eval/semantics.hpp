// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "langgs/core/error.hpp"
#include "langgs/core/image.hpp"

/// @file Semantic segmentation protocols: `labels_full`, `agreement_full`, `agreement_f3dgs`.

namespace langgs {

/// One label for each pixel [H, W].
using LabelImage = Image<std::int32_t>;

struct SemanticScore {
  double accuracy = 0;  ///< fraction of pixels with equal labels
  double mean_iou = 0;  ///< intersection over union, averaged over labels
};

/// Pixel counts of (reference label, predicted label) over a whole data set; classes are [0, num_classes).
class ConfusionMatrix {
 public:
  /// Pixels whose reference is `ignore_label` (any integer, e.g. 0 or 255) are not counted. If it is predicted
  /// elsewhere, that is a miss of the reference class, and of nothing else.
  explicit ConfusionMatrix(int num_classes, std::optional<std::int32_t> ignore_label = std::nullopt)
      : num_classes_(num_classes), ignore_label_(ignore_label) {
    constexpr int kMaxClasses = 4096;  // 128 MiB of counts
    LANGGS_EXPECTS(num_classes >= 1 && num_classes <= kMaxClasses, "number of classes is ", num_classes,
                   "; it must be in [1, ", kMaxClasses, "]");
    counts_.resize(static_cast<std::size_t>(num_classes) * columns());
  }

  /// Adds one image. Throws InvalidArgument, and adds nothing, if sizes differ or a label is not a class.
  void add(const LabelImage& reference, const LabelImage& predicted) {
    LANGGS_EXPECTS(reference.width() == predicted.width() && reference.height() == predicted.height() &&
                       reference.channels() == 1 && predicted.channels() == 1,
                   "label images are ", reference.width(), "x", reference.height(), " and ", predicted.width(), "x",
                   predicted.height(), "; they must be of one size with one channel");
    for (const LabelImage* image : {&reference, &predicted})
      for (std::size_t i = 0; i < image->size(); ++i) {
        const std::int32_t label = image->data()[i];
        LANGGS_EXPECTS((label >= 0 && label < num_classes_) || label == ignore_label_, "label ", label,
                       " is outside [0, ", num_classes_, "); raise the number of classes or ignore this label");
      }
    for (std::size_t i = 0; i < reference.size(); ++i) {
      const std::int32_t row = reference.data()[i], column = predicted.data()[i];
      if (row == ignore_label_) continue;
      ++counts_[row * columns() + (column == ignore_label_ ? num_classes_ : column)];
    }
  }

  /// Pixels of class `reference` that were predicted as `predicted`.
  [[nodiscard]] std::uint64_t count(int reference, int predicted) const {
    LANGGS_EXPECTS(reference >= 0 && reference < num_classes_ && predicted >= 0 && predicted < num_classes_, "class ",
                   reference, " or ", predicted, " is outside [0, ", num_classes_, ")");
    return counts_[reference * columns() + predicted];
  }

  /// Intersection over union of one class; nothing if it occurs neither in the reference nor in the prediction.
  [[nodiscard]] std::optional<double> iou(int label) const {
    const std::uint64_t intersection = count(label, label);
    std::uint64_t all = 0;
    for (int c = 0; c <= num_classes_; ++c) all += counts_[label * columns() + c];
    for (int r = 0; r < num_classes_; ++r) all += counts_[r * columns() + label];
    all -= intersection;
    if (all == 0) return std::nullopt;
    return static_cast<double>(intersection) / static_cast<double>(all);
  }

  /// Accuracy over all counted pixels; mean IoU over the classes that occur in the reference or the prediction.
  /// Nothing if no pixel was counted.
  [[nodiscard]] std::optional<SemanticScore> score() const {
    std::uint64_t equal = 0, all = 0;
    for (const std::uint64_t value : counts_) all += value;
    if (all == 0) return std::nullopt;
    double sum = 0;
    int present = 0;
    for (int c = 0; c < num_classes_; ++c) {
      equal += count(c, c);
      if (const auto value = iou(c)) {
        sum += *value;
        ++present;
      }
    }
    // A counted pixel has a reference class, so at least one class is present.
    return SemanticScore{static_cast<double>(equal) / static_cast<double>(all), sum / present};
  }

 private:
  [[nodiscard]] std::size_t columns() const { return static_cast<std::size_t>(num_classes_) + 1; }

  int num_classes_;
  std::optional<std::int32_t> ignore_label_;
  std::vector<std::uint64_t> counts_;  // [classes, classes + 1]; the last column is the ignored label
};

/// Accumulator of the protocol `labels_full`: predicted against ground-truth labels at full resolution, one confusion
/// matrix for the data set. `zero_is_undefined` leaves out pixels whose true label is 0.
[[nodiscard]] inline ConfusionMatrix labels_full(int num_classes, bool zero_is_undefined) {
  return ConfusionMatrix(num_classes, zero_is_undefined ? std::optional<std::int32_t>(0) : std::nullopt);
}

/// Accumulator of the protocol `agreement_full`: the student's labels against the teacher's (as reference), both by
/// argmax over the prompts at full resolution, one confusion matrix for the data set.
[[nodiscard]] inline ConfusionMatrix agreement_full(int num_prompts) { return ConfusionMatrix(num_prompts); }

/// Index of the largest score; the lowest of equal ones. NaN never wins; 0 if nothing else is there.
[[nodiscard]] inline std::int32_t argmax(std::span<const float> scores) {
  std::size_t best = 0;
  float value = -std::numeric_limits<float>::infinity();
  for (std::size_t i = 0; i < scores.size(); ++i)
    if (scores[i] > value) {
      value = scores[i];
      best = i;
    }
  return static_cast<std::int32_t>(best);
}

/// Label of each pixel of a score map [H, W, P] by argmax over P.
[[nodiscard]] inline LabelImage argmax_labels(const Image<float>& scores) {
  LabelImage labels(scores.width(), scores.height());
  const std::size_t channels = static_cast<std::size_t>(scores.channels());
  for (std::size_t i = 0; i < labels.size(); ++i) labels.data()[i] = argmax({scores.data() + i * channels, channels});
  return labels;
}

}  // namespace langgs
