// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <concepts>
#include <cstdint>

#include "langgs/core/error.hpp"

/// @file Which fields a mapping iteration steps (paper section 3.4, Hybrid Field Optimization).

namespace langgs {

/// What a schedule may decide by.
struct MappingVisit {
  std::int64_t iteration = 0;  ///< mapping iterations before this one
  bool first_visit = false;    ///< the keyframe has never been rendered before
};

/// The fields to step in one mapping iteration.
struct OptimizationStep {
  bool geometry = false;
  bool features = false;
  friend bool operator==(const OptimizationStep&, const OptimizationStep&) = default;
};

/// Geometry at every iteration, features at every n-th: semantics are refined at a lower rate on a steadier geometry.
/// The paper gives no ratio.
struct HybridSchedule {
  int feature_every = 4;                ///< n
  bool features_at_first_visit = true;  ///< also when a keyframe is new: its Gaussians' features are fresh

  [[nodiscard]] OptimizationStep operator()(const MappingVisit& visit) const {
    LANGGS_EXPECTS(feature_every >= 1, "feature_every is ", feature_every, "; it must be at least 1");
    return {true, visit.iteration % feature_every == 0 || (features_at_first_visit && visit.first_visit)};
  }
};

/// Both fields at every iteration: the paper's ablation.
struct JointSchedule {
  [[nodiscard]] OptimizationStep operator()(const MappingVisit&) const { return {true, true}; }
};

/// No feature step at all, for maps without language features.
struct GeometrySchedule {
  [[nodiscard]] OptimizationStep operator()(const MappingVisit&) const { return {true, false}; }
};

/// A pure function from a visit to what is stepped.
template <class S>
concept OptimizationSchedule = requires(const S schedule, const MappingVisit& visit) {
  { schedule(visit) } -> std::same_as<OptimizationStep>;
};

/// Instantiate where a schedule enters, for an error that says the remedy.
template <class S>
constexpr bool require_optimization_schedule() {
  static_assert(OptimizationSchedule<S>,
                "a schedule needs `OptimizationStep operator()(const MappingVisit&) const`; see HybridSchedule");
  return true;
}

}  // namespace langgs
