// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "langgs/core/error.hpp"
#include "langgs/core/pose.hpp"
#include "langgs/eval/association.hpp"
#include "langgs/io/atomic_file.hpp"
#include "langgs/io/text.hpp"

namespace langgs {

/// Reads `timestamp tx ty tz qx qy qz qw` lines (camera to world; seconds, metres) in their order, whatever their
/// times. Quaternions are normalised. # starts a comment line. Throws IoError naming the line; also for a file without
/// poses.
[[nodiscard]] inline std::vector<StampedPose> read_tum_trajectory(const std::filesystem::path& path) {
  constexpr std::uint64_t kMaxBytes = std::uint64_t{1} << 30;
  constexpr double kMaxMagnitude = 1e15;  // far beyond any time or place, and its square is still finite
  const std::string content = read_file(path, kMaxBytes);
  std::vector<StampedPose> poses;
  std::string_view rest = content, line;
  for (int number = 1; detail::next_line(rest, line); ++number) {
    std::string_view words = detail::meaningful(line);
    if (words.empty()) continue;
    const auto fail = [&](const char* what) {
      detail::raise<IoError>(path.string(), ":", number, ": ", what, " in '", detail::excerpt(line),
                             "'; expected 'timestamp tx ty tz qx qy qz qw'");
    };
    std::array<double, 8> v{};
    for (double& value : v) {
      const auto parsed = detail::parse_number(detail::next_word(words));
      if (!parsed) fail("a number is missing, malformed or not finite");
      value = *parsed;
    }
    if (!detail::trimmed(words).empty()) fail("more than eight numbers");
    for (std::size_t i = 1; i < v.size(); ++i)
      if (std::abs(v[i]) > kMaxMagnitude) fail("a number beyond 1e15");
    const Eigen::Quaterniond rotation(v[7], v[4], v[5], v[6]);
    if (rotation.norm() < 1e-9) fail("a zero quaternion");
    StampedPose pose;
    pose.timestamp = v[0];
    pose.T_world_camera.linear() = rotation.normalized().toRotationMatrix();
    pose.T_world_camera.translation() = Eigen::Vector3d(v[1], v[2], v[3]);
    poses.push_back(pose);
  }
  if (poses.empty())
    detail::raise<IoError>(path.string(), " has no poses; it needs lines 'timestamp tx ty tz qx qy qz qw'");
  return poses;
}

/// Writes poses in the TUM format: microseconds for the time, nine significant digits elsewhere, qw not negative.
/// The same poses give the same bytes on every machine. Throws InvalidArgument for a pose that is not finite.
inline void write_tum_trajectory(const std::filesystem::path& path, std::span<const StampedPose> poses) {
  std::string text;
  std::array<char, 400> buffer;  // a double in fixed notation has up to 317 characters with six decimals
  for (const StampedPose& pose : poses) {
    LANGGS_EXPECTS(std::isfinite(pose.timestamp) && is_finite(pose.T_world_camera), "pose at time ", pose.timestamp,
                   " is not finite; drop it before writing ", path.string());
    Eigen::Quaterniond q = Eigen::Quaterniond(Eigen::Matrix3d(pose.T_world_camera.linear())).normalized();
    if (q.w() < 0) q.coeffs() = -q.coeffs();
    const Eigen::Vector3d t = pose.T_world_camera.translation();
    const auto time_end =
        std::to_chars(buffer.data(), buffer.data() + buffer.size(), pose.timestamp, std::chars_format::fixed, 6).ptr;
    text.append(buffer.data(), time_end);
    for (const double value : {t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w()}) {
      // Adding zero turns -0 into 0, which would otherwise depend on how the pose was computed.
      const auto end =
          std::to_chars(buffer.data(), buffer.data() + buffer.size(), value + 0.0, std::chars_format::general, 9).ptr;
      text += ' ';
      text.append(buffer.data(), end);
    }
    text += '\n';
  }
  AtomicFile file(path);
  file.write(text);
  file.commit();
}

}  // namespace langgs
