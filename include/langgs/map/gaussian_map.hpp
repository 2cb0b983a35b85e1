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
#include "langgs/device/copy.hpp"
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
/// `Storage` is a feature optimiser, or PlainFeatures. In the host's memory no executor is needed.
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
  void append(const Executor<Backend>& executor, const std::vector<Value>& gaussians, int birth, int keyframe) {
    for (std::size_t i = 0; i < gaussians.size(); ++i) expect_finite(gaussians[i], i);
    LANGGS_EXPECTS(gaussians.size() + static_cast<std::size_t>(size()) < (1u << 30), "the map would grow beyond 2^30 ",
                   "Gaussians; raise the redundancy threshold");
    const int first = size(), count = static_cast<int>(gaussians.size());
    resize(executor, first + count);
    write(executor, first, gaussians.data(), count);
    const auto put = [&](auto& rows, const auto& value) {
      write_from_host(executor, rows.row(first), count, [&](auto* to) {
        for (int i = 0; i < count; ++i) to[i] = value(i);
      });
    };
    put(statistics.birth, [&](int) { return birth; });
    put(statistics.keyframe, [&](int) { return keyframe; });
    put(statistics.uid, [&](int i) { return next_uid_ + static_cast<std::uint32_t>(i); });
    next_uid_ += static_cast<std::uint32_t>(count);
  }
  void append(const std::vector<Value>& gaussians, int birth, int keyframe) requires detail::HostBackend<Backend> {
    append(nobody(), gaussians, birth, keyframe);
  }

  /// Gaussian i as a value. For more than a few of them see on_host.
  [[nodiscard]] Value get(const Executor<Backend>& executor, int i) const {
    const PlanesView g = geometry();
    float geometry[kNumPlanes];
    for (int p = 0; p < kNumPlanes; ++p) copy_to_host(executor, g.plane(p) + i, 1, &geometry[p]);
    Scalar feature[FeatDim];
    copy_to_host(executor, features_.row(i), FeatDim, feature);
    Value value;
    value.mean = {geometry[kMeanX], geometry[kMeanY], geometry[kMeanZ]};
    value.log_scale = {geometry[kLogScaleX], geometry[kLogScaleY], geometry[kLogScaleZ]};
    value.rotation = {geometry[kRotationW], geometry[kRotationX], geometry[kRotationY], geometry[kRotationZ]};
    value.opacity_logit = geometry[kOpacityLogit];
    value.colour = {geometry[kRed], geometry[kGreen], geometry[kBlue]};
    for (int c = 0; c < FeatDim; ++c) value.feature[c] = static_cast<float>(feature[c]);
    return value;
  }
  [[nodiscard]] Value operator[](int i) const requires detail::HostBackend<Backend> { return get(nobody(), i); }

  /// Overwrites the parameters of Gaussian i; its moments and statistics stay.
  void set(const Executor<Backend>& executor, int i, const Value& value) { write(executor, i, &value, 1); }
  void set(int i, const Value& value) requires detail::HostBackend<Backend> { set(nobody(), i, value); }

  /// Keeps the Gaussians with keep[i] != 0, in their order, with all that belongs to them. Returns how many went.
  int prune(const Executor<Backend>& executor, const std::vector<std::int32_t>& keep) {
    LANGGS_EXPECTS(static_cast<int>(keep.size()) == size(), "pruning got ", keep.size(), " flags for ", size(),
                   " Gaussians; give one flag for each");
    std::vector<std::int32_t> kept;
    for (int i = 0; i < size(); ++i)
      if (keep[i] != 0) kept.push_back(i);
    const int before = size(), n = static_cast<int>(kept.size());
    if (n == before) return 0;
    Upload<std::int32_t, Backend> upload;
    const std::int32_t* const from = upload(executor, kept.data(), kept.size());
    for_each_array([&](auto& array) { array.compact(executor, from, n); });
    return before - size();
  }
  int prune(const std::vector<std::int32_t>& keep) requires detail::HostBackend<Backend> {
    return prune(nobody(), keep);
  }

  /// A copy in the host's memory, for looking at, saving and comparing.
  [[nodiscard]] GaussianMap<FeatDim, Host, Storage> on_host(const Executor<Backend>& executor) const {
    GaussianMap<FeatDim, Host, Storage> copy;
    copy.resize(Executor<Host>(), size());
    copy.next_uid_ = next_uid_;
    std::vector<const void*> arrays;
    const_cast<GaussianMap&>(*this).for_each_array([&](const auto& array) { arrays.push_back(&array); });
    auto next = arrays.begin();
    copy.for_each_array([&](auto& array) { copy_array(executor, *next++, array, size()); });
    return copy;
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
  template <int, class, class>
  friend class GaussianMap;

  /// For the host's memory, which is written without the help of threads.
  static const Executor<Backend>& nobody() {
    static const Executor<Backend> executor;
    return executor;
  }

  /// Writes the parameters of Gaussians [first, first + count).
  void write(const Executor<Backend>& executor, int first, const Value* values, int count) {
    const PlanesView g = geometry();
    const auto put = [&](int plane, const auto& parameter) {
      write_from_host(executor, g.plane(plane) + first, count, [&](float* to) {
        for (int i = 0; i < count; ++i) to[i] = parameter(values[i]);
      });
    };
    for (int a = 0; a < 3; ++a) {
      put(kMeanX + a, [a](const Value& v) { return v.mean[a]; });
      put(kLogScaleX + a, [a](const Value& v) { return v.log_scale[a]; });
      put(kRed + a, [a](const Value& v) { return v.colour[a]; });
    }
    for (int a = 0; a < 4; ++a) put(kRotationW + a, [a](const Value& v) { return v.rotation[a]; });
    put(kOpacityLogit, [](const Value& v) { return v.opacity_logit; });
    write_from_host(executor, features_.row(first), static_cast<std::size_t>(count) * FeatDim, [&](Scalar* to) {
      for (int i = 0; i < count; ++i)
        for (int c = 0; c < FeatDim; ++c)
          to[static_cast<std::size_t>(i) * FeatDim + c] = static_cast<Scalar>(values[i].feature[c]);
    });
  }

  /// Copies the array of a map elsewhere, of the kind of `to`, into `to`.
  static void copy_array(const Executor<Backend>& executor, const void* from, Planes<Host>& to, int size) {
    const PlanesView source = static_cast<const Planes<Backend>*>(from)->view();
    for (int p = 0; p < kNumPlanes; ++p) copy_to_host(executor, source.plane(p), size, to.view().plane(p));
  }
  template <class T>
  static void copy_array(const Executor<Backend>& executor, const void* from, Rows<T, Host>& to, int size) {
    const auto* const source = static_cast<const Rows<T, Backend>*>(from);
    copy_to_host(executor, source->data(), static_cast<std::size_t>(size) * to.width(), to.data());
  }

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
  void resize(const Executor<Backend>& executor, int size) {
    for_each_array([&](auto& array) { array.resize(executor, size); });
  }

  Planes<Backend> geometry_;
  Rows<Scalar, Backend> features_{FeatDim};
  std::uint32_t next_uid_ = 0;
};

}  // namespace langgs
