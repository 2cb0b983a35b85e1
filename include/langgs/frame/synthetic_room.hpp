// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>
#include <string>
#include <vector>

#include "langgs/core/camera.hpp"
#include "langgs/core/error.hpp"
#include "langgs/core/pose.hpp"
#include "langgs/frame/rgbd_frame.hpp"
#include "langgs/frame/synthetic/classes.hpp"
#include "langgs/frame/synthetic/path.hpp"
#include "langgs/frame/synthetic/raycaster.hpp"
#include "langgs/frame/synthetic/room.hpp"
#include "langgs/frame/synthetic/sensor.hpp"
#include "langgs/host/worker_pool.hpp"

namespace langgs {

struct SyntheticRoomSettings {
  int width = 320, height = 240;  ///< image size [px], each side in [8, 4096]
  int frames = 180;               ///< length of the closed path, in [1, 100000]; longer ones see more of the room
  std::uint64_t seed = 1;         ///< of books, textures, the hand's sway, and all noise
  double field_of_view = 70;      ///< horizontal [degrees], in [20, 120]
  double motion = 1;              ///< speed in [0.05, 10]: 1 is about 2 cm and 1 degree per frame
  double frames_per_second = 30;  ///< of the timestamps
  bool depth_noise = false;  ///< an error like that of a Kinect: quantised disparity, noise growing with z^2, holes
  double colour_noise = 0;   ///< standard deviation [8-bit levels], in [0, 64]
};

/// A furnished room, ray-cast analytically: RGB-D frames along a smooth hand-held path that returns to its start, with
/// exact poses and labels and without any file. The world is the first camera. A FrameSource; the same settings give
/// the same bits, in any order of access and for any number of threads.
class SyntheticRoom {
 public:
  explicit SyntheticRoom(const SyntheticRoomSettings& settings = {}, WorkerPool* pool = nullptr)
      : settings_(checked(settings)),
        pool_(pool),
        path_(settings.frames, settings.motion, settings.seed),
        caster_(detail::furnished_room(settings.seed)) {
    const double focal = 0.5 * settings.width / std::tan(settings.field_of_view * std::numbers::pi / 360);
    camera_ = {static_cast<float>(focal),
               static_cast<float>(focal),
               0.5f * static_cast<float>(settings.width - 1),
               0.5f * static_cast<float>(settings.height - 1),
               settings.width,
               settings.height};
  }

  [[nodiscard]] const SyntheticRoomSettings& settings() const { return settings_; }
  [[nodiscard]] Camera camera() const { return camera_; }
  [[nodiscard]] int size() const { return settings_.frames; }

  /// The next frame of the path; false after the last one.
  bool next(RgbdFrame& frame) {
    if (next_ >= size()) return false;
    frame = this->frame(next_++);
    return true;
  }
  void rewind() { next_ = 0; }

  /// Frame i in [0, size()), with the sensor's errors as set.
  [[nodiscard]] RgbdFrame frame(int i) const {
    expect_frame(i);
    detail::CastView view = caster_.render(camera_, path_.T_room_camera(i), true, pool_);
    const auto stream = [&](std::uint64_t purpose) {
      return CounterRng{settings_.seed, 16 * static_cast<std::uint64_t>(i) + purpose};
    };
    if (settings_.depth_noise) detail::degrade_depth(view, stream(1));
    if (settings_.colour_noise > 0) detail::degrade_colour(view.colour, settings_.colour_noise, stream(2));
    return {i / settings_.frames_per_second, 0, std::move(view.colour), std::move(view.depth), ground_truth(i)};
  }

  /// Labels [H, W] of frame i: index into class_names(), in [1, num_classes()].
  [[nodiscard]] Image<std::uint16_t> labels(int i) const {
    expect_frame(i);
    return caster_.render(camera_, path_.T_room_camera(i), false, pool_).labels;
  }
  /// Labels of a frame that came from this room, found by its timestamp.
  [[nodiscard]] Image<std::uint16_t> labels(const RgbdFrame& frame) const {
    return labels(static_cast<int>(std::lround(frame.timestamp * settings_.frames_per_second)));
  }

  /// Exact pose T_world_camera of frame i; the identity for i = 0.
  [[nodiscard]] Pose ground_truth(int i) const {
    expect_frame(i);
    if (i == 0) return Pose::Identity();
    return path_.T_room_camera(0).inverse() * path_.T_room_camera(i);
  }

  /// Highest label; there are num_classes() + 1 names, since 0 stands for nothing and never occurs.
  [[nodiscard]] static int num_classes() { return detail::kNumLabels - 1; }
  [[nodiscard]] static std::vector<std::string> class_names() { return detail::label_names(); }

  /// Unit feature of each label [num_classes() + 1, dim], row 0 zeros. Some labels resemble each other closely (chair
  /// and sofa, book and box, the two balls: cosine about 0.85), others less (0.3 to 0.7), as text embeddings do.
  [[nodiscard]] static std::vector<float> class_vectors(int dim, std::uint64_t seed = 1) {
    return detail::label_vectors(dim, seed);
  }
  template <int FeatDim>
  [[nodiscard]] static std::vector<float> class_vectors() {
    return class_vectors(FeatDim);
  }

 private:
  static const SyntheticRoomSettings& checked(const SyntheticRoomSettings& s) {
    LANGGS_EXPECTS(s.width >= 8 && s.height >= 8 && s.width <= 4096 && s.height <= 4096, "synthetic image is ", s.width,
                   "x", s.height, "; each side must be in [8, 4096]");
    LANGGS_EXPECTS(s.frames >= 1 && s.frames <= 100000, "number of frames is ", s.frames,
                   "; it must be in [1, 100000]");
    LANGGS_EXPECTS(s.field_of_view >= 20 && s.field_of_view <= 120, "field of view is ", s.field_of_view,
                   " degrees; it must be in [20, 120]");
    LANGGS_EXPECTS(s.motion >= 0.05 && s.motion <= 10, "motion is ", s.motion, "; it must be in [0.05, 10]");
    LANGGS_EXPECTS(s.frames_per_second > 0 && s.frames_per_second <= 1e6, "frame rate is ", s.frames_per_second,
                   " Hz; it must be in (0, 1e6]");
    LANGGS_EXPECTS(s.colour_noise >= 0 && s.colour_noise <= 64, "colour noise is ", s.colour_noise,
                   " levels; it must be in [0, 64]");
    return s;
  }

  void expect_frame(int i) const {
    LANGGS_EXPECTS(i >= 0 && i < size(), "frame ", i, " does not exist; this room has frames 0 to ", size() - 1);
  }

  SyntheticRoomSettings settings_;
  WorkerPool* pool_;
  Camera camera_;
  detail::HandheldPath path_;
  detail::RayCaster caster_;
  int next_ = 0;
};

static_assert(FrameSource<SyntheticRoom>);

}  // namespace langgs
