// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <map>
#include <string>
#include <vector>

#include "langgs/frame/label_features.hpp"
#include "langgs/frame/synthetic_room.hpp"
#include "langgs/slam/slam.hpp"

/// @file A small synthetic room and small settings for the pipeline's tests, and what a run left behind as bytes.

namespace langgs::test {

inline constexpr int kDim = 16;

[[nodiscard]] inline SyntheticRoom small_room(int frames = 12) {
  SyntheticRoomSettings settings;
  settings.width = 80;
  settings.height = 60;
  settings.frames = frames;
  return SyntheticRoom(settings);
}

/// The frames of small_room(room.size()); each length is ray-cast once.
[[nodiscard]] inline std::vector<RgbdFrame> frames_of(const SyntheticRoom& room) {
  static std::map<int, std::vector<RgbdFrame>> known;
  std::vector<RgbdFrame>& frames = known[room.size()];
  while (static_cast<int>(frames.size()) < room.size()) frames.push_back(room.frame(static_cast<int>(frames.size())));
  return frames;
}

/// Settings for 80x60 images: a source point every other pixel.
[[nodiscard]] inline SlamSettings small_settings() {
  SlamSettings settings;
  settings.tracking.source.stride = 2;
  settings.iterations_per_frame = 3;
  // Fixed, so that tuning the defaults on images of a usual size does not move the bounds of these tests.
  settings.tracking.target_shape = TargetShape::isotropic;
  settings.mapping.initialization.opacity = 0.5f;
  settings.mapping.initialization.spread = 0.5f;
  settings.mapping.redundancy.squared_distance = 5e-4f;
  settings.mapping.loss.depth = 0.01f;
  return settings;
}

[[nodiscard]] inline KeyframePolicy often() {
  KeyframeSettings settings;
  settings.mapping_interval = 3;
  return KeyframePolicy(settings);
}

template <int D = kDim>
[[nodiscard]] LabelFeatures<D> label_features(const SyntheticRoom& room) {
  LabelFeatureSettings settings;
  settings.stride = 2;
  settings.blur = 1;
  return {[&room](const RgbdFrame& frame) { return room.labels(frame); }, SyntheticRoom::class_vectors(D), settings};
}

/// Processes the frames in order, as `langgs_slam --mode lockstep` does; every `hold_out`-th from `hold_out` is held
/// out of mapping.
template <class Slam, class Features>
std::vector<FrameReport> run(Slam& slam, const std::vector<RgbdFrame>& frames, Features& features, int hold_out = 0) {
  std::vector<FrameReport> reports;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    FrameRole role;
    role.held_out = hold_out > 0 && i > 0 && i % static_cast<std::size_t>(hold_out) == 0;
    role.is_last = i + 1 == frames.size();
    reports.push_back(slam.process(frames[i], features, role));
  }
  slam.finish();
  return reports;
}

/// Every byte of the map and of the trajectory.
struct Bytes {
  std::vector<std::string> parts;
  friend bool operator==(const Bytes&, const Bytes&) = default;

  template <class T>
  void add(const T* data, std::size_t count) {
    parts.emplace_back(reinterpret_cast<const char*>(data), count * sizeof(T));
  }
};

template <class Slam>
[[nodiscard]] Bytes bytes_of(const Slam& slam) {
  Bytes bytes;
  const auto map = slam.map().on_host(slam.executor());
  const std::size_t n = map.size();
  for (const PlanesView& planes : {map.geometry(), map.first_moment.view(), map.second_moment.view()})
    for (int p = 0; p < kNumPlanes; ++p) bytes.add(planes.plane(p), n);
  map.for_each_feature_array([&](const auto& rows) { bytes.add(rows.data(), n * rows.width()); });
  bytes.add(map.statistics.topk_count.data(), n);
  bytes.add(map.statistics.max_weight.data(), n);
  bytes.add(map.statistics.num_views.data(), n);
  bytes.add(map.statistics.birth.data(), n);
  bytes.add(map.statistics.uid.data(), n);
  bytes.add(map.statistics.keyframe.data(), n);
  for (const StampedPose& pose : slam.trajectory()) {
    bytes.add(&pose.timestamp, 1);
    bytes.add(pose.T_world_camera.matrix().data(), 16);
  }
  return bytes;
}

/// True where every number of the map, its moments and the poses is finite.
template <class Slam>
[[nodiscard]] bool all_finite(const Slam& slam) {
  const auto& map = slam.map();
  for (const PlanesView& planes : {map.geometry(), map.first_moment.view(), map.second_moment.view()})
    for (int p = 0; p < kNumPlanes; ++p)
      for (int i = 0; i < map.size(); ++i)
        if (!std::isfinite(planes.plane(p)[i])) return false;
  bool finite = true;
  map.for_each_feature_array([&](const auto& rows) {
    for (std::size_t i = 0; i < static_cast<std::size_t>(map.size()) * rows.width(); ++i)
      finite = finite && std::isfinite(static_cast<float>(rows.data()[i]));
  });
  if (!finite) return false;
  for (const StampedPose& pose : slam.trajectory())
    if (!std::isfinite(pose.timestamp) || !is_finite(pose.T_world_camera)) return false;
  return true;
}

}  // namespace langgs::test
