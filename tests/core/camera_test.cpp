// SPDX-License-Identifier: Apache-2.0
#include "langgs/core/camera.hpp"

#include <doctest/doctest.h>

#include <limits>

namespace {

using langgs::Camera;

// Replica and the three Kinects of the TUM data set.
constexpr Camera kCameras[] = {{600.f, 600.f, 599.5f, 339.5f, 1200, 680},
                               {517.3f, 516.5f, 318.6f, 255.3f, 640, 480},
                               {520.9f, 521.0f, 325.1f, 249.7f, 640, 480},
                               {535.4f, 539.2f, 320.1f, 247.6f, 640, 480}};

}  // namespace

TEST_CASE("back-project and project are inverse for every integer pixel") {
  for (const Camera& camera : kCameras) {
    double worst = 0;
    for (int v = 0; v < camera.height; ++v) {
      for (int u = 0; u < camera.width; ++u) {
        const double z = 0.1 + 0.01 * ((u * 31 + v * 17) % 1000);
        const Eigen::Vector3d point = camera.back_project(u, v, z);
        worst = std::max(worst, (camera.project(point) - Eigen::Vector2d(u, v)).norm());
        worst = std::max(worst, std::abs(point.z() - z));
      }
    }
    CHECK(worst < 1e-9);
  }
}

TEST_CASE("the axes are x right, y down, z forward") {
  const Camera camera = kCameras[1];
  CHECK(camera.project({0, 0, 1}).isApprox(Eigen::Vector2d(camera.cx, camera.cy)));
  CHECK(camera.project({0.1, 0, 1}).x() > camera.cx);
  CHECK(camera.project({0, 0.1, 1}).y() > camera.cy);
}

TEST_CASE("a resized camera sees the same ray at the corresponding place") {
  for (const Camera& camera : kCameras) {
    for (const auto& [width, height] : {std::pair{320, 240}, {1199, 7}, {1, 1}, {2400, 1360}}) {
      const Camera resized = camera.resized(width, height);
      CHECK(resized.width == width);
      CHECK(resized.height == height);
      const Eigen::Vector3d point(0.3, -0.2, 2.5);
      const Eigen::Vector2d original = camera.project(point), moved = resized.project(point);
      // Both images cover the same rectangle [-0.5, side - 0.5].
      CHECK((moved.x() + 0.5) / width == doctest::Approx((original.x() + 0.5) / camera.width).epsilon(1e-5));
      CHECK((moved.y() + 0.5) / height == doctest::Approx((original.y() + 0.5) / camera.height).epsilon(1e-5));
    }
    CHECK(camera.resized(camera.width, camera.height) == camera);
  }
}

TEST_CASE("validate accepts real cameras and names the value that is wrong") {
  for (const Camera& camera : kCameras) CHECK_NOTHROW(langgs::validate(camera));
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  const auto with = [](auto change) {
    Camera camera = kCameras[1];
    change(camera);
    return camera;
  };
  for (const float bad : {0.f, -1.f, nan, inf, -inf}) {
    CAPTURE(bad);
    CHECK_THROWS_AS(langgs::validate(with([&](Camera& c) { c.fx = bad; })), langgs::InvalidArgument);
    CHECK_THROWS_AS(langgs::validate(with([&](Camera& c) { c.fy = bad; })), langgs::InvalidArgument);
  }
  for (const float bad : {nan, inf, -inf}) {
    CHECK_THROWS_AS(langgs::validate(with([&](Camera& c) { c.cx = bad; })), langgs::InvalidArgument);
    CHECK_THROWS_AS(langgs::validate(with([&](Camera& c) { c.cy = bad; })), langgs::InvalidArgument);
  }
  for (const int bad : {0, -1, 16385, std::numeric_limits<int>::max(), std::numeric_limits<int>::min()}) {
    CHECK_THROWS_AS(langgs::validate(with([&](Camera& c) { c.width = bad; })), langgs::InvalidArgument);
    CHECK_THROWS_AS(langgs::validate(with([&](Camera& c) { c.height = bad; })), langgs::InvalidArgument);
  }
  CHECK_THROWS_WITH_AS(langgs::validate(with([](Camera& c) { c.width = -3; })), doctest::Contains("-3x480"),
                       langgs::InvalidArgument);
  CHECK_THROWS_AS(langgs::validate(Camera{}), langgs::InvalidArgument);
}
