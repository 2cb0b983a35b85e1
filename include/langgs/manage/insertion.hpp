// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <unordered_set>
#include <vector>

#include "langgs/core/error.hpp"
#include "langgs/core/rng.hpp"

/// @file Which source points become new Gaussians (paper section 3.3.2, Redundancy-aware GS Insertion).

namespace langgs {

/// Points offered for insertion.
struct InsertionCandidates {
  /// [N, 3] world coordinates [m].
  const std::vector<Eigen::Vector3f>& means;
  /// [N] squared distance to the nearest target Gaussian, as tracking left it [m^2]; +inf or NaN where unknown. Empty:
  /// all unknown.
  const std::vector<float>& squared_distance;
};

struct InsertionReport {
  int num_inserted = 0;
  int num_near = 0;      ///< suppressed: the target has a Gaussian within the threshold
  int num_occupied = 0;  ///< suppressed: the map has a Gaussian in the same cell
  int num_invalid = 0;   ///< dropped: position not finite, or farther than the grid reaches
};

/// Suppresses points where the map already has Gaussians.
///
/// The distances reused from tracking know the map as it was when the target was made, its trackable part only. A hash
/// of the cells taken by all inserted means covers what is newer, and points without a distance. Points offered in one
/// call never suppress each other: the sensor's own density is not redundancy.
class RedundancyFilter {
 public:
  struct Settings {
    float squared_distance = 2e-4f;  ///< tau_r [m^2]; cells have its square root as side. 0 switches the filter off
    bool use_cells = true;           ///< the hash of taken cells
  };

  RedundancyFilter() : RedundancyFilter(Settings{}) {}
  explicit RedundancyFilter(const Settings& settings) : settings_(settings) {
    LANGGS_EXPECTS(
        settings.squared_distance == 0 || (settings.squared_distance >= 1e-8f && settings.squared_distance <= 1e4f),
        "redundancy threshold is ", settings.squared_distance,
        " m^2; it must be 0 (off) or in [1e-8, 1e4], that is 0.1 mm to 100 m squared");
    inverse_cell_ = enabled() ? 1.0 / std::sqrt(static_cast<double>(settings.squared_distance)) : 1.0;
  }

  [[nodiscard]] const Settings& settings() const { return settings_; }
  [[nodiscard]] bool enabled() const { return settings_.squared_distance > 0; }
  [[nodiscard]] std::size_t num_cells() const { return cells_.size(); }

  /// Appends the indices of the points to insert to `chosen`, ascending, and takes their cells.
  InsertionReport select(const InsertionCandidates& candidates, std::vector<std::int32_t>& chosen) {
    const std::size_t n = candidates.means.size();
    LANGGS_EXPECTS(candidates.squared_distance.empty() || candidates.squared_distance.size() == n, "insertion got ", n,
                   " points and ", candidates.squared_distance.size(), " distances; give one for each, or none at all");
    InsertionReport report;
    const std::size_t first_chosen = chosen.size();
    for (std::size_t i = 0; i < n; ++i) {
      std::uint64_t cell = 0;
      if (!cell_of(candidates.means[i], cell)) {
        ++report.num_invalid;
      } else if (!candidates.squared_distance.empty() &&
                 candidates.squared_distance[i] < settings_.squared_distance) {  // false for NaN
        ++report.num_near;
      } else if (uses_cells() && cells_.count(cell) != 0) {
        ++report.num_occupied;
      } else {
        chosen.push_back(static_cast<std::int32_t>(i));
        ++report.num_inserted;
      }
    }
    for (std::size_t k = first_chosen; k < chosen.size(); ++k) take(candidates.means[chosen[k]]);
    return report;
  }

  /// Starts anew from the map's means: call after a pruning, so that freed cells can be filled again. `mean(i)` gives
  /// the mean of Gaussian i in [0, n) as an Eigen::Vector3f.
  template <class Mean>
  void rebuild(int n, Mean&& mean) {
    cells_.clear();
    for (int i = 0; i < n; ++i) take(mean(i));
  }

 private:
  struct Mix {
    std::size_t operator()(std::uint64_t key) const { return mix64(key); }
  };

  [[nodiscard]] bool uses_cells() const { return enabled() && settings_.use_cells; }

  /// False where the position is not finite or beyond 2^20 cells (20 km at the default cell size) from the origin.
  [[nodiscard]] bool cell_of(const Eigen::Vector3f& mean, std::uint64_t& cell) const {
    constexpr double kReach = 1 << 20;
    cell = 0;
    for (int a = 0; a < 3; ++a) {
      const double c = std::floor(static_cast<double>(mean[a]) * inverse_cell_);
      if (!(c >= -kReach && c < kReach)) return false;
      cell = cell << 21 | static_cast<std::uint64_t>(c + kReach);
    }
    return true;
  }
  void take(const Eigen::Vector3f& mean) {
    std::uint64_t cell = 0;
    if (uses_cells() && cell_of(mean, cell)) cells_.insert(cell);
  }

  Settings settings_;
  double inverse_cell_ = 1;
  std::unordered_set<std::uint64_t, Mix> cells_;  // asked for membership only, never walked
};

/// Every finite point becomes a Gaussian: the paper's ablation without redundancy control.
class InsertAll {
 public:
  InsertionReport select(const InsertionCandidates& candidates, std::vector<std::int32_t>& chosen) {
    InsertionReport report;
    for (std::size_t i = 0; i < candidates.means.size(); ++i) {
      const bool finite = candidates.means[i].allFinite();
      if (finite) chosen.push_back(static_cast<std::int32_t>(i));
      ++(finite ? report.num_inserted : report.num_invalid);
    }
    return report;
  }
  template <class Mean>
  void rebuild(int, Mean&&) {}
};

template <class P>
concept InsertionPolicy = requires(P policy, const InsertionCandidates& candidates, std::vector<std::int32_t>& chosen,
                                   Eigen::Vector3f (*mean)(int)) {
  { policy.select(candidates, chosen) } -> std::same_as<InsertionReport>;
  policy.rebuild(0, mean);
};

/// Instantiate where a policy enters, for an error that says the remedy.
template <class P>
constexpr bool require_insertion_policy() {
  static_assert(InsertionPolicy<P>,
                "an insertion policy needs `InsertionReport select(const InsertionCandidates&, std::vector<int32_t>&)` "
                "and `rebuild(n, mean)`; see RedundancyFilter");
  return true;
}

}  // namespace langgs
