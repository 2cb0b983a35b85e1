// SPDX-License-Identifier: Apache-2.0
#include "langgs/frame/undistort.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <limits>

using namespace langgs;

namespace {

const Camera kCamera{60, 58, 31.2f, 23.7f, 64, 48};
const Distortion kFr1{0.2624, -0.9531, -0.0054, 0.0026, 1.1633};

/// A smooth scene on the normalised image plane.
double scene(const Eigen::Vector2d& p) { return 128 + 60 * std::sin(11 * p.x() + 1) * std::cos(9 * p.y()); }

/// Normalised undistorted coordinates of a distorted point, by fixed-point iteration: the map's inverse.
Eigen::Vector2d undistorted(const Distortion& distortion, const Eigen::Vector2d& p) {
  Eigen::Vector2d guess = p;
  for (int i = 0; i < 200; ++i) guess -= 0.7 * (distortion.distort(guess) - p);
  return guess;
}

}  // namespace

TEST_CASE("The distortion formula at a point worked out by hand") {
  const Distortion d{0.1, 0.2, 0.01, -0.02, 0.3};
  // r2 = 0.25, radial = 1 + 0.025 + 0.0125 + 0.0046875
  const Eigen::Vector2d p = d.distort({0.3, 0.4});
  CHECK(p.x() == doctest::Approx(0.3 * 1.0421875 + 2 * 0.01 * 0.12 - 0.02 * (0.25 + 0.18)));
  CHECK(p.y() == doctest::Approx(0.4 * 1.0421875 + 0.01 * (0.25 + 0.32) - 2 * 0.02 * 0.12));
}

TEST_CASE("No distortion changes nothing") {
  Image<std::uint8_t> image(64, 48, 3);
  for (std::size_t i = 0; i < image.size(); ++i) image.data()[i] = static_cast<std::uint8_t>(i * 37);
  const UndistortMap map(kCamera, {});
  CHECK(map.smooth(image) == image);
  CHECK(map.nearest(image) == image);
  CHECK(Distortion{}.is_zero());
  CHECK_FALSE(kFr1.is_zero());
}

TEST_CASE("A distorted picture of a smooth scene comes back as the pinhole picture") {
  Image<std::uint8_t> seen(64, 48), expected(64, 48);
  Image<float> depth(64, 48);
  for (int v = 0; v < 48; ++v)
    for (int u = 0; u < 64; ++u) {
      const Eigen::Vector2d p = kCamera.back_project(u, v, 1).head<2>();
      seen(u, v) = static_cast<std::uint8_t>(scene(undistorted(kFr1, p)) + 0.5);
      depth(u, v) = seen(u, v);
      expected(u, v) = static_cast<std::uint8_t>(scene(p) + 0.5);
    }
  const UndistortMap map(kCamera, kFr1);
  const Image<std::uint8_t> smooth = map.smooth(seen);
  const Image<float> nearest = map.nearest(depth);
  int inside = 0, moved = 0;
  for (int v = 0; v < 48; ++v)
    for (int u = 0; u < 64; ++u) {
      if (smooth(u, v) == 0) continue;
      ++inside;
      CHECK(std::abs(smooth(u, v) - expected(u, v)) <= 4);
      CHECK(std::abs(nearest(u, v) - static_cast<float>(expected(u, v))) <= 14);
      moved += std::abs(seen(u, v) - expected(u, v)) > 6;
    }
  CHECK(inside > 64 * 48 * 8 / 10);
  CHECK(moved > 100);  // the distortion was not negligible
}

TEST_CASE("Outside the picture there is nothing, whatever the coefficients") {
  Image<std::uint8_t> image(64, 48, 1, 200);
  Image<std::uint16_t> labels(64, 48, 1, 7);
  const UndistortMap wide(kCamera, {5, 0, 0, 0, 0});
  CHECK(wide.smooth(image)(0, 0) == 0);
  CHECK(wide.nearest(labels)(0, 0) == 0);
  CHECK(wide.smooth(image)(31, 24) == 200);
  const UndistortMap absurd(kCamera, {1e300, -1e300, 1e300, 1e300, 1e308});
  CHECK_NOTHROW((void)absurd.smooth(image));
}

TEST_CASE("Wrong sizes and coefficients are refused") {
  const UndistortMap map(kCamera, kFr1);
  CHECK_THROWS_AS((void)map.smooth(Image<std::uint8_t>(63, 48, 3)), InvalidArgument);
  CHECK_THROWS_AS((void)map.nearest(Image<float>(64, 47)), InvalidArgument);
  CHECK_THROWS_AS(UndistortMap(kCamera, {std::nan(""), 0, 0, 0, 0}), InvalidArgument);
  CHECK_THROWS_AS(UndistortMap(kCamera, {0, 0, 0, 0, std::numeric_limits<double>::infinity()}), InvalidArgument);
  CHECK_THROWS_AS(UndistortMap(Camera{}, {}), InvalidArgument);
}
