// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "common/dataset.hpp"
#include "common/pipeline.hpp"
#include "langgs/eval/semantics.hpp"
#include "langgs/eval/trajectory.hpp"

namespace langgs::examples {

/// Where to look at the map from, and what was measured there.
struct EvaluatedView {
  int dataset_frame = 0;
  bool held_out = false;
  Pose T_world_camera = Pose::Identity();
};

/// Means over views. What no view has is absent.
struct ImageScore {
  int views = 0;
  std::optional<double> psnr_valid_depth, psnr_all, ssim, depth_l1_m;
};

struct Evaluation {
  std::optional<AteResult> ate;
  ImageScore keyframes, held_out;
  std::optional<SemanticScore> semantic_keyframes, semantic_held_out;
  std::optional<double> teacher_cosine;  ///< mean over the pixels of the keyframes' feature maps
};

struct EvaluationInput {
  const Dataset& dataset;
  std::vector<EvaluatedView> views;
  std::vector<StampedPose> trajectory;      ///< every processed frame
  const std::vector<float>& class_vectors;  ///< [labels, D]; empty: no semantic score
  int num_labels = 0;                       ///< rows of class_vectors
  bool ate = true;                          ///< false when poses were given
};

/// Scores a finished map. `progress(done, total)` is called after each view and returns false to stop early.
[[nodiscard]] Evaluation evaluate(Pipeline& pipeline, const EvaluationInput& input,
                                  const std::function<bool(int, int)>& progress);

/// 8-bit colours as [H, W, 3] in [0, 1].
[[nodiscard]] Image<float> unit_colours(const Image<std::uint8_t>& colour);

}  // namespace langgs::examples
