// SPDX-License-Identifier: Apache-2.0
#include "common/dataset.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <mutex>

#include "langgs/core/error.hpp"
#include "langgs/host/worker_pool.hpp"

namespace langgs::examples {

namespace fs = std::filesystem;

namespace {

class SyntheticDataset : public Dataset {
 public:
  explicit SyntheticDataset(const DatasetOptions& options) : pool_(options.num_threads), room_(options.room, &pool_) {}

  [[nodiscard]] Camera camera() const override { return room_.camera(); }
  [[nodiscard]] int size() const override { return room_.size(); }
  [[nodiscard]] double timestamp(int i) const override { return i / room_.settings().frames_per_second; }
  [[nodiscard]] RgbdFrame frame(int i) const override {
    const std::lock_guard lock(mutex_);
    RgbdFrame frame = room_.frame(i);
    frame.T_world_camera.reset();
    return frame;
  }
  [[nodiscard]] std::string name(int i) const override {
    char text[32];
    std::snprintf(text, sizeof(text), "%06d", i);
    return text;
  }
  [[nodiscard]] std::vector<StampedPose> reference() const override {
    std::vector<StampedPose> poses;
    for (int i = 0; i < size(); ++i) poses.push_back({timestamp(i), room_.ground_truth(i)});
    return poses;
  }
  [[nodiscard]] bool has_labels() const override { return true; }
  [[nodiscard]] Image<std::uint16_t> labels(int i) const override {
    const std::lock_guard lock(mutex_);
    return room_.labels(i);
  }
  [[nodiscard]] std::vector<std::string> class_names() const override { return SyntheticRoom::class_names(); }
  [[nodiscard]] std::vector<float> class_vectors(int dim) const override { return SyntheticRoom::class_vectors(dim); }
  [[nodiscard]] std::string description() const override {
    return detail::concat(size(), " frames of ", camera().width, "x", camera().height, ", built-in room",
                          room_.settings().depth_noise ? ", depth with a sensor's noise" : ", exact depth");
  }

 private:
  mutable std::mutex mutex_;  // the pool runs one thing at a time
  mutable WorkerPool pool_;
  SyntheticRoom room_;
};

}  // namespace

std::unique_ptr<Dataset> make_synthetic_dataset(const DatasetOptions& options) {
  return std::make_unique<SyntheticDataset>(options);
}

std::unique_ptr<Dataset> open_dataset(const DatasetOptions& options) {
  LANGGS_EXPECTS(options.max_gap >= 0 && options.max_gap < 1e6, "--max-gap is ", options.max_gap,
                 " s; it must not be negative");
  if (options.kind == "synthetic") return make_synthetic_dataset(options);
  LANGGS_EXPECTS(options.kind == "tum" || options.kind == "replica", "--dataset '", options.kind,
                 "'; give synthetic, tum or replica");
  LANGGS_EXPECTS(!options.input.empty(), "--dataset ", options.kind, " needs --input DIR, the folder of the sequence");
  if (!fs::is_directory(options.input))
    detail::raise<IoError>("--input ", options.input.string(), " is not a folder; check the path");
  // What lies in the folder decides: rendered sequences come in the layout of TUM too.
  const bool tum_layout = fs::exists(options.input / "rgb.txt");
  const bool replica_layout = fs::is_directory(options.input / "results") || fs::is_directory(options.input / "images");
  const bool as_tum = tum_layout || (options.kind == "tum" && !replica_layout);
  std::unique_ptr<Dataset> dataset = as_tum ? make_tum_dataset(options) : make_replica_dataset(options);
  (void)dataset->frame(0);
  return dataset;
}

std::optional<Pose> pose_at(const std::vector<StampedPose>& reference, double timestamp, double max_gap) {
  const auto after = std::lower_bound(reference.begin(), reference.end(), timestamp,
                                      [](const StampedPose& pose, double value) { return pose.timestamp < value; });
  const auto near = [&](const StampedPose& pose) { return std::abs(pose.timestamp - timestamp) <= max_gap; };
  const bool has_after = after != reference.end() && near(*after);
  const bool has_before = after != reference.begin() && near(*(after - 1));
  if (has_after && (after->timestamp == timestamp || !has_before)) return after->T_world_camera;
  if (!has_before) return std::nullopt;
  const StampedPose& a = *(after - 1);
  if (!has_after) return a.T_world_camera;
  const double t = (timestamp - a.timestamp) / (after->timestamp - a.timestamp);
  const Eigen::Quaterniond qa(Eigen::Matrix3d(a.T_world_camera.linear())),
      qb(Eigen::Matrix3d(after->T_world_camera.linear()));
  Pose pose = Pose::Identity();
  pose.linear() = qa.slerp(t, qb).toRotationMatrix();
  pose.translation() = (1 - t) * a.T_world_camera.translation() + t * after->T_world_camera.translation();
  return pose;
}

}  // namespace langgs::examples
