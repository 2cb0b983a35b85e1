// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <opencv2/core.hpp>

#include "langgs/core/camera.hpp"
#include "langgs/core/image.hpp"

/// @file Image files through OpenCV. All readers throw IoError naming the file and the remedy.

namespace langgs::examples {

/// [H, W, 3] RGB of a PNG or JPEG with 8 bits; grey is repeated, alpha dropped. The size must be the camera's.
[[nodiscard]] Image<std::uint8_t> read_colour(const std::filesystem::path& path, const Camera& camera);

/// [H, W] metres of a PNG with 16 bits: value / depth_scale. 0 and 65535 mean that nothing was measured.
[[nodiscard]] Image<float> read_depth(const std::filesystem::path& path, const Camera& camera, double depth_scale);

/// [H, W] labels of a PNG with 8 or 16 bits.
[[nodiscard]] Image<std::uint16_t> read_labels(const std::filesystem::path& path, const Camera& camera);

/// Writes a PNG (8-bit, BGR) that appears complete or not at all.
void write_png(const std::filesystem::path& path, const cv::Mat& image);

}  // namespace langgs::examples
