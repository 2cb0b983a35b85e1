// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <type_traits>
#include <utility>
#include <vector>

#include "langgs/core/rng.hpp"
#include "langgs/device/copy.hpp"
#include "langgs/device/replay.hpp"
#include "langgs/manage/insertion.hpp"
#include "langgs/manage/pruning_policy.hpp"
#include "langgs/map/gaussian_map.hpp"
#include "langgs/map/keyframe_store.hpp"
#include "langgs/optimize/adam.hpp"
#include "langgs/optimize/feature_step.hpp"
#include "langgs/optimize/feature_weight_gradient.hpp"
#include "langgs/optimize/field_coupling.hpp"
#include "langgs/optimize/geometric_loss.hpp"
#include "langgs/optimize/hybrid_schedule.hpp"
#include "langgs/render/topk_rasterizer.hpp"
#include "langgs/slam/front_end.hpp"
#include "langgs/slam/keyframe_poses.hpp"
#include "langgs/slam/keyframe_uploads.hpp"
#include "langgs/slam/mapping_kernels.hpp"
#include "langgs/track/measured_surface.hpp"

namespace langgs {

/// What the user of a mapper chooses by type.
template <class Pruning, class Schedule, class FeatureOptimizer, class Coupling>
struct MappingPolicies {
  const Pruning& pruning;
  const Schedule& schedule;
  const FeatureOptimizer& feature_optimizer;
  const Coupling& coupling;
};

/// The mapping side (paper sections 3.2 to 3.4): grows the map from keyframes and optimises it by rendering them.
template <int FeatDim, int K, class FeatureOptimizer, class Coupling, class Backend = Host>
class Mapper {
 public:
  using Map = GaussianMap<FeatDim, Backend, FeatureOptimizer>;

  Mapper(const Camera& camera, const SlamSettings& settings)
      : camera_(camera),
        settings_(settings),
        keyframes_(settings.mapping.keyframe_bytes),
        uploads_(settings.mapping.device_keyframe_bytes),
        redundancy_(settings.mapping.redundancy),
        loss_(settings.mapping.loss),
        adam_(settings.mapping.learning_rates) {}

  /// Inserts what a keyframe shows and the map does not have yet, and queues the keyframe for optimisation.
  void add_keyframe(const Executor<Backend>& executor, const TrackedFrame& tracked, const RgbdFrame& frame,
                    FeatureMap<FeatDim> features) {
    settle(executor);
    const FrameReport& report = tracked.report;
    std::vector<Eigen::Vector3f> means;
    means.reserve(tracked.cloud.points.size());
    for (const Eigen::Vector3f& point : tracked.cloud.points)
      means.push_back((report.T_world_camera * point.cast<double>()).template cast<float>());
    std::vector<std::int32_t> chosen;
    redundancy_.select({means, tracked.squared_distance}, chosen);
    const std::vector<Gaussian<FeatDim>> gaussians =
        make_gaussians(tracked.cloud, chosen, frame, camera_, features, report.T_world_camera,
                       settings_.mapping.initialization, settings_.tracking.source.stride);
    map_.append(executor, gaussians, iteration_, keyframes_.size());
    surface_.append(measured(tracked.cloud, chosen, camera_, report.T_world_camera, settings_.tracking.target_shape));
    inserted_ += static_cast<int>(chosen.size());
    suppressed_ += tracked.cloud.size() - static_cast<int>(chosen.size());

    keyframes_.add({report.frame_index, frame.timestamp, report.T_world_camera, report.T_world_camera, frame.colour,
                    tracked.depth.empty() ? frame.depth : tracked.depth, std::move(features)});
    poses_.add(report.T_world_camera);
    uploads_.prefetch(executor, keyframes_.size() - 1, keyframes_.all().back(), /*with_teacher=*/true);
  }

  /// What tracking registers frames to: the Gaussians that are opaque now, where they were measured.
  [[nodiscard]] std::shared_ptr<const GridTarget> make_target(const Executor<Backend>& executor) {
    settle(executor);
    const PlanesView g = planes_on_host(executor, map_.geometry(), geometry_on_host_);
    const float opacity = settings_.tracking.min_target_opacity, min_logit = std::log(opacity / (1 - opacity));
    return surface_.target(
        [&](int i) { return Eigen::Vector3f(g.plane(kMeanX)[i], g.plane(kMeanY)[i], g.plane(kMeanZ)[i]); },
        [&](int i) { return g.plane(kOpacityLogit)[i] > min_logit; });
  }

  /// One mapping iteration: render a keyframe, compare, step geometry and, when due, features; prune when due.
  /// A device is left to work: `finish` says when the map and the poses are those after the last iteration.
  template <MapPruning Pruning, OptimizationSchedule Schedule>
  void iterate(const Executor<Backend>& executor,
               const MappingPolicies<Pruning, Schedule, FeatureOptimizer, Coupling>& policies) {
    if (keyframes_.empty()) return;
    settle(executor);
    const int index = next_keyframe();
    Keyframe<FeatDim>& keyframe = keyframes_[index];
    poses_.refine(settings_.mapping.pose_refinement, index, keyframe.T_world_camera);
    const OptimizationStep due = policies.schedule(MappingVisit{iteration_, /*first_visit=*/keyframe.visits == 0});
    const bool features_due = due.features && !keyframe.features.empty();

    const auto start = std::chrono::steady_clock::now();
    rasterizer_.project(executor, map_.geometry(), View(camera_, keyframe.T_world_camera));
    visit_ = {index, due.geometry, features_due, policies.feature_optimizer, policies.coupling};
    look(executor);
    if (due.geometry) geometry_ms_.push_back(since(start));
    if (features_due) {
      const auto feature_start = std::chrono::steady_clock::now();
      step_features(executor);
      feature_ms_.push_back(since(feature_start));
    }
    ++keyframe.visits;
    ++iteration_;
    prune(executor, policies.pruning);
    const int next = next_keyframe();
    uploads_.prefetch(executor, next, keyframes_[next], /*with_teacher=*/false);
  }

  /// To be said after the last of several iterations, before anything is asked about the map and the keyframes.
  void finish(const Executor<Backend>& executor) {
    settle(executor);
    for (int i = 0; i < keyframes_.size(); ++i)
      poses_.refine(settings_.mapping.pose_refinement, i, keyframes_[i].T_world_camera);
  }

  [[nodiscard]] const Map& map() const { return map_; }
  [[nodiscard]] const std::vector<Keyframe<FeatDim>>& keyframes() const { return keyframes_.all(); }
  /// Features [h, w, FeatDim] and where there are any [h, w] of keyframe i, which has some, in the backend's memory;
  /// for work that is put on the executor before the mapper is asked for anything else.
  [[nodiscard]] std::pair<const Half*, const std::uint8_t*> teacher(const Executor<Backend>& executor, int i) {
    return uploads_.teacher(executor, i, keyframes_[i]);
  }
  /// Of the last iteration that moved geometry; waits for it.
  [[nodiscard]] double last_loss() const { return loss_.terms().total; }

  /// Bytes held by the map, by the keyframes, and by what a feature step needs besides.
  [[nodiscard]] MemoryReport memory_report() const {
    MemoryReport report = map_.memory_report();
    report.emplace_back("keyframe_features", keyframes_.feature_bytes());
    report.emplace_back("keyframe_images", keyframes_.bytes() - keyframes_.feature_bytes());
    report.emplace_back("feature_scratch", contributions_.bytes() + feature_step_.bytes());
    if (uploads_.bytes() > 0) report.emplace_back("keyframes_on_device", uploads_.bytes());
    return report;
  }

  void report(SlamStatistics& s) const {
    s.keyframes = keyframes_.size();
    s.gaussians = map_.size();
    s.geometry_iterations = static_cast<int>(geometry_ms_.size());
    s.feature_iterations = static_cast<int>(feature_ms_.size());
    s.inserted = inserted_;
    s.suppressed = suppressed_;
    s.pruned = pruned_;
    s.geometry_ms = geometry_ms_;
    s.feature_ms = feature_ms_;
  }

 private:
  static float since(std::chrono::steady_clock::time_point start) {
    return std::chrono::duration<float, std::milli>(std::chrono::steady_clock::now() - start).count();
  }

  [[nodiscard]] int next_keyframe() const {
    constexpr std::uint64_t kStream = 0x6b657966;  // of the choice of keyframes
    return keyframes_.next(CounterRng{settings_.seed, kStream}, static_cast<std::uint64_t>(iteration_));
  }

  /// What the memory and the launches of `look` depend on, once camera and settings are given.
  struct LearningArguments {
    PlanesView geometry, first_moment, second_moment;
    const std::int32_t* topk_count;
    int splats, instances;
    friend bool operator==(const LearningArguments&, const LearningArguments&) = default;
  };
  [[nodiscard]] LearningArguments learning_arguments() const {
    return {map_.geometry(),
            map_.first_moment.view(),
            map_.second_moment.view(),
            map_.statistics.topk_count.data(),
            rasterizer_.splats().num_splats(),
            rasterizer_.splats().num_instances()};
  }

  /// Sees to it that the last iteration took place. If it turns out that the lists of its render had no room, it has
  /// changed nothing, and is done again.
  void settle(const Executor<Backend>& executor) {
    if (rasterizer_.fits()) return;
    look(executor);
    if (visit_.steps_features) step_features(executor);
  }

  /// Renders what was projected and steps geometry when due.
  void look(const Executor<Backend>& executor) {
    const Keyframe<FeatDim>& keyframe = keyframes_[visit_.keyframe];
    const auto draw = [&] {
      rasterizer_.draw(executor, map_.geometry());  // Eqs. 1 and 2
      collect_statistics(executor);
    };
    if (!visit_.steps_geometry) return draw();
    unpack_target(executor, keyframe);
    const auto learn = [&] {
      draw();
      step_geometry(executor, keyframe);
    };
    if (is_coupled())
      learn();  // each keyframe has its teacher elsewhere
    else
      replay_(executor, learning_arguments(), learn);
    if (settings_.mapping.refine_poses && settings_.tracking.poses == PoseSource::gicp)
      poses_.observe(executor, visit_.keyframe, map_gradient_.pose_sums());
  }

  void unpack_target(const Executor<Backend>& executor, const Keyframe<FeatDim>& keyframe) {
    const std::size_t n = camera_.num_pixels();
    for (auto* buffer : {&target_, &gradient_}) buffer->resize_discard(executor, 4 * n);
    const auto images = uploads_.images(executor, visit_.keyframe, keyframe);
    for_each_n(executor, static_cast<int>(n),
               detail::UnpackTarget{images.first, images.second, target_.data(), static_cast<std::ptrdiff_t>(n)});
  }

  /// Whether features have a say in this iteration's geometry.
  [[nodiscard]] bool is_coupled() const { return Coupling::kCoupled && visit_.steps_features; }

  void step_geometry(const Executor<Backend>& executor, const Keyframe<FeatDim>& keyframe) {
    const std::size_t n = camera_.num_pixels();
    const RenderPlanes rendered = rasterizer_.rendered();
    loss_.start(executor, {rendered.colour, rendered.depth, camera_.width, camera_.height},
                {target_.data(), target_.data() + 3 * n, camera_.width, camera_.height},
                {gradient_.data(), gradient_.data() + 3 * n});
    backward(executor, keyframe);
    adam_.step(executor, map_, map_gradient_);
  }

  void backward(const Executor<Backend>& executor, const Keyframe<FeatDim>& keyframe) {
    const RenderGradient upstream{gradient_.data(), gradient_.data() + 3 * camera_.num_pixels()};
    if constexpr (Coupling::kCoupled) {
      if (is_coupled()) {
        const SampleGrid grid{keyframe.features.width(), keyframe.features.height(), camera_};
        on_weights_.start(executor, rasterizer_, grid, map_.features().data(), teacher(executor, visit_.keyframe).first,
                          visit_.coupling.weight);
        return rasterizer_.backward(executor, map_.geometry(), upstream, map_gradient_, on_weights_.view());
      }
    }
    rasterizer_.backward(executor, map_.geometry(), upstream, map_gradient_);
  }

  void step_features(const Executor<Backend>& executor) {
    const FeatureMap<FeatDim>& features = keyframes_[visit_.keyframe].features;
    const SampleGrid grid{features.width(), features.height(), camera_};
    const auto [values, present] = teacher(executor, visit_.keyframe);
    if (settings_.mapping.feature_rendering == FeatureRendering::topk)
      contributions_.from_topk(executor, rasterizer_, grid, present);
    else
      contributions_.from_blending(executor, rasterizer_.splats(), grid, present);
    feature_step_.step(executor, visit_.optimizer, map_, contributions_.view(), features, values);
  }

  void collect_statistics(const Executor<Backend>& executor) {
    Statistics<Backend>& s = map_.statistics;
    const SplatStatistics seen = rasterizer_.statistics();
    for_each_n(executor, rasterizer_.splats().splats_size(),
               detail::CollectStatistics{rasterizer_.splats().gaussian(), seen, s.topk_count.data(),
                                         s.max_weight.data(), s.num_views.data()});
  }

  template <MapPruning Pruning>
  void prune(const Executor<Backend>& executor, const Pruning& pruning) {
    if (!pruning.due(iteration_)) return;
    settle(executor);
    const PruningReport report = pruning.select(iteration_, pruning_statistics_.read(executor, map_), keep_);
    const int removed = map_.prune(executor, keep_);
    surface_.prune(keep_);
    pruned_ += removed;
    if (removed > 0) {
      const PlanesView g = planes_on_host(executor, map_.geometry(), geometry_on_host_);
      redundancy_.rebuild(
          g.size, [&](int i) { return Eigen::Vector3f(g.plane(kMeanX)[i], g.plane(kMeanY)[i], g.plane(kMeanZ)[i]); });
    }
    if (!report.reset_statistics) return;
    Statistics<Backend>& s = map_.statistics;
    const std::size_t n = map_.size();
    set_zero(executor, s.topk_count.data(), n);
    set_zero(executor, s.max_weight.data(), n);
    set_zero(executor, s.num_views.data(), n);
  }

  Camera camera_;
  SlamSettings settings_;
  Map map_;
  KeyframeStore<FeatDim> keyframes_;
  KeyframePoses<Backend> poses_;
  KeyframeUploads<FeatDim, Backend> uploads_;
  RedundancyFilter redundancy_;
  MeasuredSurface surface_;
  TopKRasterizer<K, Backend> rasterizer_;
  GeometricLoss<Backend> loss_;
  MapGradient<Backend> map_gradient_;
  SelectiveAdam<Backend> adam_;
  Contributions<Backend> contributions_;
  FeatureStep<FeatDim, FeatureOptimizer, Backend> feature_step_;
  std::conditional_t<Coupling::kCoupled, FeatureWeightGradient<FeatDim, K, Backend>, Coupling> on_weights_;
  Buffer<float, Backend> target_, gradient_;
  Download<float, Backend> geometry_on_host_;
  PruningStatisticsReader<Backend> pruning_statistics_;
  std::vector<std::int32_t> keep_;
  struct {
    int keyframe = 0;
    bool steps_geometry = false, steps_features = false;
    FeatureOptimizer optimizer{};
    Coupling coupling{};
  } visit_;  ///< of the last iteration
  Replay<LearningArguments, Backend> replay_;
  int iteration_ = 0, inserted_ = 0, suppressed_ = 0, pruned_ = 0;
  std::vector<float> geometry_ms_, feature_ms_;
};

}  // namespace langgs
