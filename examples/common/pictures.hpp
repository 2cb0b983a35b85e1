// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "common/evaluation.hpp"
#include "common/pipeline.hpp"

namespace langgs::examples {

struct PictureInput {
  const Dataset& dataset;
  std::vector<EvaluatedView> views;  ///< shown one below the other
  std::vector<StampedPose> trajectory;
  const std::vector<float>& class_vectors;  ///< [labels, D]; empty: no label pictures
  int feature_dim = 0;                      ///< 0: no feature pictures
  std::string title, subtitle;
};

/// A few of the views, evenly chosen: keyframes first, then held-out ones.
[[nodiscard]] std::vector<EvaluatedView> views_to_show(const std::vector<EvaluatedView>& views);

/// Writes `folder`/NAME_KIND.png for each view (what was measured beside what the map shows) and `folder`/overview.png,
/// a sheet with all of them, a legend and the trajectory. Pictures of an earlier run are removed. Returns the paths,
/// the overview first.
std::vector<std::filesystem::path> write_pictures(Pipeline& pipeline, const PictureInput& input,
                                                  const std::filesystem::path& folder);

}  // namespace langgs::examples
