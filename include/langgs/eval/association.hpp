// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <span>
#include <vector>

#include "langgs/core/error.hpp"
#include "langgs/core/pose.hpp"

namespace langgs {

/// A camera pose with its time [s].
struct StampedPose {
  double timestamp = 0;
  Pose T_world_camera = Pose::Identity();
};

/// Indices into two lists of stamps.
struct StampPair {
  std::size_t first = 0, second = 0;
  friend bool operator==(const StampPair&, const StampPair&) = default;
};

/// For each stamp of `first`, in its order, the nearest stamp of `second` if it is at most `max_gap` [s] away.
/// Neither list need be sorted. An element of `second` may serve several times. Of two stamps equally near the earlier
/// one wins, of equal stamps the one listed first.
[[nodiscard]] inline std::vector<StampPair> associate(std::span<const double> first, std::span<const double> second,
                                                      double max_gap) {
  LANGGS_EXPECTS(max_gap >= 0, "maximum time gap is ", max_gap, " s; it must not be negative");
  const auto finite = [](double stamp) { return std::isfinite(stamp); };
  LANGGS_EXPECTS(std::all_of(first.begin(), first.end(), finite) && std::all_of(second.begin(), second.end(), finite),
                 "a time stamp is not finite; remove it from the list");
  std::vector<std::size_t> order(second.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return second[a] < second[b]; });
  const auto lower = [&](double stamp) {
    return std::lower_bound(order.begin(), order.end(), stamp,
                            [&](std::size_t i, double value) { return second[i] < value; });
  };
  std::vector<StampPair> pairs;
  for (std::size_t i = 0; i < first.size(); ++i) {
    const auto after = lower(first[i]);
    auto best = order.end();
    if (after != order.begin()) best = lower(second[*(after - 1)]);
    if (after != order.end() && (best == order.end() || second[*after] - first[i] < first[i] - second[*best]))
      best = after;
    if (best != order.end() && std::abs(second[*best] - first[i]) <= max_gap) pairs.push_back({i, *best});
  }
  return pairs;
}

}  // namespace langgs
