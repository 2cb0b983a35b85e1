// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "langgs/device/algorithm.hpp"
#include "langgs/device/buffer.hpp"
#include "langgs/device/launch.hpp"
#include "langgs/device/list_size.hpp"
#include "langgs/device/replay.hpp"
#include "langgs/render/contributions.hpp"
#include "langgs/render/feature_channels.hpp"

namespace langgs {

/// A Gaussian that some pixels use; its hits are [begin, end).
struct TouchedGaussian {
  std::int32_t gaussian, begin, end;
};

/// Contributions turned around: the pixels of each Gaussian.
struct FeatureHitsView {
  ListSize num_touched;
  const TouchedGaussian* touched = nullptr;  ///< [num_touched]; neighbours in the image are near each other
  const Contribution* hits = nullptr;        ///< grouped by Gaussian, pixels ascending

  /// To be called at touched Gaussian n: says what those after it will read, their hits and their row of `rows`.
  template <class Warp, class T>
  LANGGS_INLINE void prefetch(const Warp& warp, int n, const T* rows, int width) const {
    const int end = num_touched.get();
    if (n + 4 < end) warp.prefetch(hits + touched[n + 4].begin, sizeof(Contribution));
    if (n + 1 < end)
      warp.prefetch(rows + static_cast<std::ptrdiff_t>(touched[n + 1].gaussian) * width, width * sizeof(T));
  }
};

namespace detail {

/// The patch of a Gaussian's first pixel, or one past the last patch where it has none.
struct FirstPatch {
  FeaturePatches patches;
  const std::int32_t* begin;
  const Contribution* hits;
  std::uint32_t* patch;
  TouchedGaussian* gaussian;
  LANGGS_HD void operator()(int g) const {
    const bool is_touched = begin[g] < begin[g + 1];
    patch[g] = static_cast<std::uint32_t>(is_touched ? patches.of(hits[begin[g]].pixel) : patches.count());
    gaussian[g] = {g, begin[g], begin[g + 1]};
  }
};

}  // namespace detail

/// Owner of hits; reuses its buffers.
template <class Backend>
class FeatureHits {
 public:
  void build(const Executor<Backend>& executor, const ContributionView& contributions, int num_gaussians) {
    const FeaturePatches patches{contributions.width, contributions.height};
    replay_(executor, {contributions, num_gaussians},
            [&] { turn_around(executor, contributions, num_gaussians, patches); });
    num_touched_ =
        list_size(executor, patch_begin_.data() + patches.count(), std::min(num_gaussians, contributions.size.most));
  }

  [[nodiscard]] FeatureHitsView view() const { return {num_touched_, touched_.data(), hits_.data()}; }
  [[nodiscard]] std::size_t bytes() const {
    return hits_.bytes() + all_.bytes() + touched_.bytes() + patch_.bytes() + begin_.bytes() + patch_begin_.bytes();
  }

 private:
  struct Arguments {
    ContributionView contributions;
    int num_gaussians;
    friend bool operator==(const Arguments&, const Arguments&) = default;
  };

  void turn_around(const Executor<Backend>& executor, const ContributionView& contributions, int num_gaussians,
                   const FeaturePatches& patches) {
    hits_.resize_discard(executor, contributions.size.most);
    group_by_key(executor, reinterpret_cast<const std::uint32_t*>(contributions.gaussian), contributions.contribution,
                 contributions.size, hits_.data(), begin_, num_gaussians, scratch_);
    for (auto* buffer : {&all_, &touched_}) buffer->resize_discard(executor, num_gaussians);
    patch_.resize_discard(executor, num_gaussians);
    for_each_n(executor, num_gaussians,
               detail::FirstPatch{patches, begin_.data(), hits_.data(), patch_.data(), all_.data()});
    group_by_key(executor, patch_.data(), all_.data(), num_gaussians, touched_.data(), patch_begin_,
                 patches.count() + 1, scratch_);
  }

  ListSize num_touched_;
  Buffer<Contribution, Backend> hits_;
  Buffer<TouchedGaussian, Backend> all_, touched_;
  Buffer<std::uint32_t, Backend> patch_;
  Buffer<std::int32_t, Backend> begin_, patch_begin_;
  SortScratch<Backend> scratch_;
  Replay<Arguments, Backend> replay_;
};

}  // namespace langgs
