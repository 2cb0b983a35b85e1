// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "langgs/core/error.hpp"
#include "langgs/device/buffer.hpp"
#include "langgs/map/feature_storage.hpp"
#include "langgs/map/gaussian.hpp"
#include "langgs/map/planes.hpp"

namespace langgs {

/// Bytes held, by the name of what holds them.
using MemoryReport = std::vector<std::pair<std::string, std::size_t>>;

/// What the pruning policy looks at; collected by the rasteriser since the last pruning (paper section 3.3.1).
template <class Backend>
struct Statistics {
  Rows<std::int32_t, Backend> topk_count;  ///< times selected among the K largest weights of a pixel
  Rows<float, Backend> max_weight;         ///< S_i = max over views and rays of w_i(r)
  Rows<std::int32_t, Backend> num_views;   ///< renders in which the Gaussian was inside the frustum
  Rows<std::int32_t, Backend> birth;       ///< mapping iteration at insertion
  Rows<std::uint32_t, Backend> uid;        ///< never reused; names a Gaussian across compactions
  Rows<std::int32_t, Backend> keyframe;    ///< keyframe that inserted it (its anchor)
};

/// The map (paper section 3.1): a structure of arrays of Gaussians, with optimiser state and statistics beside them.
/// `Storage` is a feature optimiser, or PlainFeatures.
template <int FeatDim, class Backend = Host, class Storage = PlainFeatures<>>
class GaussianMap {
  static_assert(FeatureStorage<Storage>,
                "the storage of a map's features needs Scalar (float or langgs::Half) and a "
                "template State<FeatDim, Backend> with for_each_array; see PlainFeatures");

 public:
  static constexpr int kFeatDim = FeatDim;
  using Value = Gaussian<FeatDim>;
  using Scalar = typename Storage::Scalar;

  [[nodiscard]] int size() const { return geometry_.size(); }
  [[nodiscard]] PlanesView geometry() const { return geometry_.view(); }  ///< [14, N]
  [[nodiscard]] Rows<Scalar, Backend>& features() { return features_; }   ///< [N, FeatDim]
  [[nodiscard]] const Rows<Scalar, Backend>& features() const { return features_; }

  Planes<Backend> first_moment, second_moment;                       ///< of Adam on the geometry
  typename Storage::template State<FeatDim, Backend> feature_state;  ///< of the feature optimiser
  Statistics<Backend> statistics;

  /// Adds Gaussians at the end, with zero moments and statistics. Values that are not finite are refused.
  void append(const std::vector<Value>& gaussians, int birth, int keyframe) {
    for (std::size_t i = 0; i < gaussians.size(); ++i) expect_finite(gaussians[i], i);
    LANGGS_EXPECTS(gaussians.size() + static_cast<std::size_t>(size()) < (1u << 30), "the map would grow beyond 2^30 ",
                   "Gaussians; raise the redundancy threshold");
    const int first = size();
    resize(first + static_cast<int>(gaussians.size()));
    for (int i = first; i < size(); ++i) {
      set(i, gaussians[i - first]);
      statistics.birth.data()[i] = birth;
      statistics.keyframe.data()[i] = keyframe;
      statistics.uid.data()[i] = next_uid_++;
    }
  }

  /// Gaussian i as a value.
  [[nodiscard]] Value operator[](int i) const {
    const PlanesView g = geometry();
    const auto at = [&](int p) { return g.plane(p)[i]; };
    Value value;
    value.mean = {at(kMeanX), at(kMeanY), at(kMeanZ)};
    value.log_scale = {at(kLogScaleX), at(kLogScaleY), at(kLogScaleZ)};
    value.rotation = {at(kRotationW), at(kRotationX), at(kRotationY), at(kRotationZ)};
    value.opacity_logit = at(kOpacityLogit);
    value.colour = {at(kRed), at(kGreen), at(kBlue)};
    for (int c = 0; c < FeatDim; ++c) value.feature[c] = static_cast<float>(features_.row(i)[c]);
    return value;
  }

  /// Overwrites the parameters of Gaussian i; its moments and statistics stay.
  void set(int i, const Value& value) {
    const PlanesView g = geometry_.view();
    for (int a = 0; a < 3; ++a) {
      g.plane(kMeanX + a)[i] = value.mean[a];
      g.plane(kLogScaleX + a)[i] = value.log_scale[a];
      g.plane(kRed + a)[i] = value.colour[a];
    }
    for (int a = 0; a < 4; ++a) g.plane(kRotationW + a)[i] = value.rotation[a];
    g.plane(kOpacityLogit)[i] = value.opacity_logit;
    for (int c = 0; c < FeatDim; ++c) features_.row(i)[c] = static_cast<Scalar>(value.feature[c]);
  }

  /// Keeps the Gaussians with keep[i] != 0, in their order, with all that belongs to them. Returns how many went.
  int prune(const std::vector<std::int32_t>& keep) {
    LANGGS_EXPECTS(static_cast<int>(keep.size()) == size(), "pruning got ", keep.size(), " flags for ", size(),
                   " Gaussians; give one flag for each");
    std::vector<std::int32_t> kept;
    for (int i = 0; i < size(); ++i)
      if (keep[i] != 0) kept.push_back(i);
    const int before = size();
    for_each_array([&](auto& array) { array.compact(kept.data(), static_cast<int>(kept.size())); });
    return before - size();
  }

  /// Calls f with the features and with each array that the feature optimiser keeps beside them.
  template <class F>
  void for_each_feature_array(F&& f) const {
    f(features_);
    const_cast<GaussianMap&>(*this).feature_state.for_each_array([&](const auto& array) { f(array); });
  }

  /// Bytes held, part by part.
  [[nodiscard]] MemoryReport memory_report() const {
    const Statistics<Backend>& s = statistics;
    std::size_t state = 0;
    for_each_feature_array([&](const auto& array) { state += array.bytes(); });
    state -= features_.bytes();
    return {{"geometry", geometry_.bytes()},
            {"features", features_.bytes()},
            {"geometry_moments", first_moment.bytes() + second_moment.bytes()},
            {"feature_optimizer", state},
            {"statistics", s.topk_count.bytes() + s.max_weight.bytes() + s.num_views.bytes() + s.birth.bytes() +
                               s.uid.bytes() + s.keyframe.bytes()}};
  }

 private:
  static void expect_finite(const Value& g, std::size_t i) {
    bool finite = g.mean.allFinite() && g.log_scale.allFinite() && g.rotation.allFinite() && g.colour.allFinite() &&
                  std::isfinite(g.opacity_logit);
    for (const float f : g.feature) finite = finite && std::isfinite(f);
    LANGGS_EXPECTS(finite, "Gaussian ", i, " of an insertion has a value that is not finite; its mean is (",
                   g.mean.transpose(), "): check depth, pose and feature map of its frame");
  }

  template <class F>
  void for_each_array(F&& f) {
    f(geometry_);
    f(features_);
    f(first_moment);
    f(second_moment);
    feature_state.for_each_array(f);
    f(statistics.topk_count);
    f(statistics.max_weight);
    f(statistics.num_views);
    f(statistics.birth);
    f(statistics.uid);
    f(statistics.keyframe);
  }
  void resize(int size) {
    for_each_array([&](auto& array) { array.resize(size); });
  }

  Planes<Backend> geometry_;
  Rows<Scalar, Backend> features_{FeatDim};
  std::uint32_t next_uid_ = 0;
};

}  // namespace langgs
