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
#include "langgs/map/gaussian.hpp"
#include "langgs/map/planes.hpp"

namespace langgs {

/// Optimiser state of the map: first and second Adam moments, row by row beside the parameters.
template <class Backend>
struct Moments {
  Planes<Backend> geometry;
  Rows<float, Backend> feature;
};

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
template <int FeatDim, class Backend = Host>
class GaussianMap {
 public:
  static constexpr int kFeatDim = FeatDim;
  using Value = Gaussian<FeatDim>;

  [[nodiscard]] int size() const { return geometry_.size(); }
  [[nodiscard]] PlanesView geometry() const { return geometry_.view(); }  ///< [14, N]
  [[nodiscard]] Rows<float, Backend>& features() { return features_; }    ///< [N, FeatDim]
  [[nodiscard]] const Rows<float, Backend>& features() const { return features_; }

  Moments<Backend> first_moment{{}, Rows<float, Backend>(FeatDim)};
  Moments<Backend> second_moment{{}, Rows<float, Backend>(FeatDim)};
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
    std::copy_n(features_.row(i), FeatDim, value.feature.begin());
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
    std::copy_n(value.feature.begin(), FeatDim, features_.row(i));
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

  /// Bytes held, part by part.
  [[nodiscard]] std::vector<std::pair<std::string, std::size_t>> bytes_by_part() const {
    const Statistics<Backend>& s = statistics;
    return {{"geometry", geometry_.bytes()},
            {"features", features_.bytes()},
            {"geometry_moments", first_moment.geometry.bytes() + second_moment.geometry.bytes()},
            {"feature_moments", first_moment.feature.bytes() + second_moment.feature.bytes()},
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
    for (Moments<Backend>* m : {&first_moment, &second_moment}) {
      f(m->geometry);
      f(m->feature);
    }
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
  Rows<float, Backend> features_{FeatDim};
  std::uint32_t next_uid_ = 0;
};

}  // namespace langgs
