// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "langgs/eval/trajectory.hpp"
#include "langgs/frame/synthetic_room.hpp"
#include "langgs/manage/insertion.hpp"
#include "langgs/slam/front_end.hpp"
#include "langgs/track/measured_surface.hpp"
#include "support/sanitized.hpp"

/// @file Tracking alone through the built-in room, slowly, fast, and with colour blurred along the motion.

using namespace langgs;

namespace {

constexpr int kWalkLength = 75;
constexpr double kWalkInterval = 1.0 / 30;

SyntheticRoom room_at(double motion, int frames) {
  SyntheticRoomSettings settings;
  settings.width = 160;
  settings.height = 120;
  settings.frames = frames;
  settings.motion = motion;
  return SyntheticRoom(settings);
}

/// Frames at 30 Hz of a camera that gathers way over the first four. With `blur`, colour is the mean of three moments
/// of an exposure of half an interval, and depth that of the middle one.
std::vector<RgbdFrame> frames_at(double motion, bool blur) {
  constexpr int kMoments = 4;  // per frame at full speed; of which three are exposed
  const SyntheticRoom room = room_at(motion / kMoments, kWalkLength * kMoments);
  std::vector<RgbdFrame> frames;
  for (int i = 0, moment = 0; i < kWalkLength; ++i, moment += std::min(i, kMoments)) {
    frames.push_back(room.frame(moment));
    RgbdFrame& frame = frames.back();
    frame.timestamp = i * kWalkInterval;
    if (!blur || i < kMoments) continue;
    const RgbdFrame before = room.frame(moment - 1), after = room.frame(moment + 1);
    for (std::size_t k = 0; k < frame.colour.size(); ++k)
      frame.colour.data()[k] = static_cast<std::uint8_t>(
          (before.colour.data()[k] + frame.colour.data()[k] + after.colour.data()[k] + 1) / 3);
  }
  return frames;
}

struct Odometry {
  double rmse = 0, median = 0, largest = 0;  // of the positions [m]
  double fastest = 0;                        // rotation of the truth [degrees per second]
  int lost = 0, keyframes = 0;
};

Odometry odometry(const std::vector<RgbdFrame>& frames) {
  const Camera camera = room_at(1, 2).camera();
  TrackingSettings settings;
  settings.source.stride = 3;  // for the small image
  WorkerPool pool(1);
  FrontEnd front_end(camera, settings);
  KeyframePolicy policy;
  RedundancyFilter redundancy;
  MeasuredSurface surface;
  Odometry result;
  std::vector<StampedPose> estimate, truth;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const RgbdFrame& frame = frames[i];
    const TrackedFrame tracked = front_end.track(frame, {i + 1 == frames.size(), false}, policy, pool);
    estimate.push_back({frame.timestamp, tracked.report.T_world_camera});
    truth.push_back({frame.timestamp, *frame.T_world_camera});
    if (i > 0) {
      const Pose motion = truth[i - 1].T_world_camera.inverse() * truth[i].T_world_camera;
      result.fastest =
          std::max(result.fastest, so3_log(motion.linear()).norm() / kWalkInterval * 180 / std::numbers::pi);
    }
    if (tracked.report.keyframe != KeyframeKind::tracking) continue;
    ++result.keyframes;
    const Pose& T = tracked.report.T_world_camera;
    std::vector<Eigen::Vector3f> means;
    for (const Eigen::Vector3f& point : tracked.cloud.points) means.push_back((T * point.cast<double>()).cast<float>());
    std::vector<std::int32_t> chosen;
    redundancy.select({means, tracked.squared_distance}, chosen);
    surface.append(measured(tracked.cloud, chosen, camera, T, settings.target_shape));
    front_end.set_target(surface.target([&](int k) { return surface.mean(k); }, [](int) { return true; }));
  }
  const AteResult ate = ate_umeyama_se3(estimate, truth);
  result.rmse = ate.rmse_m;
  result.median = ate.median_m;
  result.largest = ate.max_m;
  result.lost = front_end.num_lost();
  return result;
}

void say(const std::string& name, const Odometry& o) {
  MESSAGE(name, ": ATE ", 1e3 * o.rmse, " mm, median ", 1e3 * o.median, " mm, at most ", 1e3 * o.largest, " mm; ",
          o.fastest, " degrees/s, ", o.keyframes, " keyframes, lost ", o.lost);
}

}  // namespace

TEST_CASE("fast rotations are tracked as well as slow ones, blurred colour or not" * doctest::skip(test::kSanitized)) {
  const Odometry slow = odometry(frames_at(1, false));
  say("slow", slow);
  CHECK(slow.lost == 0);
  CHECK(slow.fastest < 50);
  // From rest at full speed the second frame would be 7 degrees away from the guess, more than registration bridges.
  for (const bool blur : {false, true}) {
    const Odometry fast = odometry(frames_at(5, blur));
    say(blur ? "fast and blurred" : "fast", fast);
    CHECK(fast.fastest > 200);
    CHECK(fast.lost == 0);
    CHECK(fast.rmse < std::max(2 * slow.rmse, 1e-3));
  }
}

TEST_CASE("depth taken at another moment than colour: poses are those of the colour images" *
          doctest::skip(test::kSanitized)) {
  // Depth lies half an interval later; poses and time stamps are those of colour.
  const SyntheticRoom room = room_at(0.5, 4 * kWalkLength);
  std::vector<RgbdFrame> frames;
  for (int i = 0; i + 1 < kWalkLength; ++i) {
    frames.push_back(room.frame(4 * i));
    frames.back().timestamp = i * kWalkInterval;
    frames.back().depth = room.frame(4 * i + 2).depth;
    frames.back().depth_time_offset = 0.5 * kWalkInterval;
  }
  const Odometry known = odometry(frames);
  say("known", known);
  for (RgbdFrame& frame : frames) frame.depth_time_offset = 0;
  const Odometry ignored = odometry(frames);
  say("ignored", ignored);
  CHECK(known.lost == 0);
  // The median: at the first frame the motion is not known yet, so that its colour pose is wrong by 27 mm.
  CHECK(known.median < 1.5e-3);
  CHECK(known.median < 0.2 * ignored.median);
}
