// SPDX-License-Identifier: Apache-2.0
#include "langgs/track/keyframe_policy.hpp"

#include <doctest/doctest.h>

#include <limits>
#include <vector>

using namespace langgs;

TEST_CASE("keyframe counters on a scripted sequence") {
  KeyframePolicy policy({.overlap_threshold = 0.8, .mapping_interval = 3});
  using enum KeyframeKind;
  const double overlaps[] = {0, 0.99, 0.95, 0.9, 0.9, 0.85, 0.8, 0.79, 0.99, 0.99, 0.5, 0.99, 0.99, 0.99, 0.99};
  // The counter starts anew at tracking keyframes only: 3 and 6 frames after the first, 3 after the one at index 10.
  const std::vector<KeyframeKind> expected = {tracking, none, none,     mapping, none, none,    mapping, tracking,
                                              none,     none, tracking, none,    none, mapping, tracking};
  std::vector<KeyframeKind> kinds;
  for (int i = 0; i < 15; ++i) kinds.push_back(policy.decide(overlaps[i], i == 0, i == 14));
  CHECK(kinds == expected);
}

TEST_CASE("odd overlaps and settings") {
  KeyframePolicy policy({.overlap_threshold = 0.8, .mapping_interval = 0});
  CHECK(policy.decide(1, true, false) == KeyframeKind::tracking);
  for (int i = 0; i < 30; ++i) CHECK(policy.decide(1, false, false) == KeyframeKind::none);
  CHECK(policy.decide(std::numeric_limits<double>::quiet_NaN(), false, false) == KeyframeKind::tracking);
  CHECK_THROWS_AS(KeyframePolicy({.overlap_threshold = 1.5}), InvalidArgument);
  CHECK_THROWS_AS(KeyframePolicy({.overlap_threshold = std::numeric_limits<double>::quiet_NaN()}), InvalidArgument);
  CHECK_THROWS_AS(KeyframePolicy({.mapping_interval = -1}), InvalidArgument);
}
