// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "langgs/eval/association.hpp"
#include "langgs/io/ply.hpp"
#include "langgs/map/gaussian_map.hpp"
#include "langgs/slam/report.hpp"

namespace langgs {
struct RgbdFrame;
struct SlamSettings;
}  // namespace langgs

namespace langgs::examples {

class Dataset;
struct RunOptions;

/// A keyframe without its images and features.
struct KeyframeView {
  int frame_index = 0;
  double timestamp = 0;
  Pose T_world_camera = Pose::Identity();
};

/// LangGsSlam<FeatDim, K> behind an interface: D, K and the device are known at run time here, at compile time there.
class Pipeline {
 public:
  virtual ~Pipeline() = default;

  virtual FrameReport process(const RgbdFrame& frame, const FrameRole& role) = 0;
  virtual void finish() = 0;
  /// Runs in real time until `next` or `observer` returns false.
  virtual void run_realtime(const std::function<bool(RgbdFrame&)>& next,
                            const std::function<bool(const FrameReport&)>& observer, double fps) = 0;

  [[nodiscard]] virtual std::vector<StampedPose> trajectory() const = 0;
  [[nodiscard]] virtual std::vector<StampedPose> refined_trajectory() const = 0;
  [[nodiscard]] virtual std::vector<KeyframeView> keyframes() const = 0;
  [[nodiscard]] virtual SlamStatistics statistics() const = 0;
  [[nodiscard]] virtual MemoryReport memory_report() const = 0;      ///< of everything
  [[nodiscard]] virtual MemoryReport map_memory_report() const = 0;  ///< of the map alone

  [[nodiscard]] virtual RenderedImages render(const Camera& camera, const Pose& T_world_camera) = 0;
  [[nodiscard]] virtual Image<std::uint16_t> label_image(const Camera& camera, const Pose& T_world_camera,
                                                         const std::vector<float>& class_vectors) = 0;
  /// [height, width, D]
  [[nodiscard]] virtual std::vector<float> feature_image(const Camera& camera, const Pose& T_world_camera, int width,
                                                         int height) = 0;

  /// Mean cosine of rendered features to their teachers at the keyframes; nothing without teachers.
  [[nodiscard]] virtual std::optional<double> teacher_cosine() = 0;

  [[nodiscard]] virtual SplatCloud splats() const = 0;
  /// Features of up to `count` Gaussians, evenly chosen [n, D].
  [[nodiscard]] virtual std::vector<float> feature_samples(int count) const = 0;
  /// The whole map; the same map and metadata give the same bytes.
  virtual void save_map(const std::filesystem::path& path,
                        const std::map<std::string, std::string>& metadata) const = 0;
};

/// How a run's options set the system's knobs.
[[nodiscard]] SlamSettings slam_settings(const RunOptions& options);

/// The pipeline for the options' D and K. `class_vectors` [labels, D] serve --features labels. Throws InvalidArgument
/// listing the supported values of D and K for one that was not compiled in.
[[nodiscard]] std::unique_ptr<Pipeline> make_pipeline(const RunOptions& options, const Dataset& dataset,
                                                      const std::vector<float>& class_vectors);

/// Whether --device cuda is compiled in.
[[nodiscard]] bool has_cuda();
[[nodiscard]] std::string supported_dims_text();
[[nodiscard]] std::string supported_k_text();

}  // namespace langgs::examples
