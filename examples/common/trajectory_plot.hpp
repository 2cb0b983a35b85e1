// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "langgs/eval/association.hpp"

namespace langgs::examples {

/// The camera's way from above the first camera (x to the right, z upwards), with a scale in metres; the reference,
/// if there is one, in grey behind it, both aligned as for the trajectory error.
[[nodiscard]] cv::Mat trajectory_picture(const std::vector<StampedPose>& estimate,
                                         const std::vector<StampedPose>& reference, int width, int height);

}  // namespace langgs::examples
