// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "langgs/core/error.hpp"
#include "langgs/io/atomic_file.hpp"
#include "langgs/io/ply_header.hpp"

/// @file Splats in the PLY layout of 3D Gaussian Splatting, which every splat viewer opens.

namespace langgs {

/// N splats as plain numbers; all vectors have length N.
struct SplatCloud {
  std::vector<std::array<float, 3>> mean;       ///< [N, 3], metres
  std::vector<std::array<float, 3>> colour;     ///< [N, 3], RGB; 0..1 unless trained beyond
  std::vector<std::array<float, 3>> log_scale;  ///< [N, 3], natural log of the standard deviations in metres
  std::vector<float> opacity_logit;             ///< [N]
  std::vector<std::array<float, 4>> rotation;   ///< [N, 4], unit quaternion w, x, y, z

  [[nodiscard]] std::size_t size() const { return mean.size(); }
  void resize(std::size_t n) {
    mean.resize(n);
    colour.resize(n);
    log_scale.resize(n);
    opacity_logit.resize(n);
    rotation.resize(n);
  }
};

namespace detail {
/// Value of the constant spherical harmonic: colour = 0.5 + kShDegree0 * f_dc.
inline constexpr double kShDegree0 = 0.28209479177387814;

/// The properties that make a splat, in the order in which they are stored in one row here.
inline constexpr std::array<std::string_view, 14> kSplatProperties = {
    "x",       "y",       "z",       "f_dc_0", "f_dc_1", "f_dc_2", "opacity",
    "scale_0", "scale_1", "scale_2", "rot_0",  "rot_1",  "rot_2",  "rot_3"};
}  // namespace detail

/// Writes a binary PLY: x y z nx ny nz f_dc opacity scale rot, as in Kerbl et al. 2023 (degree 0; normals are zero).
/// Throws InvalidArgument if the vectors differ in length, IoError if the file cannot be written.
inline void write_ply(const std::filesystem::path& path, const SplatCloud& cloud) {
  static_assert(std::endian::native == std::endian::little, "rows are written as they lie in memory");
  const std::size_t n = cloud.size();
  LANGGS_EXPECTS(cloud.colour.size() == n && cloud.log_scale.size() == n && cloud.opacity_logit.size() == n &&
                     cloud.rotation.size() == n,
                 "splat cloud has ", n, " means but ", cloud.colour.size(), " colours, ", cloud.log_scale.size(),
                 " scales, ", cloud.opacity_logit.size(), " opacities and ", cloud.rotation.size(),
                 " rotations; give one of each for every splat");
  std::string header = "ply\nformat binary_little_endian 1.0\nelement vertex " + std::to_string(n) + "\n";
  for (const std::string_view name : {"x", "y", "z", "nx", "ny", "nz"})
    header.append("property float ").append(name).append("\n");
  for (std::size_t i = 3; i < detail::kSplatProperties.size(); ++i)
    header.append("property float ").append(detail::kSplatProperties[i]).append("\n");
  header += "end_header\n";

  AtomicFile file(path);
  file.write(header);
  using Row = std::array<float, 17>;
  constexpr std::size_t kRowsPerWrite = 16384;  // about 1 MB
  std::vector<Row> rows;
  rows.reserve(n < kRowsPerWrite ? n : kRowsPerWrite);
  for (std::size_t i = 0; i < n; ++i) {
    const auto& m = cloud.mean[i];
    const auto& s = cloud.log_scale[i];
    const auto& q = cloud.rotation[i];
    const auto dc = [&](int c) { return static_cast<float>((double{cloud.colour[i][c]} - 0.5) / detail::kShDegree0); };
    rows.push_back({m[0], m[1], m[2], 0, 0, 0, dc(0), dc(1), dc(2), cloud.opacity_logit[i], s[0], s[1], s[2], q[0],
                    q[1], q[2], q[3]});
    if (rows.size() == kRowsPerWrite || i + 1 == n) {
      file.write(rows.data(), rows.size() * sizeof(Row));
      rows.clear();
    }
  }
  file.commit();
}

/// Reads the splats of a PLY file, ascii or binary little endian. Properties are found by name in any order and of any
/// type; normals, f_rest and everything unknown are skipped, lists and other elements too. Rotations are normalised.
/// Throws IoError for a damaged file, a missing property, a value that is not finite or a zero quaternion.
[[nodiscard]] inline SplatCloud read_ply(const std::filesystem::path& path,
                                         std::uint64_t max_bytes = std::uint64_t{16} << 30) {
  const std::string file = path.string();
  const std::string content = read_file(path, max_bytes);
  const detail::PlyHeader header = detail::parse_ply_header(content, file);
  detail::PlyCursor cursor(std::string_view(content).substr(header.data_begin), header.binary, file);
  for (const detail::PlyElement& element : header.elements) {
    const bool is_vertex = element.name == "vertex";
    std::vector<int> slots;  // where each property of the row goes; -1: nowhere
    std::array<bool, detail::kSplatProperties.size()> found{};
    for (const detail::PlyProperty& property : element.properties) {
      int slot = -1;
      for (std::size_t i = 0; is_vertex && !property.count_type && i < found.size(); ++i)
        if (property.name == detail::kSplatProperties[i]) slot = static_cast<int>(i);
      if (slot >= 0 && std::exchange(found[slot], true))
        detail::raise<IoError>(file, ": property '", property.name, "' is declared twice; export the file again");
      slots.push_back(slot);
    }
    for (std::size_t i = 0; is_vertex && i < found.size(); ++i)
      if (!found[i])
        detail::raise<IoError>(file, ": vertex property '", detail::kSplatProperties[i],
                               "' is missing; this is not a 3D Gaussian Splatting file");
    cursor.expect_rows(element);
    if (element.properties.empty()) continue;

    SplatCloud cloud;
    if (is_vertex) cloud.resize(element.count);
    for (std::size_t i = 0; i < element.count; ++i) {
      std::array<double, detail::kSplatProperties.size()> v{};
      for (std::size_t p = 0; p < slots.size(); ++p) {
        const detail::PlyProperty& property = element.properties[p];
        if (property.count_type) {
          cursor.skip_list(property);
          continue;
        }
        const double value = cursor.next(property.type);
        if (slots[p] < 0) continue;
        if (!std::isfinite(static_cast<float>(value)))
          detail::raise<IoError>(file, ": '", property.name, "' of splat ", i, " is ", value,
                                 "; remove the splats that are not finite");
        v[slots[p]] = value;
      }
      if (!is_vertex) continue;
      const double norm = std::sqrt(v[10] * v[10] + v[11] * v[11] + v[12] * v[12] + v[13] * v[13]);
      if (norm < 1e-12)
        detail::raise<IoError>(file, ": the rotation of splat ", i, " is a zero quaternion; remove this splat");
      for (int c = 0; c < 3; ++c) {
        cloud.mean[i][c] = static_cast<float>(v[c]);
        cloud.colour[i][c] = static_cast<float>(0.5 + detail::kShDegree0 * v[3 + c]);
        cloud.log_scale[i][c] = static_cast<float>(v[7 + c]);
      }
      cloud.opacity_logit[i] = static_cast<float>(v[6]);
      for (int c = 0; c < 4; ++c) cloud.rotation[i][c] = static_cast<float>(v[10 + c] / norm);
    }
    if (is_vertex) return cloud;
  }
  detail::raise<IoError>(file, " has no element 'vertex'; this is not a 3D Gaussian Splatting file");
}

}  // namespace langgs
