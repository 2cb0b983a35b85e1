// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "common/feature_sources.hpp"
#include "common/options.hpp"
#include "common/pipeline.hpp"
#include "langgs/io/safetensors.hpp"
#include "langgs/optimize/feature_adam.hpp"
#include "langgs/slam/slam.hpp"

namespace langgs::examples {

/// Pipeline by LangGsSlam<D, K> on a backend, whose features learn by `Optimizer`. Included only by the pipeline_d*.cpp
/// and pipeline_cuda.cu, which share the time that it takes to compile.
template <int D, int K, class Optimizer, class Backend>
class PipelineOf : public Pipeline {
 public:
  PipelineOf(const RunOptions& options, const Dataset& dataset, const std::vector<float>& class_vectors)
      : slam_(dataset.camera(), slam_settings(options)), features_(make_features<D>(options, dataset, class_vectors)) {
    slam_.pruning.seed = options.seed;
    if (options.no_pruning) slam_.pruning.backbone_period = slam_.pruning.consistency_period = 0;
    slam_.schedule.feature_every = options.schedule == "joint" ? 1 : options.feature_every;
  }

  FrameReport process(const RgbdFrame& frame, const FrameRole& role) override {
    return slam_.process(frame, features_, role);
  }
  void finish() override { slam_.finish(); }
  void run_realtime(const std::function<bool(RgbdFrame&)>& next,
                    const std::function<bool(const FrameReport&)>& observer, double fps) override {
    struct Source {
      Camera intrinsics;
      const std::function<bool(RgbdFrame&)>& fill;
      [[nodiscard]] Camera camera() const { return intrinsics; }
      bool next(RgbdFrame& frame) { return fill(frame); }
    } source{slam_.camera(), next};
    slam_.run_realtime(source, features_, observer, fps);
  }

  [[nodiscard]] std::vector<StampedPose> trajectory() const override { return slam_.trajectory(); }
  [[nodiscard]] std::vector<StampedPose> refined_trajectory() const override { return slam_.refined_trajectory(); }
  [[nodiscard]] std::vector<KeyframeView> keyframes() const override {
    std::vector<KeyframeView> views;
    for (const Keyframe<D>& k : slam_.keyframes()) views.push_back({k.frame_index, k.timestamp, k.T_world_camera});
    return views;
  }
  [[nodiscard]] SlamStatistics statistics() const override { return slam_.statistics(); }
  [[nodiscard]] MemoryReport memory_report() const override { return slam_.memory_report(); }
  [[nodiscard]] MemoryReport map_memory_report() const override { return slam_.map().memory_report(); }

  [[nodiscard]] RenderedImages render(const Camera& camera, const Pose& T_world_camera) override {
    return slam_.render(camera, T_world_camera);
  }
  [[nodiscard]] Image<std::uint16_t> label_image(const Camera& camera, const Pose& T_world_camera,
                                                 const std::vector<float>& class_vectors) override {
    return slam_.label_image(camera, T_world_camera, class_vectors);
  }
  [[nodiscard]] std::vector<float> feature_image(const Camera& camera, const Pose& T_world_camera, int width,
                                                 int height) override {
    return slam_.feature_image(camera, T_world_camera, width, height);
  }

  [[nodiscard]] std::optional<double> teacher_cosine() override {
    const TeacherCosine cosine = slam_.teacher_cosine();
    return cosine.pixels > 0 ? std::optional<double>(cosine.mean()) : std::nullopt;
  }

  [[nodiscard]] SplatCloud splats() const override {
    return with_map([](const auto& map) { return splats_of(map); });
  }

  [[nodiscard]] std::vector<float> feature_samples(int count) const override {
    return with_map([&](const auto& map) {
      const int n = map.size(), step = std::max(1, n / std::max(1, count));
      std::vector<float> samples;
      for (int i = 0; i < n; i += step)
        for (int c = 0; c < D; ++c) samples.push_back(static_cast<float>(map.features().row(i)[c]));
      return samples;
    });
  }

  void save_map(const std::filesystem::path& path, const std::map<std::string, std::string>& metadata) const override {
    with_map([&](const auto& map) { save(map, path, metadata); });
  }

 private:
  /// Calls use(map) with the map in the host's memory: itself, or a copy.
  template <class Use>
  auto with_map(const Use& use) const {
    if constexpr (detail::HostBackend<Backend>)
      return use(slam_.map());
    else
      return use(slam_.map().on_host(slam_.executor()));
  }

  template <class Map>
  [[nodiscard]] static SplatCloud splats_of(const Map& map) {
    const PlanesView g = map.geometry();
    const auto at = [&](int plane, std::size_t i) { return g.plane(plane)[i]; };
    SplatCloud cloud;
    cloud.resize(static_cast<std::size_t>(g.size));
    for (std::size_t i = 0; i < cloud.size(); ++i) {
      cloud.mean[i] = {at(kMeanX, i), at(kMeanY, i), at(kMeanZ, i)};
      cloud.colour[i] = {at(kRed, i), at(kGreen, i), at(kBlue, i)};
      cloud.log_scale[i] = {at(kLogScaleX, i), at(kLogScaleY, i), at(kLogScaleZ, i)};
      cloud.opacity_logit[i] = at(kOpacityLogit, i);
      const Eigen::Vector4f q =
          Eigen::Vector4f(at(kRotationW, i), at(kRotationX, i), at(kRotationY, i), at(kRotationZ, i)).normalized();
      cloud.rotation[i] = {q[0], q[1], q[2], q[3]};
    }
    return cloud;
  }

  template <class Map>
  static void save(const Map& map, const std::filesystem::path& path,
                   const std::map<std::string, std::string>& metadata) {
    const SplatCloud cloud = splats_of(map);
    const std::size_t n = cloud.size();
    SafetensorsWriter writer;
    writer.metadata = metadata;
    writer.add("means", {n, 3}, cloud.mean.data()->data());
    writer.add("colours", {n, 3}, cloud.colour.data()->data());
    writer.add("log_scales", {n, 3}, cloud.log_scale.data()->data());
    writer.add("rotations", {n, 4}, cloud.rotation.data()->data());
    writer.add("opacity_logits", {n}, cloud.opacity_logit.data());
    std::vector<Half> rounded;
    if constexpr (D > 1) {
      const auto* values = map.features().data();
      const Half* halves;
      if constexpr (std::is_same_v<decltype(values), const Half*>) {
        halves = values;
      } else {
        rounded.reserve(n * D);
        for (std::size_t i = 0; i < n * D; ++i) rounded.push_back(Half(values[i]));
        halves = rounded.data();
      }
      writer.add("features", {n, static_cast<std::size_t>(D)}, halves);
    }
    writer.save(path);
  }

  LangGsSlam<D, K, PruningPolicy, HybridSchedule, Optimizer, DecoupledFields, Backend> slam_;
  FeatureFunction<D> features_;
};

template <class Optimizer>
inline constexpr std::string_view kOptimizerName = "average";
template <class T>
inline constexpr std::string_view kOptimizerName<FeatureAdam<T>> = "adam";

/// The pipeline for options that ask for dimension D, one of the Ks, the optimiser and the backend, else null. Without
/// features D is 1, and nobody looks at the optimiser.
template <int D, class Optimizer, class Backend, int... Ks>
[[nodiscard]] std::unique_ptr<Pipeline> pipeline_with_k(const RunOptions& options, const Dataset& dataset,
                                                        const std::vector<float>& class_vectors) {
  const std::string_view device = detail::HostBackend<Backend> ? "host" : "cuda";
  if (options.device != device || (options.has_features() ? options.feature_dim : 1) != D) return nullptr;
  if (options.has_features() && options.feature_optimizer != kOptimizerName<Optimizer>) return nullptr;
  std::unique_ptr<Pipeline> result;
  const auto choose = [&]<int K>() {
    if (options.top_k == K)
      result = std::make_unique<PipelineOf<D, K, Optimizer, Backend>>(options, dataset, class_vectors);
  };
  (choose.template operator()<Ks>(), ...);
  return result;
}

}  // namespace langgs::examples
