// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <concepts>
#include <cstddef>

#include "langgs/core/error.hpp"
#include "langgs/device/copy.hpp"
#include "langgs/frame/feature_map.hpp"
#include "langgs/map/feature_storage.hpp"
#include "langgs/map/gaussian_map.hpp"
#include "langgs/optimize/feature_hits.hpp"

/// @file How the features of a map learn from a teacher (paper section 3.4, L_feat).
///
/// The weights of the contributions are constants: features follow geometry and do not move it. So the pixels of each
/// Gaussian are gathered once, and an optimiser goes from Gaussian to Gaussian: each row of features is read and
/// written once, and has one writer.

namespace langgs {

/// Moves the features of the Gaussians in `hits` towards a teacher; also says how the map stores them. See
/// FeatureAverage and FeatureAdam.
template <class O>
concept FeatureOptimizer = FeatureStorage<O> &&
    requires(const O optimizer, const Executor<Host>& executor, GaussianMap<8, Host, O>& map,
             const ContributionView& contributions, const FeatureHitsView& hits, const Half* teacher,
             typename O::template Scratch<8, Host>& scratch) {
  optimizer.step(executor, map, contributions, hits, teacher, scratch);
  optimizer.check();
  { scratch.bytes() } -> std::convertible_to<std::size_t>;
};

/// Instantiate where a feature optimiser enters, for an error that says the remedy.
template <class O>
constexpr bool require_feature_optimizer() {
  static_assert(FeatureOptimizer<O>,
                "a feature optimiser needs Scalar, State, Scratch, check() and step(executor, map, contributions, "
                "hits, teacher, scratch) const; see FeatureAverage in langgs/optimize/feature_average.hpp");
  return true;
}

/// One supervised step of the feature field against a keyframe's feature map.
template <int FeatDim, class Optimizer, class Backend = Host>
class FeatureStep {
 public:
  /// `contributions` must have one pixel for each pixel of `teacher`, and none where the teacher has nothing. The
  /// teacher is brought to the backend's memory, unless it is there already, at `values`; the host has it there.
  void step(const Executor<Backend>& executor, const Optimizer& optimizer,
            GaussianMap<FeatDim, Backend, Optimizer>& map, const ContributionView& contributions,
            const FeatureMap<FeatDim>& teacher, const Half* values = nullptr) {
    LANGGS_EXPECTS(contributions.width == teacher.width() && contributions.height == teacher.height(),
                   "the contributions are for ", contributions.width, "x", contributions.height,
                   " pixels, the teacher has ", teacher.width(), "x", teacher.height());
    optimizer.check();
    if (contributions.size.most == 0 || map.size() == 0) return;
    hits_.build(executor, contributions, map.size());
    if (values == nullptr)
      values = teacher_(executor, teacher.pixel(0, 0), static_cast<std::size_t>(contributions.num_pixels()) * FeatDim);
    optimizer.step(executor, map, contributions, hits_.view(), values, scratch_);
  }
  [[nodiscard]] std::size_t bytes() const { return hits_.bytes() + teacher_.bytes() + scratch_.bytes(); }

 private:
  FeatureHits<Backend> hits_;
  Upload<Half, Backend> teacher_;
  typename Optimizer::template Scratch<FeatDim, Backend> scratch_;
};

}  // namespace langgs
