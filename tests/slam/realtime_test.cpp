// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <atomic>
#include <chrono>
#include <stdexcept>
#include <string>
#include <vector>

#include "slam/small_run.hpp"

using namespace langgs;
using test::kDim;

namespace {

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

/// A FrameSource over prepared frames that can repeat them for ever, or fail.
struct Frames {
  Camera intrinsics;
  std::vector<RgbdFrame> frames;
  bool forever = false;
  int fails_at = -1, count = 0;

  [[nodiscard]] Camera camera() const { return intrinsics; }
  bool next(RgbdFrame& frame) {
    if (count == fails_at) throw std::runtime_error("the camera was unplugged");
    if (!forever && count >= static_cast<int>(frames.size())) return false;
    frame = frames[forever ? 0 : count];
    frame.timestamp = count++ / 30.0;
    return true;
  }
};

struct Fixture {
  SyntheticRoom room = test::small_room(10);
  Frames source{room.camera(), test::frames_of(room)};
  LabelFeatures<kDim> features = test::label_features(room);
  SlamSettings settings = test::small_settings();
  std::chrono::steady_clock::time_point start = std::chrono::steady_clock::now();
};

struct FailingFeatures {
  int fails_at = 0, calls = 0;
  FeatureMap<kDim> operator()(const RgbdFrame&) {
    if (calls++ == fails_at) throw std::runtime_error("encoder died");
    return {};
  }
};

std::string what_of(auto&& run) {
  try {
    run();
  } catch (const std::runtime_error& e) {
    return e.what();
  }
  return "nothing was thrown";
}

}  // namespace

TEST_CASE("two threads run to the end of the source") {
  Fixture f;
  SUBCASE("one worker") {}
  SUBCASE("two workers") { f.settings.num_threads = 2; }
  LangGsSlam<kDim> slam(f.room.camera(), f.settings);
  slam.keyframe_policy = test::often();
  int calls = 0;
  slam.run_realtime(f.source, f.features, [&](const FrameReport& report) {
    CHECK(report.frame_index == calls);
    ++calls;
    return true;
  });
  CHECK(calls == 10);
  const SlamStatistics s = slam.statistics();
  CHECK(s.frames == 10);
  CHECK(s.lost_frames == 0);
  CHECK(s.keyframes >= 2);
  CHECK(s.geometry_iterations >= s.keyframes);
  CHECK(slam.keyframes().back().frame_index == 9);
  REQUIRE(slam.trajectory().size() == 10);
  for (int i = 0; i < 10; ++i)
    CHECK((slam.trajectory()[i].T_world_camera.translation() - f.room.ground_truth(i).translation()).norm() < 0.02);
  CHECK(test::all_finite(slam));
}

TEST_CASE("the observer stops an endless camera") {
  Fixture f;
  f.source.forever = true;
  LangGsSlam<kDim> slam(f.room.camera(), f.settings);
  int calls = 0;
  slam.run_realtime(f.source, f.features, [&](const FrameReport&) { return ++calls < 7; });
  CHECK(calls == 7);
  CHECK(slam.statistics().frames == 7);
  CHECK(slam.map().size() > 0);
}

TEST_CASE("an empty source and one of unusable frames end at once") {
  Fixture f;
  SUBCASE("no frame") { f.source.frames.clear(); }
  SUBCASE("no depth in any") {
    for (RgbdFrame& frame : f.source.frames) frame.depth = Image<float>(80, 60);
  }
  LangGsSlam<kDim> slam(f.room.camera(), f.settings);
  slam.run_realtime(f.source, f.features, [](const FrameReport& report) { return report.skipped; });
  CHECK(slam.map().size() == 0);
  CHECK(slam.statistics().frames == static_cast<int>(f.source.frames.size()));
  CHECK(seconds_since(f.start) < 5);
}

TEST_CASE("what is thrown in either thread reaches the caller, and nothing hangs") {
  Fixture f;
  LangGsSlam<kDim> slam(f.room.camera(), f.settings);
  const auto go_on = [](const FrameReport&) { return true; };
  SUBCASE("the source, at once") {
    f.source.fails_at = 0;
    CHECK(what_of([&] { slam.run_realtime(f.source, f.features, go_on); }) == "the camera was unplugged");
  }
  SUBCASE("the source, later") {
    f.source.fails_at = 5;
    CHECK(what_of([&] { slam.run_realtime(f.source, f.features, go_on); }) == "the camera was unplugged");
    CHECK(slam.keyframes().size() >= 1);
  }
  SUBCASE("the features of the first keyframe") {
    f.source.forever = true;
    FailingFeatures features;
    CHECK(what_of([&] { slam.run_realtime(f.source, features, go_on); }) == "encoder died");
  }
  SUBCASE("the features of a mapping keyframe that nobody waits for, before an endless camera") {
    f.source.forever = true;
    FailingFeatures features{1};
    KeyframeSettings settings;
    settings.overlap_threshold = 0;
    settings.mapping_interval = 2;
    slam.keyframe_policy = KeyframePolicy(settings);
    CHECK(what_of([&] { slam.run_realtime(f.source, features, go_on); }) == "encoder died");
  }
  SUBCASE("the observer") {
    CHECK(what_of([&] {
            slam.run_realtime(f.source, f.features,
                              [](const FrameReport&) -> bool { throw std::runtime_error("window closed"); });
          }) == "window closed");
  }
  SUBCASE("a frame of the wrong shape") {
    f.source.frames[3].depth = Image<float>(3, 3);
    CHECK_THROWS_AS(slam.run_realtime(f.source, f.features, go_on), InvalidArgument);
  }
  CHECK(seconds_since(f.start) < 20);
  CHECK(test::all_finite(slam));
}

TEST_CASE("playback keeps to its rate") {
  Fixture f;
  LangGsSlam<kDim> slam(f.room.camera(), f.settings);
  slam.run_realtime(
      f.source, f.features, [](const FrameReport&) { return true; }, 20);
  CHECK(seconds_since(f.start) > 9 / 20.0);
}

TEST_CASE("a real-time run can be followed by lockstep frames") {
  Fixture f;
  const std::vector<RgbdFrame> all = f.source.frames;
  f.source.frames.resize(6);
  LangGsSlam<kDim> slam(f.room.camera(), f.settings);
  slam.run_realtime(f.source, f.features, [](const FrameReport&) { return true; });
  for (int i = 6; i < 10; ++i) CHECK(has_pose(slam.process(all[i], f.features).status));
  CHECK(slam.statistics().frames == 10);
  CHECK((slam.trajectory()[9].T_world_camera.translation() - f.room.ground_truth(9).translation()).norm() < 0.02);
}
