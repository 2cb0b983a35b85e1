// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "langgs/core/error.hpp"
#include "langgs/core/rng.hpp"

/// @file What things in the synthetic room are called, and their language features.

namespace langgs::detail {

/// Labels of the synthetic room; 0 means "nothing" and never occurs in its images.
enum Label : std::uint16_t {
  kNothing,
  kWall,
  kFloor,
  kCeiling,
  kRug,
  kWindow,
  kCurtain,
  kDoor,
  kPicture,
  kTable,
  kChair,
  kSofa,
  kCushion,
  kShelf,
  kCabinet,
  kBook,
  kCarton,
  kLamp,
  kPlant,
  kVase,
  kMug,
  kMonitor,
  kClock,
  kRedBall,
  kBlueBall,
  kNumLabels
};

struct LabelInfo {
  const char* name;
  int theme;  ///< labels of one theme resemble each other a little ...
  int twin;   ///< ... and twins resemble each other closely
};

inline constexpr LabelInfo kLabelInfo[kNumLabels] = {
    {"nothing", 0, 0}, {"wall", 1, 1},     {"floor", 1, 2},   {"ceiling", 1, 1},   {"rug", 1, 2},
    {"window", 2, 3},  {"curtain", 2, 4},  {"door", 2, 5},    {"picture", 2, 6},   {"table", 3, 7},
    {"chair", 3, 8},   {"sofa", 3, 8},     {"cushion", 3, 9}, {"shelf", 3, 10},    {"cabinet", 3, 10},
    {"book", 4, 11},   {"box", 4, 11},     {"lamp", 4, 12},   {"plant", 5, 13},    {"vase", 5, 14},
    {"mug", 5, 14},    {"monitor", 4, 15}, {"clock", 4, 16},  {"red ball", 6, 17}, {"blue ball", 6, 17}};

/// Unit vectors [kNumLabels, dim], row 0 all zeros. As with text embeddings everything resembles everything: the
/// expected cosine is 0.4 between strangers, 0.6 within a theme and 0.85 between twins.
[[nodiscard]] inline std::vector<float> label_vectors(int dim, std::uint64_t seed) {
  LANGGS_EXPECTS(dim >= 1 && dim <= 4096, "feature dimension is ", dim, "; it must be in [1, 4096]");
  std::vector<double> sum(dim), part(dim);
  const auto add = [&](std::uint64_t stream, double share) {
    const CounterRng rng{seed, stream};
    double norm2 = 0;
    for (int c = 0; c < dim; ++c) {
      part[c] = rng.normal(c);
      norm2 += part[c] * part[c];
    }
    for (int c = 0; c < dim; ++c) sum[c] += part[c] * std::sqrt(share / norm2);
  };
  std::vector<float> vectors(static_cast<std::size_t>(kNumLabels) * dim, 0.f);
  for (int label = 1; label < kNumLabels; ++label) {
    sum.assign(dim, 0.0);
    add(1000, 0.4);
    add(2000 + kLabelInfo[label].theme, 0.2);
    add(3000 + kLabelInfo[label].twin, 0.25);
    add(4000 + label, 0.15);
    double norm2 = 0;
    for (const double v : sum) norm2 += v * v;
    for (int c = 0; c < dim; ++c) {
      vectors[static_cast<std::size_t>(label) * dim + c] = static_cast<float>(sum[c] / std::sqrt(norm2));
    }
  }
  return vectors;
}

[[nodiscard]] inline std::vector<std::string> label_names() {
  std::vector<std::string> names;
  for (const LabelInfo& info : kLabelInfo) names.emplace_back(info.name);
  return names;
}

}  // namespace langgs::detail
