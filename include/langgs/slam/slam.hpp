// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <utility>
#include <vector>

#include "langgs/frame/feature_map.hpp"
#include "langgs/optimize/feature_average.hpp"
#include "langgs/render/feature_compositor.hpp"
#include "langgs/slam/front_end.hpp"
#include "langgs/slam/mapper.hpp"
#include "langgs/slam/realtime.hpp"
#include "langgs/slam/report.hpp"
#include "langgs/slam/settings.hpp"
#include "langgs/slam/view_renderer.hpp"

namespace langgs {

/// LangGS-SLAM: an RGB-D camera comes in, a map of 3D Gaussians with language features grows.
///
/// The policies are public members: replace them by types of your own, or set their fields, before the first frame.
/// `process` is the lockstep schedule: the same input gives the same bits, for any number of threads.
/// `run_realtime` is the same pipeline with tracking and mapping in threads of their own.
/// Mapping and rendering run on `Backend`; tracking runs on the host.
template <int FeatDim, int K = 3, class Pruning = PruningPolicy, class Schedule = HybridSchedule,
          class FeatureOptimizer = FeatureAverage<>, class Coupling = DecoupledFields, class Backend = Host>
class LangGsSlam {
  static_assert(FeatDim >= 1 && FeatDim <= 4096, "FeatDim must be in [1, 4096]; LSeg and CLIP ViT-B/32 use 512");
  static_assert(require_map_pruning<Pruning>() && require_optimization_schedule<Schedule>() &&
                require_feature_optimizer<FeatureOptimizer>());
  static_assert(K >= 1 && K <= 16, "LangGsSlam<FeatDim, K>: K must be in [1, 16]; the paper uses 3");

 public:
  using Map = GaussianMap<FeatDim, Backend, FeatureOptimizer>;

  LangGsSlam(const Camera& camera, const SlamSettings& settings)
      : LangGsSlam(camera, settings, make_executor<Backend>(checked(settings).num_threads)) {}
  /// Works on an executor of the user's.
  LangGsSlam(const Camera& camera, const SlamSettings& settings, Executor<Backend> executor)
      : camera_(camera),
        settings_(checked(settings)),
        executor_(std::move(executor)),
        threads_(detail::HostBackend<Backend> ? nullptr : std::make_unique<WorkerPool>(settings.num_threads)),
        front_end_(camera, settings.tracking),
        mapper_(camera, settings) {}

  Pruning pruning;                     ///< when and what to remove (section 3.3.1)
  Schedule schedule;                   ///< when to step which field (section 3.4)
  FeatureOptimizer feature_optimizer;  ///< how features learn, and how the map stores them (section 3.4)
  Coupling coupling;                   ///< whether the feature loss moves geometry (off, section 3.4)
  KeyframePolicy keyframe_policy;      ///< which frames train the map (section 3)

  /// One frame, then `iterations_per_frame` mapping iterations. Throws InvalidArgument for an image of the wrong shape;
  /// a frame that is well formed but not usable is skipped and reported.
  template <FeatureSource<FeatDim> Features>
  FrameReport process(const RgbdFrame& frame, Features& features, const FrameRole& role = {}) {
    TrackedFrame tracked = front_end_.track(frame, role, keyframe_policy, pool());  // section 3
    if (tracked.report.keyframe != KeyframeKind::none) {
      mapper_.add_keyframe(executor_, tracked, frame, features(frame));  // section 3.3.2
      if (tracked.report.keyframe == KeyframeKind::tracking) front_end_.set_target(mapper_.make_target(executor_));
    }
    iterate(settings_.iterations_per_frame);  // sections 3.2 to 3.4
    tracked.report.num_gaussians = mapper_.map().size();
    tracked.report.loss = mapper_.last_loss();
    return tracked.report;
  }

  /// The mapping iterations after the last frame, if any are asked for.
  void finish() { iterate(settings_.final_iterations); }

  /// Tracks the frames of `source` at up to `fps` frames per second (0: as they come) in the calling thread, while a
  /// second thread maps. `observer(report)` is called after each frame and returns false to stop early;
  /// it must not touch the map, which is being written meanwhile. No frame is held out and `finish` is the caller's.
  template <FrameSource Source, FeatureSource<FeatDim> Features, class Observer>
  void run_realtime(Source& source, Features& features, Observer&& observer, double fps = 0) {
    RealtimeRunner runner(front_end_, mapper_, keyframe_policy, policies(), executor_);
    runner.run(source, features, observer, fps);
  }

  [[nodiscard]] const Map& map() const { return mapper_.map(); }
  /// What the map's memory is used by; `map().on_host(executor())` copies it to the host.
  [[nodiscard]] const Executor<Backend>& executor() const { return executor_; }
  [[nodiscard]] const std::vector<Keyframe<FeatDim>>& keyframes() const { return mapper_.keyframes(); }
  [[nodiscard]] const Camera& camera() const { return camera_; }
  /// Bytes held, part by part: the map, the keyframes, and what a feature step needs besides.
  [[nodiscard]] MemoryReport memory_report() const { return mapper_.memory_report(); }
  /// Poses of all frames so far, as tracked. Refinement makes views sharper, not the path truer (docs/benchmarks.md).
  [[nodiscard]] std::vector<StampedPose> trajectory() const { return front_end_.trajectory(); }
  /// Poses to render the map from: the keyframes' refinement is carried to the frames between them.
  [[nodiscard]] std::vector<StampedPose> refined_trajectory() const {
    return front_end_.refined_trajectory(mapper_.keyframes());
  }

  [[nodiscard]] SlamStatistics statistics() const {
    SlamStatistics s;
    mapper_.report(s);
    s.frames = front_end_.num_frames();
    s.lost_frames = front_end_.num_lost();
    s.relocalizations = front_end_.num_relocalized();
    s.skipped_frames = front_end_.num_skipped();
    s.track_ms = front_end_.milliseconds();
    return s;
  }

  /// Colour and depth of any view.
  [[nodiscard]] RenderedImages render(const Camera& camera, const Pose& T_world_camera) {
    return renderer_.images(executor_, map(), View(camera, T_world_camera));
  }
  /// Features [height, width, FeatDim] of any view, Top-K composited at the pixel centres of a width x height map.
  [[nodiscard]] std::vector<float> feature_image(const Camera& camera, const Pose& T_world_camera, int width,
                                                 int height) {
    return renderer_.features(executor_, map(), View(camera, T_world_camera), {width, height, camera});
  }
  /// Mean cosine of the rendered features to the teachers of all keyframes that still hold theirs.
  [[nodiscard]] TeacherCosine teacher_cosine() {
    TeacherCosine cosine;
    for (std::size_t i = 0; i < keyframes().size(); ++i) {
      const Keyframe<FeatDim>& k = keyframes()[i];
      if (k.features.empty()) continue;
      renderer_.compare(executor_, map(), View(camera_, k.T_world_camera),
                        {k.features.width(), k.features.height(), camera_},
                        mapper_.teacher(executor_, static_cast<int>(i)), cosine);
    }
    return cosine;
  }
  /// Per pixel the row of `class_vectors` [num_rows, FeatDim] nearest in direction to the rendered feature; row 0
  /// stands for "nothing" and is given where no Gaussian is seen.
  [[nodiscard]] Image<std::uint16_t> label_image(const Camera& camera, const Pose& T_world_camera,
                                                 const std::vector<float>& class_vectors) {
    return renderer_.labels(executor_, map(), View(camera, T_world_camera), class_vectors);
  }

 private:
  static const SlamSettings& checked(const SlamSettings& settings) {
    validate(settings);
    return settings;
  }
  [[nodiscard]] WorkerPool& pool() {
    if constexpr (detail::HostBackend<Backend>)
      return executor_.pool();
    else
      return *threads_;
  }
  void iterate(int n) {
    for (int i = 0; i < n; ++i) mapper_.iterate(executor_, policies());
    mapper_.finish(executor_);
  }
  [[nodiscard]] MappingPolicies<Pruning, Schedule, FeatureOptimizer, Coupling> policies() const {
    return {pruning, schedule, feature_optimizer, coupling};
  }

  Camera camera_;
  SlamSettings settings_;
  Executor<Backend> executor_;
  std::unique_ptr<WorkerPool> threads_;  ///< of tracking, where the executor has none
  FrontEnd front_end_;
  Mapper<FeatDim, K, FeatureOptimizer, Coupling, Backend> mapper_;
  ViewRenderer<FeatDim, K, Backend> renderer_;
};

}  // namespace langgs
