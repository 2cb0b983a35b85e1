// SPDX-License-Identifier: Apache-2.0
// The front end over a whole sequence, without mapping: tracking, and the surface that frames are registered to, which
// grows as the mapper grows it. Prints the wall time of the frames and the trajectory error:
//   track   FrontEnd::track: grid cloud, registration, keyframe decision
//   whole   the same, and on keyframes the insertion into the surface and the renewal of the target
// Reading and drawing of images is not timed. `front_end --help` names the options.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <vector>

#include "common/dataset.hpp"
#include "langgs/eval/trajectory.hpp"
#include "langgs/host/worker_pool.hpp"
#include "langgs/manage/insertion.hpp"
#include "langgs/slam/front_end.hpp"
#include "langgs/track/keyframe_policy.hpp"
#include "langgs/track/measured_surface.hpp"

namespace langgs::benchmarks {
namespace {

struct Options {
  examples::DatasetOptions dataset;
  int threads = 1, stride = 1, max_frames = 0;
};

/// Front end and surface. Keyframes of either kind add to the surface, tracking keyframes renew the target, as in
/// LangGsSlam; no Gaussian moves or fades, since nothing optimises them.
class Odometry {
 public:
  Odometry(const Camera& camera, int threads) : camera_(camera), front_end_(camera, settings_), pool_(threads) {}

  void process(const RgbdFrame& frame, bool is_last) {
    const auto start = std::chrono::steady_clock::now();
    const TrackedFrame tracked = front_end_.track(frame, {is_last, false}, keyframe_policy_, pool_);
    track_ms.push_back(since(start));
    if (tracked.report.keyframe != KeyframeKind::none) {
      insert(tracked);
      ++num_keyframes;
    }
    if (tracked.report.keyframe == KeyframeKind::tracking)
      front_end_.set_target(surface_.target([&](int i) { return surface_.mean(i); }, [](int) { return true; }));
    whole_ms.push_back(since(start));
    trajectory.push_back({frame.timestamp, tracked.report.T_world_camera});
  }

  [[nodiscard]] const FrontEnd& front_end() const { return front_end_; }
  [[nodiscard]] int num_gaussians() const { return surface_.size(); }

  std::vector<double> track_ms, whole_ms;
  std::vector<StampedPose> trajectory;
  int num_keyframes = 0;

 private:
  static double since(std::chrono::steady_clock::time_point start) {
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
  }

  void insert(const TrackedFrame& tracked) {
    const Pose& T_world_camera = tracked.report.T_world_camera;
    std::vector<Eigen::Vector3f> means;
    means.reserve(tracked.cloud.points.size());
    for (const Eigen::Vector3f& point : tracked.cloud.points)
      means.push_back((T_world_camera * point.cast<double>()).cast<float>());
    std::vector<std::int32_t> chosen;
    redundancy_.select({means, tracked.squared_distance}, chosen);
    surface_.append(measured(tracked.cloud, chosen, camera_, T_world_camera, settings_.target_shape));
  }

  Camera camera_;
  TrackingSettings settings_;
  FrontEnd front_end_;
  WorkerPool pool_;
  KeyframePolicy keyframe_policy_;
  RedundancyFilter redundancy_;
  MeasuredSurface surface_;
};

void print(const char* name, std::vector<double> ms) {
  std::sort(ms.begin(), ms.end());
  // The smallest time that so many of all do not exceed.
  const auto quantile = [&](double q) {
    return ms[static_cast<std::size_t>(std::ceil(q * static_cast<double>(ms.size()))) - 1];
  };
  std::printf("%-6s ms  median %7.2f  p95 %7.2f  p99 %7.2f  max %7.2f\n", name, quantile(0.5), quantile(0.95),
              quantile(0.99), ms.back());
}

void run(const Options& options) {
  const auto dataset = examples::open_dataset(options.dataset);
  int count = (dataset->size() + options.stride - 1) / options.stride;
  if (options.max_frames > 0) count = std::min(count, options.max_frames);
  Odometry odometry(dataset->camera(), options.threads);
  for (int k = 0; k < count; ++k) odometry.process(dataset->frame(k * options.stride), k + 1 == count);

  std::printf("%s\n%d frames, %d keyframes, %d lost, %d skipped, %d Gaussians, %d threads\n",
              dataset->description().c_str(), count, odometry.num_keyframes, odometry.front_end().num_lost(),
              odometry.front_end().num_skipped(), odometry.num_gaussians(), options.threads);
  print("track", odometry.track_ms);
  print("whole", odometry.whole_ms);
  const std::vector<StampedPose> reference = dataset->reference();
  if (!reference.empty())
    std::printf("ATE RMSE %.3f cm\n", 100 * ate_umeyama_se3(odometry.trajectory, reference).rmse_m);
}

}  // namespace
}  // namespace langgs::benchmarks

int main(int argc, char** argv) {
  langgs::benchmarks::Options options;
  CLI::App app{"front_end: times the front end over a sequence, without mapping"};
  app.add_option("--dataset", options.dataset.kind, "synthetic: the built-in room; tum, replica: a folder")
      ->check(CLI::IsMember({"synthetic", "tum", "replica"}))
      ->capture_default_str();
  app.add_option("--input", options.dataset.input, "folder of the sequence (tum, replica)");
  app.add_option("--threads", options.threads)->check(CLI::Range(1, 1024))->capture_default_str();
  app.add_option("--stride", options.stride, "take every Nth frame")
      ->check(CLI::Range(1, 10000))
      ->capture_default_str();
  app.add_option("--max-frames", options.max_frames, "stop after so many frames; 0: all")
      ->check(CLI::Range(0, 1 << 30));
  app.add_option("--width", options.dataset.room.width, "synthetic: image width [px]")->capture_default_str();
  app.add_option("--height", options.dataset.room.height, "synthetic: image height [px]")->capture_default_str();
  app.add_option("--frames", options.dataset.room.frames, "synthetic: length of the path")->capture_default_str();
  app.add_option("--motion", options.dataset.room.motion, "synthetic: speed of the camera")->capture_default_str();
  app.add_flag("--depth-noise", options.dataset.room.depth_noise, "synthetic: depth errors like those of a Kinect");
  CLI11_PARSE(app, argc, argv);
  try {
    langgs::benchmarks::run(options);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "front_end: %s\n", error.what());
    return 2;
  }
  return 0;
}
