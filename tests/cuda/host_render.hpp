// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "langgs/map/planes.hpp"
#include "langgs/render/tile_backward.hpp"
#include "langgs/render/tile_forward.hpp"
#include "langgs/render/view.hpp"

/// @file A scene, and what the host's owners make of it. host_render.cpp is compiled by the host's compiler, the tests
/// by nvcc; only values cross.

namespace langgs::test {

inline constexpr int kTestK = 3;

/// V splats, n pixels. Everything that Buffers hold there, here in vectors.
struct HostRender {
  explicit HostRender(const View& view_) : view(view_) {}

  View view;
  TileGrid grid;
  std::vector<float> map;  ///< [14, size]
  int size = 0;

  std::vector<std::int32_t> tile_begin, sorted_slot, splat_gaussian, slot_begin;
  std::vector<Instance> slot;
  std::vector<Splat> splats;

  std::vector<float> planes;          ///< colour, depth, transmittance [5, n]
  std::vector<std::int32_t> topk_id;  ///< [K, n]
  std::vector<float> topk_weight;     ///< [K, n]
  std::vector<std::int32_t> topk_count;
  std::vector<float> max_weight;       ///< [V], as topk_count
  std::vector<std::int32_t> num_hits;  ///< [n] splats that each ray meets

  std::vector<float> target;    ///< colour and depth [4, n], some of it not measured
  std::vector<float> upstream;  ///< dL/dC and dL/dD [4, n]
  std::vector<float> gradient;  ///< [14, V]
  std::vector<double> pose;     ///< [6]
};

[[nodiscard]] HostRender render_on_host(int width, int height, int num_gaussians, std::uint64_t seed);

}  // namespace langgs::test
