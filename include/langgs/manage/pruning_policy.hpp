// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "langgs/core/error.hpp"
#include "langgs/core/rng.hpp"
#include "langgs/device/copy.hpp"
#include "langgs/map/planes.hpp"

/// @file Which Gaussians leave the map (paper section 3.3.1, Semantic-Geometric Consistency Pruning).

namespace langgs {

/// What a pruning policy looks at. All arrays are [size].
struct PruningStatistics {
  PlanesView geometry;                       ///< opacity logits and log-scales are used
  const std::int32_t* topk_count = nullptr;  ///< times among the K largest weights of a pixel since the last pruning
  const float* max_weight = nullptr;         ///< S_i: largest blending weight since the last pruning
  const std::int32_t* num_views = nullptr;   ///< renders since the last pruning that had it inside the frustum
  const std::int32_t* birth = nullptr;       ///< mapping iteration of its insertion
  const std::uint32_t* uid = nullptr;        ///< never reused: random numbers belong to Gaussians, not to rows
  int size = 0;
};

/// The statistics of a GaussianMap in host memory.
template <class Map>
[[nodiscard]] PruningStatistics pruning_statistics(const Map& map) {
  const auto& s = map.statistics;
  return {map.geometry(), s.topk_count.data(), s.max_weight.data(), s.num_views.data(),
          s.birth.data(), s.uid.data(),        map.size()};
}

/// Brings what a pruning policy looks at from a backend's memory to the host's; on the host it is there.
template <class Backend>
class PruningStatisticsReader {
 public:
  /// Valid until the next call.
  template <class Map>
  [[nodiscard]] PruningStatistics read(const Executor<Backend>& executor, const Map& map) {
    const auto& s = map.statistics;
    const std::size_t n = map.size();
    return {planes_on_host(executor, map.geometry(), geometry_),
            topk_count_(executor, s.topk_count.data(), n),
            max_weight_(executor, s.max_weight.data(), n),
            num_views_(executor, s.num_views.data(), n),
            birth_(executor, s.birth.data(), n),
            uid_(executor, s.uid.data(), n),
            map.size()};
  }

 private:
  Download<float, Backend> geometry_, max_weight_;
  Download<std::int32_t, Backend> topk_count_, num_views_, birth_;
  Download<std::uint32_t, Backend> uid_;
};

struct PruningReport {
  int num_transparent = 0;        ///< removed: opacity too low (or not a number)
  int num_large = 0;              ///< removed: too large
  int num_candidates = 0;         ///< the set G_prune
  int num_inconsistent = 0;       ///< removed from it
  bool reset_statistics = false;  ///< counts, weights and views must start anew: their window has ended

  [[nodiscard]] int num_removed() const { return num_transparent + num_large + num_inconsistent; }
};

/// Two prunings: the backbone's of transparent and oversized Gaussians, and the paper's consistency pruning.
struct PruningPolicy {
  int backbone_period = 200;  ///< iterations; 0: never
  float min_opacity = 0.005f;
  float max_scale = 0.25f;          ///< largest standard deviation allowed [m]
  int consistency_period = 500;     ///< iterations; 0: never
  std::int32_t max_topk_count = 0;  ///< tau: at most this often among the Top-K makes a candidate
  /// r: the share of the candidates that survives. The paper's normalised S_i are no survival probabilities (they sum
  /// to 1): they are the weights of a draw without replacement of this fixed share.
  double keep_ratio = 0.5;
  std::uint64_t seed = 0;

  /// Whether `select` has something to do before mapping iteration `iteration`; never at iteration 0.
  [[nodiscard]] bool due(std::int64_t iteration) const {
    return is_multiple(iteration, backbone_period) || is_multiple(iteration, consistency_period);
  }

  /// Writes keep[i] = 1 or 0 for each Gaussian. Reproducible: depends on the statistics, the seed and the iteration.
  PruningReport select(std::int64_t iteration, const PruningStatistics& s, std::vector<std::int32_t>& keep) const {
    check();
    LANGGS_EXPECTS(s.size == 0 || (s.geometry.base && s.geometry.size >= s.size && s.topk_count && s.max_weight &&
                                   s.num_views && s.birth && s.uid),
                   "pruning statistics of ", s.size, " Gaussians lack an array; see pruning_statistics(map)");
    keep.assign(s.size, 1);
    PruningReport report;
    if (is_multiple(iteration, backbone_period)) prune_backbone(s, keep, report);
    if (is_multiple(iteration, consistency_period)) {
      prune_inconsistent(iteration, s, keep, report);
      report.reset_statistics = true;
    }
    return report;
  }

  void check() const {
    LANGGS_EXPECTS(backbone_period >= 0 && consistency_period >= 0, "pruning periods are ", backbone_period, " and ",
                   consistency_period, "; they must not be negative, 0 switches off");
    LANGGS_EXPECTS(min_opacity >= 0 && min_opacity < 1, "min_opacity is ", min_opacity, "; it must be in [0, 1)");
    LANGGS_EXPECTS(max_scale > 0, "max_scale is ", max_scale, " m; it must be positive");
    LANGGS_EXPECTS(keep_ratio >= 0 && keep_ratio <= 1, "keep_ratio is ", keep_ratio, "; it must be in [0, 1]");
    LANGGS_EXPECTS(max_topk_count >= 0, "max_topk_count is ", max_topk_count, "; it must not be negative");
  }

 private:
  struct Ticket {
    double key, u;
    std::uint32_t uid;
    int index;
    friend bool operator<(const Ticket& a, const Ticket& b) {  // the first of an ascending order survive
      if (a.key != b.key) return a.key > b.key;
      return a.u != b.u ? a.u > b.u : a.uid < b.uid;
    }
  };

  [[nodiscard]] static bool is_multiple(std::int64_t iteration, int period) {
    return period > 0 && iteration > 0 && iteration % period == 0;
  }

  void prune_backbone(const PruningStatistics& s, std::vector<std::int32_t>& keep, PruningReport& report) const {
    const double min_logit = std::log(static_cast<double>(min_opacity)) - std::log1p(-static_cast<double>(min_opacity));
    const double max_log_scale = std::log(static_cast<double>(max_scale));
    for (int i = 0; i < s.size; ++i) {
      const PlanesView& g = s.geometry;
      if (!(static_cast<double>(g.plane(kOpacityLogit)[i]) >= min_logit)) {
        keep[i] = 0;
        ++report.num_transparent;
      } else if (!(g.plane(kLogScaleX)[i] <= max_log_scale && g.plane(kLogScaleY)[i] <= max_log_scale &&
                   g.plane(kLogScaleZ)[i] <= max_log_scale)) {
        keep[i] = 0;
        ++report.num_large;
      }
    }
  }

  /// Weighted sampling without replacement (Efraimidis & Spirakis 2006): keep the ceil(r n) largest log(u_i) / S_i.
  /// Gaussians that never contributed (S_i = 0) go first. Those younger than a period, or that no render of the window
  /// had inside its frustum, have had no chance to be selected and are no candidates.
  void prune_inconsistent(std::int64_t iteration, const PruningStatistics& s, std::vector<std::int32_t>& keep,
                          PruningReport& report) const {
    const CounterRng rng{seed, static_cast<std::uint64_t>(iteration)};
    std::vector<Ticket> tickets;
    for (int i = 0; i < s.size; ++i) {
      const bool exempt = iteration - s.birth[i] < consistency_period || s.num_views[i] == 0;
      if (keep[i] == 0 || exempt || s.topk_count[i] > max_topk_count) continue;
      const double u = rng.uniform(s.uid[i]), score = s.max_weight[i];
      const double key = score > 0 ? std::log(u) / score : -std::numeric_limits<double>::infinity();
      tickets.push_back({key, u, s.uid[i], i});
    }
    const auto n = static_cast<double>(tickets.size());
    const auto num_kept = static_cast<std::ptrdiff_t>(std::ceil(keep_ratio * n - 1e-9));  // 0.07 * 100 is not 8
    if (num_kept < static_cast<std::ptrdiff_t>(tickets.size()))
      std::nth_element(tickets.begin(), tickets.begin() + num_kept, tickets.end());
    for (auto ticket = tickets.begin() + num_kept; ticket != tickets.end(); ++ticket) keep[ticket->index] = 0;
    report.num_candidates = static_cast<int>(tickets.size());
    report.num_inconsistent = static_cast<int>(tickets.end() - tickets.begin() - num_kept);
  }
};

/// Every Gaussian stays.
struct NoPruning {
  [[nodiscard]] bool due(std::int64_t) const { return false; }
  PruningReport select(std::int64_t, const PruningStatistics& s, std::vector<std::int32_t>& keep) const {
    keep.assign(s.size, 1);
    return {};
  }
};

template <class P>
concept MapPruning = requires(const P policy, std::int64_t iteration, const PruningStatistics& s,
                              std::vector<std::int32_t>& keep) {
  { policy.due(iteration) } -> std::same_as<bool>;
  { policy.select(iteration, s, keep) } -> std::same_as<PruningReport>;
};

/// Instantiate where a policy enters, for an error that says the remedy.
template <class P>
constexpr bool require_map_pruning() {
  static_assert(MapPruning<P>,
                "a pruning policy needs `bool due(int64_t) const` and `PruningReport select(int64_t, const "
                "PruningStatistics&, std::vector<int32_t>&) const`; see PruningPolicy");
  return true;
}

}  // namespace langgs
