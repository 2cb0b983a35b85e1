// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>

#include "langgs/core/rng.hpp"

/// @file Procedural surfaces, filtered to the size of a pixel so that they do not alias at any distance.

namespace langgs::detail {

using Rgb = Eigen::Vector3f;

enum class Pattern : std::uint8_t { kPlain, kStripes, kChecks, kPlanks, kRings, kSky };

/// Two colours mixed by a pattern and darkened by smooth noise.
struct Material {
  Rgb first{0.5f, 0.5f, 0.5f};   ///< display colour in [0, 1]
  Rgb second{0.5f, 0.5f, 0.5f};  ///< the other colour of the pattern
  Pattern pattern = Pattern::kPlain;
  double period = 0.2;        ///< of the pattern [m]
  float grain = 0.25f;        ///< amplitude of the noise
  double grain_length = 0.2;  ///< longest wavelength of the noise [m]
  bool glows = false;         ///< shows its colour whatever the light
};

/// Smooth noise in [-1, 1] on a cubic lattice of random values.
[[nodiscard]] inline float lattice_noise(const Eigen::Vector3d& point, std::uint64_t seed) {
  const Eigen::Vector3d base = point.array().floor();
  const Eigen::Vector3d f = point - base;
  const Eigen::Array3d s = f.array().cube() * (f.array() * (f.array() * 6 - 15) + 10);
  const auto corner = [&](int i, int j, int k) {
    const auto cell = [](double v) { return static_cast<std::uint64_t>(static_cast<std::int64_t>(v)) & 0xFFFFF; };
    const std::uint64_t key = cell(base.x() + i) | cell(base.y() + j) << 20 | cell(base.z() + k) << 40;
    return static_cast<double>(mix64(key ^ seed) >> 40) * 0x1p-23 - 1;
  };
  const auto along_x = [&](int j, int k) { return (1 - s.x()) * corner(0, j, k) + s.x() * corner(1, j, k); };
  const auto along_y = [&](int k) { return (1 - s.y()) * along_x(0, k) + s.y() * along_x(1, k); };
  return static_cast<float>((1 - s.z()) * along_y(0) + s.z() * along_y(1));
}

/// Three octaves of noise; an octave fades out where its wavelength falls below two footprints.
[[nodiscard]] inline float filtered_noise(const Eigen::Vector3d& point, double length, double footprint,
                                          std::uint64_t seed) {
  float sum = 0, amplitude = 0.6f;
  for (int octave = 0; octave < 3; ++octave, length *= 0.5, amplitude *= 0.62f) {
    const double visible = std::clamp(length / (2 * footprint) - 0.5, 0.0, 1.0);
    if (visible <= 0) break;
    sum += amplitude * static_cast<float>(visible) * lattice_noise(point / length, seed + octave);
  }
  return sum;
}

/// The square wave (+1 on the first half of [0, 1), -1 on the second) averaged over a window of the given width.
[[nodiscard]] inline double filtered_square_wave(double x, double width) {
  const auto integral = [](double v) {
    const double f = v - std::floor(v);
    return f < 0.5 ? f : 1 - f;
  };
  width = std::max(width, 1e-3);
  return (integral(x + 0.5 * width) - integral(x - 0.5 * width)) / width;
}

/// Linear colour (display colour squared) of a surface point. `uv` are metres on the surface, `solid` metres in the
/// solid, `footprint` the size of a pixel on the surface in metres.
[[nodiscard]] inline Rgb surface_colour(const Material& material, const Eigen::Vector2d& uv,
                                        const Eigen::Vector3d& solid, double footprint, std::uint64_t seed) {
  double mix = 0;  // 0: first colour, 1: second
  const double width = 1.4 * footprint / material.period;
  const Eigen::Vector2d cell = uv / material.period;
  double tint = 1;
  switch (material.pattern) {
    case Pattern::kPlain:
      break;
    case Pattern::kStripes:
      mix = 0.5 + 0.5 * filtered_square_wave(cell.x(), width);
      break;
    case Pattern::kChecks:
      mix = 0.5 + 0.5 * filtered_square_wave(cell.x(), width) * filtered_square_wave(cell.y(), width);
      break;
    case Pattern::kRings:
      mix = 0.5 + 0.5 * filtered_square_wave(cell.norm(), width);
      break;
    case Pattern::kPlanks: {
      // Boards of one period across and eight along, each with its own tint, parted by a narrow dark joint.
      const double row = std::floor(cell.y());
      const CounterRng rng{seed, 11};
      const double along = cell.x() / 8 + rng.uniform(static_cast<std::uint64_t>(static_cast<std::int64_t>(row) + 999));
      const auto board = static_cast<std::uint64_t>(static_cast<std::int64_t>(row * 64 + std::floor(along)) + 99999);
      const double to_joint =
          std::min(0.5 - std::abs(cell.y() - row - 0.5), 8 * (0.5 - std::abs(along - std::floor(along) - 0.5)));
      const double joint = std::clamp(1 - to_joint / (0.06 + width), 0.0, 1.0) * 0.09 / (0.06 + width);
      mix = std::clamp(joint, 0.0, 1.0);
      tint = 0.82 + 0.36 * rng.uniform(board);
      break;
    }
    case Pattern::kSky:
      mix = std::clamp(0.5 + cell.y() + 0.6 * filtered_noise(solid, 0.5, footprint, seed), 0.0, 1.0);
      break;
  }
  const float noise = filtered_noise(solid, material.grain_length, footprint, seed);
  const Rgb display = (material.first + static_cast<float>(mix) * (material.second - material.first)) *
                      (static_cast<float>(tint) * (1 + material.grain * noise));
  return display.cwiseMax(0.f).cwiseAbs2();
}

}  // namespace langgs::detail
