// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "langgs/core/camera.hpp"
#include "langgs/frame/undistort.hpp"

namespace langgs::examples {

/// What a folder of images needs besides the images.
struct Calibration {
  Camera camera;
  double depth_scale = 1000;             ///< metres = stored 16-bit value / depth_scale
  std::optional<Distortion> distortion;  ///< of colour and depth; nothing where the source does not say
  double depth_delay = 0;                ///< how long after it was taken a depth image gets its time stamp [s]
  std::string source;                    ///< where the values come from, for people
};

/// Reads the one line `fx fy cx cy width height depth_scale [k1 k2 p1 p2 k3]`; # starts a comment line.
/// Throws IoError naming what is wrong.
[[nodiscard]] Calibration read_calibration(const std::filesystem::path& path);

/// The published values of the TUM RGB-D cameras, by a folder name that holds fr1, freiburg1, fr2, ... as a word.
[[nodiscard]] std::optional<Calibration> known_calibration(const std::filesystem::path& folder);

/// calibration.txt of a TUM folder, else the known values of its name; throws IoError that says how to write one.
[[nodiscard]] Calibration tum_calibration(const std::filesystem::path& folder);

/// Reads `cam_params.json` of the Replica folders of NICE-SLAM. Throws IoError.
[[nodiscard]] Calibration read_cam_params(const std::filesystem::path& path);

/// What `--distortion` asks for: "none", "auto" (the calibration's own coefficients, else those of a known camera
/// that the folder is named after, if the intrinsics agree), or "k1 k2 p1 p2 k3". Throws InvalidArgument.
[[nodiscard]] Distortion choose_distortion(const std::string& option, const Calibration& calibration,
                                           const std::filesystem::path& folder);

/// What `--depth-delay` asks for [s]: "auto" (that of a known camera that the folder is named after, else 0) or a
/// number. Throws InvalidArgument.
[[nodiscard]] double choose_depth_delay(const std::string& option, const std::filesystem::path& folder);

}  // namespace langgs::examples
