// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "langgs/track/gicp_tracker.hpp"
#include "track/gicp_cases.hpp"
#include "track/textured_wall.hpp"

/// @file Colour where geometry leaves the pose open; grey images against naive averages.

using namespace langgs;

namespace {

/// A wall with texture, mapped from identity.
struct Wall {
  WorkerPool pool{1};
  Camera camera{260, 260, 159.5f, 119.5f, 320, 240};
  SourceCloudSettings settings{.stride = 3};
  GridTarget target;

  explicit Wall(bool textured) {
    target = test::target_of(cloud(Pose::Identity(), textured), camera, Pose::Identity());
    // Frames on another grid than the map's: on the same, each point's nearest Gaussian pulls the wall the same way.
    settings.stride = 4;
  }

  [[nodiscard]] SourceCloud cloud(const Pose& T_world_camera, bool textured, double brightening = 0) {
    RgbdFrame frame = test::render_wall(camera, T_world_camera);
    test::paint(frame, camera, T_world_camera, brightening);
    if (!textured) std::fill_n(frame.colour.data(), frame.colour.size(), std::uint8_t{120});
    return make_source_cloud(frame, camera, settings, pool);
  }
};

/// Along the wall and about its normal; a point of the wall in the middle of the image.
Eigen::Vector3d error_along(const Pose& T, const Pose& truth) {
  const Eigen::Vector3d middle(0, 0, 2);
  Eigen::Vector3d error = T * middle - truth * middle;
  error.z() = so3_log(truth.linear().transpose() * T.linear()).z();
  return error;
}

Pose sideways(double x, double y, double roll = 0) {
  Pose T = Pose::Identity();
  T.translation() = Eigen::Vector3d(x, y, 0);
  T.linear() = so3_exp({0, 0, roll});
  return T;
}

}  // namespace

TEST_CASE("a textured wall seen frontally fixes the pose along itself") {
  Wall wall(true);
  const GicpTracker tracker;
  const Pose truths[] = {sideways(0.02, 0),       sideways(-0.01, 0.015), sideways(0, -0.02),
                         sideways(0.01, 0, 0.01), sideways(0, 0, -0.02),  sideways(0.014, 0.014, 0.005)};
  for (const Pose& truth : truths) {
    const SourceCloud source = wall.cloud(truth, true);
    const GicpResult result = tracker.align(source, wall.target, Pose::Identity(), wall.pool);
    CHECK(result.status == GicpStatus::converged);
    const Eigen::Vector3d error = error_along(result.T_world_camera, truth);
    CHECK(error.head<2>().norm() < 2e-3);
    CHECK(std::abs(error.z()) < 2e-3);
    CHECK((result.T_world_camera.translation() - truth.translation()).norm() < 4e-3);
    test::check_sane(result, source, Pose::Identity(), tracker.settings());
  }
}

TEST_CASE("without texture, without its weight, or without colour the wall stays open") {
  Wall grey(false), textured(true);
  const Pose guess = sideways(0.02, -0.01, 0.01);
  GicpSettings geometry;
  geometry.photometric_weight = 0;
  SourceCloud colourless = textured.cloud(Pose::Identity(), true);
  colourless.intensity = {};
  const GicpResult results[] = {
      GicpTracker().align(grey.cloud(Pose::Identity(), false), grey.target, guess, grey.pool),
      GicpTracker(geometry).align(textured.cloud(Pose::Identity(), true), textured.target, guess, textured.pool),
      GicpTracker().align(colourless, textured.target, guess, textured.pool)};
  for (const GicpResult& result : results) {
    CHECK(result.status == GicpStatus::degenerate);
    const Eigen::Vector3d error = error_along(result.T_world_camera, guess);
    CHECK(error.head<2>().norm() < 2e-3);
    CHECK(std::abs(error.z()) < 1e-3);
  }
}

TEST_CASE("a change of exposure does not move the pose") {
  Wall wall(true);
  const GicpTracker tracker;
  for (const Pose& truth : {sideways(0.015, -0.01, 0.005), sideways(-0.02, 0, 0)}) {
    const GicpResult usual = tracker.align(wall.cloud(truth, true), wall.target, Pose::Identity(), wall.pool);
    for (const double brightening : {20., -20.}) {
      const GicpResult other =
          tracker.align(wall.cloud(truth, true, brightening), wall.target, Pose::Identity(), wall.pool);
      CHECK(other.status == GicpStatus::converged);
      CHECK(error_along(other.T_world_camera, usual.T_world_camera).norm() < 5e-4);
      CHECK(error_along(other.T_world_camera, truth).head<2>().norm() < 2e-3);
    }
  }
}

TEST_CASE("colour taken from elsewhere than depth is looked up where it was taken") {
  Wall wall(true);
  // Depth from the truth; colour from 1 cm aside of it.
  const Pose truth = sideways(0.012, -0.008), T_colour_depth = sideways(-0.01, 0.004, 0.003);
  const Pose T_world_colour = truth * T_colour_depth.inverse();
  RgbdFrame frame = test::render_wall(wall.camera, T_world_colour);
  test::paint(frame, wall.camera, T_world_colour);
  frame.depth = test::render_wall(wall.camera, truth).depth;
  SourceCloud source = make_source_cloud(frame, wall.camera, wall.settings, wall.pool);
  const GicpResult ignorant = GicpTracker().align(source, wall.target, Pose::Identity(), wall.pool);
  source.T_colour_depth = T_colour_depth;
  const GicpResult result = GicpTracker().align(source, wall.target, Pose::Identity(), wall.pool);
  CHECK(result.status == GicpStatus::converged);
  CHECK(error_along(result.T_world_camera, truth).head<2>().norm() < 2e-3);
  CHECK(error_along(ignorant.T_world_camera, truth).head<2>().norm() > 6e-3);
}

TEST_CASE("grey images are averages over squares, seen by a smaller camera") {
  WorkerPool one(1), two(2);
  const CounterRng rng{3};
  for (const int size : {1, 2, 3, 4, 7}) {
    const Camera camera{130, 120, 20.25f, 15.5f, 43, 31};
    Image<std::uint8_t> colour(43, 31, 3);
    for (std::size_t i = 0; i < colour.size(); ++i) colour.data()[i] = static_cast<std::uint8_t>(rng.below(i, 256));
    const IntensityImage image = make_intensity_image(colour, camera, size, one);
    REQUIRE(image.camera.width == 43 / size);
    REQUIRE(image.camera.height == 31 / size);
    REQUIRE(image.values.size() == static_cast<std::size_t>(image.camera.num_pixels()));
    CHECK(make_intensity_image(colour, camera, size, two).values == image.values);
    for (int y = 0; y < image.camera.height; ++y)
      for (int x = 0; x < image.camera.width; ++x) {
        double grey = 0;
        for (int j = 0; j < size; ++j)
          for (int i = 0; i < size; ++i)
            grey += 0.299 * colour(x * size + i, y * size + j, 0) + 0.587 * colour(x * size + i, y * size + j, 1) +
                    0.114 * colour(x * size + i, y * size + j, 2);
        grey /= 255.0 * size * size;
        CHECK(std::abs(image.values[y * image.camera.width + x] - grey) < 1e-6);
        // The smaller camera sees the middle of the square at the square's place.
        const Eigen::Vector2d middle(x * size + 0.5 * (size - 1), y * size + 0.5 * (size - 1));
        const Eigen::Vector2d seen = image.camera.project(camera.back_project(middle.x(), middle.y(), 1));
        CHECK((seen - Eigen::Vector2d(x, y)).norm() < 1e-4);
        if (x + 1 < image.camera.width && y + 1 < image.camera.height)
          CHECK(std::abs(image.sample(camera, static_cast<float>(middle.x()) + 1e-4f,
                                      static_cast<float>(middle.y()) + 1e-4f) -
                         grey) < 1e-3);
      }
  }
}

TEST_CASE("grey values between pixels are bilinear, outside unknown") {
  WorkerPool pool(1);
  const Camera camera{100, 100, 19.5f, 11.5f, 40, 24};
  Image<std::uint8_t> colour(40, 24, 3);
  for (int v = 0; v < 24; ++v)
    for (int u = 0; u < 40; ++u)
      for (int c = 0; c < 3; ++c) colour(u, v, c) = static_cast<std::uint8_t>(3 * u + 4 * v);  // a plane stays one
  const IntensityImage image = make_intensity_image(colour, camera, 4, pool);
  int inside = 0;
  for (float v = -1; v < 24; v += 0.37f)
    for (float u = -1; u < 40; u += 0.41f) {
      const bool known = u >= 1.501f && v >= 1.501f && u < 37.499f && v < 21.499f;  // between the middles of squares
      const bool unknown = u < 1.499f || v < 1.499f || u > 37.501f || v > 21.501f;
      const float value = image.sample(camera, u, v);
      if (known) {
        ++inside;
        CHECK(std::abs(255 * value - (3 * u + 4 * v)) < 1e-3f);
      }
      if (unknown) CHECK(value == -1);
    }
  CHECK(inside > 3000);
  const float nan = std::nanf("");
  CHECK(image.sample(camera, nan, 10) == -1);
  CHECK(image.sample(camera, 10, 1e30f) == -1);
  CHECK(IntensityImage{}.sample(camera, 10, 10) == -1);
  // Too small for a gradient, or no colour at all.
  CHECK(make_intensity_image(Image<std::uint8_t>(7, 24, 3), camera, 4, pool).empty());
  CHECK(make_intensity_image(Image<std::uint8_t>(), camera, 4, pool).empty());
}
