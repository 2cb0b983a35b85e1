// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <limits>
#include <stdexcept>
#include <vector>

#include "langgs/eval/trajectory.hpp"
#include "slam/small_run.hpp"

using namespace langgs;
using test::kDim;

namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
const double kNan = std::numeric_limits<double>::quiet_NaN();

/// Frame i of a small room, changed by the caller; mapped with few iterations.
struct Hostile {
  SyntheticRoom room = test::small_room(6);
  std::vector<RgbdFrame> frames = test::frames_of(room);
  SlamSettings settings = test::small_settings();

  void fill_depth(std::size_t i, float value) {
    frames[i].depth = Image<float>(room.camera().width, room.camera().height, 1, value);
  }
  [[nodiscard]] LangGsSlam<kDim> slam() const { return LangGsSlam<kDim>(room.camera(), settings); }
};

/// A FeatureSource that always gives the same map.
struct ConstantFeatures {
  FeatureMap<kDim> map;
  FeatureMap<kDim> operator()(const RgbdFrame&) const { return map; }
};

}  // namespace

TEST_CASE("a frame without usable depth is skipped, counted and explained, and the run goes on") {
  Hostile hostile;
  SUBCASE("no depth") { hostile.fill_depth(2, 0); }
  SUBCASE("NaN") { hostile.fill_depth(2, std::nanf("")); }
  SUBCASE("infinite") { hostile.fill_depth(2, kInfinity); }
  SUBCASE("negative") { hostile.fill_depth(2, -1); }
  SUBCASE("farther than any sensor sees") { hostile.fill_depth(2, 6553.5f); }
  SUBCASE("largest float") { hostile.fill_depth(2, std::numeric_limits<float>::max()); }
  SUBCASE("smallest float") { hostile.fill_depth(2, std::numeric_limits<float>::denorm_min()); }
  LangGsSlam<kDim> slam = hostile.slam();
  ConstantFeatures features;
  const std::vector<FrameReport> reports = test::run(slam, hostile.frames, features);
  // A plane of nearly no depth is well formed: tracking has to notice that it fits nothing.
  const bool unplaced = reports[2].skipped || !has_pose(reports[2].status);
  CHECK(unplaced);
  CHECK_FALSE(reports[2].reason.empty());
  CHECK(reports[2].keyframe == KeyframeKind::none);
  CHECK(slam.statistics().skipped_frames + slam.statistics().lost_frames == 1);
  CHECK(has_pose(reports[5].status));
  CHECK((reports[5].T_world_camera.translation() - hostile.room.ground_truth(5).translation()).norm() < 0.02);
  CHECK(slam.trajectory().size() == 6);
  CHECK(test::all_finite(slam));
}

TEST_CASE("a depth image with bad values in part is used for its rest") {
  Hostile hostile;
  for (std::size_t i = 0; i < hostile.frames.size(); ++i)
    for (int y = 0; y < 60; ++y)
      for (int x = 0; x < 80; ++x) {
        const float bad[] = {0, std::nanf(""), kInfinity, -kInfinity, -2, 65.535f, 1e30f, 9999};
        if ((x + y) % 5 == 0) hostile.frames[i].depth(x, y) = bad[(x * 7 + y) % 8];
      }
  LangGsSlam<kDim> slam = hostile.slam();
  ConstantFeatures features;
  const std::vector<FrameReport> reports = test::run(slam, hostile.frames, features);
  CHECK(slam.statistics().skipped_frames == 0);
  CHECK(slam.statistics().lost_frames == 0);
  CHECK(std::isfinite(reports.back().loss));
  CHECK((reports[5].T_world_camera.translation() - hostile.room.ground_truth(5).translation()).norm() < 0.02);
  CHECK(test::all_finite(slam));
}

TEST_CASE("images of the wrong shape are refused and change nothing") {
  Hostile hostile;
  LangGsSlam<kDim> slam = hostile.slam();
  ConstantFeatures features;
  slam.process(hostile.frames[0], features);
  const int gaussians = slam.map().size();
  RgbdFrame bad = hostile.frames[1];
  SUBCASE("depth of another size") { bad.depth = Image<float>(40, 30); }
  SUBCASE("depth of two channels") { bad.depth = Image<float>(80, 60, 2, 1.f); }
  SUBCASE("colour of another size") { bad.colour = Image<std::uint8_t>(60, 80, 3); }
  SUBCASE("grey image") { bad.colour = Image<std::uint8_t>(80, 60, 1); }
  SUBCASE("empty frame") { bad = RgbdFrame{}; }
  CHECK_THROWS_AS(slam.process(bad, features), InvalidArgument);
  CHECK(slam.map().size() == gaussians);
  CHECK(slam.statistics().frames == 1);
  CHECK(slam.process(hostile.frames[1], features).frame_index == 1);
  CHECK(test::all_finite(slam));
}

TEST_CASE("time that is not finite or runs backwards skips the frame; the trajectory stays usable") {
  Hostile hostile;
  SUBCASE("NaN") { hostile.frames[2].timestamp = kNan; }
  SUBCASE("infinite") { hostile.frames[2].timestamp = std::numeric_limits<double>::infinity(); }
  SUBCASE("backwards") { hostile.frames[2].timestamp = -7; }
  SUBCASE("NaN between depth and colour") { hostile.frames[2].depth_time_offset = kNan; }
  SUBCASE("infinite between depth and colour") { hostile.frames[2].depth_time_offset = -kInfinity; }
  LangGsSlam<kDim> slam = hostile.slam();
  ConstantFeatures features;
  const std::vector<FrameReport> reports = test::run(slam, hostile.frames, features);
  CHECK(reports[2].skipped);
  CHECK(reports[2].reason.find("time stamp") != std::string::npos);
  CHECK_FALSE(reports[3].skipped);
  CHECK(slam.statistics().skipped_frames == 1);
  CHECK(slam.statistics().frames == 6);
  CHECK(test::all_finite(slam));
  CHECK(ate_umeyama_se3(slam.trajectory(), slam.trajectory()).rmse_m < 1e-9);
}

TEST_CASE("depth taken absurdly long before or after colour harms one frame at most") {
  Hostile hostile;
  SUBCASE("after") { hostile.frames[2].depth_time_offset = 1e9; }
  SUBCASE("before") { hostile.frames[2].depth_time_offset = -1e9; }
  SUBCASE("beyond all numbers") { hostile.frames[2].depth_time_offset = 1e300; }
  SUBCASE("at the first frame") { hostile.frames[0].depth_time_offset = -1e300; }
  LangGsSlam<kDim> slam = hostile.slam();
  slam.keyframe_policy = test::often();
  ConstantFeatures features;
  const std::vector<FrameReport> reports = test::run(slam, hostile.frames, features);
  CHECK(slam.statistics().skipped_frames + slam.statistics().lost_frames <= 1);
  CHECK((reports[5].T_world_camera.translation() - hostile.room.ground_truth(5).translation()).norm() < 0.02);
  CHECK(test::all_finite(slam));
}

TEST_CASE("equal time stamps are accepted") {
  Hostile hostile;
  for (RgbdFrame& frame : hostile.frames) frame.timestamp = 3;
  LangGsSlam<kDim> slam = hostile.slam();
  ConstantFeatures features;
  test::run(slam, hostile.frames, features);
  CHECK(slam.statistics().skipped_frames == 0);
}

TEST_CASE("the first usable frame begins the map at identity") {
  Hostile hostile;
  hostile.fill_depth(0, 0);
  hostile.fill_depth(1, kInfinity);
  LangGsSlam<kDim> slam = hostile.slam();
  ConstantFeatures features;
  const std::vector<FrameReport> reports = test::run(slam, hostile.frames, features);
  CHECK(reports[0].skipped);
  CHECK(reports[1].skipped);
  CHECK(reports[1].num_gaussians == 0);
  CHECK(reports[2].keyframe == KeyframeKind::tracking);
  for (int i = 0; i < 3; ++i) CHECK(reports[i].T_world_camera.matrix() == Pose::Identity().matrix());
  CHECK(slam.keyframes().front().frame_index == 2);
  CHECK(test::all_finite(slam));
}

TEST_CASE("a run of nothing but unusable frames ends with an empty map that can be looked at") {
  Hostile hostile;
  hostile.settings.final_iterations = 5;
  for (std::size_t i = 0; i < hostile.frames.size(); ++i) hostile.fill_depth(i, 0);
  LangGsSlam<kDim> slam = hostile.slam();
  ConstantFeatures features;
  test::run(slam, hostile.frames, features);
  CHECK(slam.map().size() == 0);
  CHECK(slam.statistics().skipped_frames == 6);
  CHECK(slam.statistics().geometry_iterations == 0);
  CHECK(slam.trajectory().size() == 6);
  const RenderedImages images = slam.render(hostile.room.camera(), Pose::Identity());
  for (std::size_t i = 0; i < images.colour.size(); ++i) REQUIRE(images.colour.data()[i] == 0.f);
  for (std::size_t i = 0; i < images.depth.size(); ++i) REQUIRE(images.transmittance.data()[i] == 1.f);
  for (const float f : slam.feature_image(hostile.room.camera(), Pose::Identity(), 9, 7)) REQUIRE(f == 0.f);
  const auto labels = slam.label_image(hostile.room.camera(), Pose::Identity(), SyntheticRoom::class_vectors<kDim>());
  for (std::size_t i = 0; i < labels.size(); ++i) REQUIRE(labels.data()[i] == 0);
}

TEST_CASE("black and white images map like others") {
  Hostile hostile;
  for (std::size_t i = 0; i < hostile.frames.size(); ++i)
    hostile.frames[i].colour = Image<std::uint8_t>(80, 60, 3, i < 3 ? std::uint8_t{0} : std::uint8_t{255});
  LangGsSlam<kDim> slam = hostile.slam();
  ConstantFeatures features;
  test::run(slam, hostile.frames, features);
  CHECK(slam.statistics().lost_frames == 0);
  CHECK(test::all_finite(slam));
}

TEST_CASE("given mode skips frames whose pose is missing or not finite") {
  Hostile hostile;
  hostile.settings.tracking.poses = PoseSource::given;
  hostile.frames[0].T_world_camera.reset();
  hostile.frames[2].T_world_camera.reset();
  hostile.frames[3].T_world_camera->translation().x() = kNan;
  hostile.frames[4].T_world_camera->linear()(1, 1) = std::numeric_limits<double>::infinity();
  LangGsSlam<kDim> slam = hostile.slam();
  ConstantFeatures features;
  const std::vector<FrameReport> reports = test::run(slam, hostile.frames, features);
  for (int i = 0; i < 6; ++i) CHECK(reports[i].skipped == (i != 1 && i != 5));
  CHECK(slam.statistics().skipped_frames == 4);
  CHECK(slam.keyframes().front().frame_index == 1);
  CHECK(test::all_finite(slam));
}

TEST_CASE("a given pose far beyond any room yields no NaN") {
  Hostile hostile;
  hostile.settings.tracking.poses = PoseSource::given;
  for (std::size_t i = 0; i < hostile.frames.size(); ++i)
    hostile.frames[i].T_world_camera->translation() *= i % 2 ? 1e300 : 1e12;
  LangGsSlam<kDim> slam = hostile.slam();
  ConstantFeatures features;
  test::run(slam, hostile.frames, features);
  CHECK(slam.statistics().frames == 6);
  CHECK(test::all_finite(slam));
}

TEST_CASE("a camera that jumps elsewhere is lost, counted, and found again where the map is") {
  Hostile hostile;
  hostile.frames[3].depth = Image<float>(80, 60, 1, 0.3f);  // a hand before the lens
  LangGsSlam<kDim> slam = hostile.slam();
  ConstantFeatures features;
  const std::vector<FrameReport> reports = test::run(slam, hostile.frames, features);
  CHECK(slam.statistics().lost_frames == 1);
  CHECK_FALSE(reports[3].reason.empty());
  CHECK(reports[3].keyframe == KeyframeKind::none);
  CHECK((reports[5].T_world_camera.translation() - hostile.room.ground_truth(5).translation()).norm() < 0.02);
}

TEST_CASE("feature maps of any size are learnt from") {
  Hostile hostile;
  ConstantFeatures features;
  std::vector<float> vector(kDim, 0.f);
  vector[3] = 2;
  bool taught = true;
  SUBCASE("one pixel") { features.map = FeatureMap<kDim>(1, 1); }
  SUBCASE("larger than the image") { features.map = FeatureMap<kDim>(161, 127); }
  SUBCASE("a row") { features.map = FeatureMap<kDim>(37, 1); }
  SUBCASE("all zeros") {
    features.map = FeatureMap<kDim>(20, 15);
    taught = false;
  }
  SUBCASE("none") { taught = false; }
  for (int y = 0; y < features.map.height() && taught; ++y)
    for (int x = 0; x < features.map.width(); ++x) features.map.set_pixel(x, y, vector.data());
  LangGsSlam<kDim> slam = hostile.slam();
  test::run(slam, hostile.frames, features);
  CHECK(slam.statistics().skipped_frames == 0);
  CHECK((slam.statistics().feature_iterations > 0) == !features.map.empty());
  CHECK(test::all_finite(slam));
  for (int i = 0; i < slam.map().size(); ++i)
    REQUIRE((static_cast<float>(slam.map().features().row(i)[3]) > 0.5f) == taught);
}

TEST_CASE("an exception of the feature source leaves a run that can go on") {
  Hostile hostile;
  struct FailsOnce {
    int fails_at, calls = 0;
    FeatureMap<kDim> operator()(const RgbdFrame&) {
      if (calls++ == fails_at) throw std::runtime_error("encoder died");
      return {};
    }
  };
  FailsOnce features{0};
  SUBCASE("at the first keyframe") { features.fails_at = 0; }
  SUBCASE("at a later one") { features.fails_at = 1; }
  LangGsSlam<kDim> slam = hostile.slam();
  slam.keyframe_policy = test::often();
  int thrown = 0;
  for (const RgbdFrame& frame : hostile.frames) try {
      slam.process(frame, features);
    } catch (const std::runtime_error&) {
      ++thrown;
    }
  CHECK(thrown == 1);
  REQUIRE(slam.trajectory().size() == 6);
  const int first = slam.keyframes().front().frame_index;
  const Pose T_first_world = hostile.room.ground_truth(first).inverse();
  for (int i = first; i < 6; ++i)
    CHECK((slam.trajectory()[i].T_world_camera.translation() -
           (T_first_world * hostile.room.ground_truth(i)).translation())
              .norm() < 0.02);
  CHECK(test::all_finite(slam));
}

TEST_CASE("settings that cannot work are refused with the reason") {
  const Hostile hostile;
  const auto refused = [&](auto&& change) {
    SlamSettings settings = hostile.settings;
    change(settings);
    CHECK_THROWS_AS(LangGsSlam<kDim>(hostile.room.camera(), settings), InvalidArgument);
  };
  refused([](SlamSettings& s) { s.num_threads = 0; });
  refused([](SlamSettings& s) { s.iterations_per_frame = -1; });
  refused([](SlamSettings& s) { s.final_iterations = -1; });
  refused([](SlamSettings& s) { s.tracking.min_target_opacity = 1; });
  refused([](SlamSettings& s) { s.tracking.source.stride = 0; });
  refused([](SlamSettings& s) { s.tracking.gicp.max_iterations = 0; });
  refused([](SlamSettings& s) { s.mapping.redundancy.squared_distance = -1; });
  refused([](SlamSettings& s) { s.mapping.initialization.opacity = 0; });
  refused([](SlamSettings& s) { s.mapping.initialization.opacity = 1; });
  refused([](SlamSettings& s) { s.mapping.initialization.spread = 0; });
  refused([](SlamSettings& s) { s.mapping.initialization.thickness = std::nanf(""); });
  refused([](SlamSettings& s) { s.mapping.learning_rates.mean = -1; });
  refused([](SlamSettings& s) { s.mapping.learning_rates.beta2 = 1; });
  CHECK_THROWS_AS(LangGsSlam<kDim>(Camera{}, hostile.settings), InvalidArgument);
}
