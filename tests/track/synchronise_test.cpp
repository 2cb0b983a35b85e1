// SPDX-License-Identifier: Apache-2.0
#include "langgs/track/synchronise.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <limits>

#include "track/box_room.hpp"

/// @file Depth moved to the place of another camera.

using namespace langgs;

namespace {

Pose shifted(double x, double y, double z) {
  Pose T = Pose::Identity();
  T.translation() = Eigen::Vector3d(x, y, z);
  return T;
}

}  // namespace

TEST_CASE("without motion the depth image stays, but for readings that are none") {
  const Camera camera = test::small_camera();
  Image<float> depth = test::render_box_room(camera, test::random_motion(2, 0.3, 0.4)).depth;
  Image<float> expected = depth;
  const float infinity = std::numeric_limits<float>::infinity();
  const float bad[] = {0, -1, std::nanf(""), infinity, -infinity};
  for (int i = 0; i < 5; ++i) depth(10 + i, 20) = bad[i], expected(10 + i, 20) = 0;
  CHECK(depth_from_colour(depth, camera, Pose::Identity()) == expected);
}

TEST_CASE("a plane moves by as many pixels as its parallax, and comes nearer as the camera does") {
  const Camera camera = test::small_camera();
  Image<float> depth(camera.width, camera.height, 1, 2.f);
  // 130 px of focal length at 2 m: 11 cm are 7.15 px, 2 cm are 1.3 px.
  for (const auto& [metres, pixels] : {std::pair(0.11, 7), std::pair(0.02, 1), std::pair(-0.02, -1)}) {
    for (int v = 0; v < camera.height; ++v)
      for (int u = 0; u < camera.width; ++u) depth(u, v) = 2.f + (u == 50 ? 1e-3f : 0.f);  // a column to be found again
    const Image<float> moved = depth_from_colour(depth, camera, shifted(metres, 0, 0));
    for (int v = 0; v < camera.height; ++v)
      for (int u = 0; u < camera.width; ++u) {
        const int from = u - pixels;
        CHECK(moved(u, v) == (from < 0 || from >= camera.width ? 0.f : from == 50 ? 2.f + 1e-3f : 2.f));
      }
  }
  const Image<float> nearer = depth_from_colour(depth, camera, shifted(0, 0, -0.5));
  int seen = 0;
  for (std::size_t i = 0; i < nearer.size(); ++i)
    if (nearer.data()[i] != 0) {
      ++seen;
      CHECK(nearer.data()[i] == doctest::Approx(1.5f).epsilon(1e-3));
    }
  // The same readings spread over more pixels: (1.5 / 2)^2 of them stay in the image.
  CHECK(seen == doctest::Approx(0.5625 * camera.num_pixels()).epsilon(0.03));
}

TEST_CASE("any motion: every reading is where its point is seen, unless a nearer one covers it") {
  const Camera camera = test::small_camera();
  for (std::uint64_t seed = 0; seed < 5; ++seed) {
    const Image<float> depth = test::render_box_room(camera, test::random_motion(seed, 0.2, 0.3)).depth;
    const Pose T_colour_depth = test::random_motion(seed + 10, 0.05, 0.05);
    const Image<float> moved = depth_from_colour(depth, camera, T_colour_depth);
    constexpr float kNothing = std::numeric_limits<float>::infinity();
    Image<float> expected(camera.width, camera.height, 1, kNothing);
    for (int v = 0; v < camera.height; ++v)
      for (int u = 0; u < camera.width; ++u) {
        const Eigen::Vector3d p = T_colour_depth * camera.back_project(u, v, depth(u, v));
        const Eigen::Vector2d at = camera.project(p);
        const long x = std::lround(at.x()), y = std::lround(at.y());
        if (p.z() <= 0 || x < 0 || y < 0 || x >= camera.width || y >= camera.height) continue;
        float& there = expected(static_cast<int>(x), static_cast<int>(y));
        there = std::min(there, static_cast<float>(p.z()));
      }
    int different = 0;
    for (std::size_t i = 0; i < moved.size(); ++i) {
      const float e = expected.data()[i] == kNothing ? 0.f : expected.data()[i];
      different += !(std::abs(moved.data()[i] - e) < 1e-6f);
    }
    CHECK(different == 0);
  }
}

TEST_CASE("the nearer reading wins, in whichever order they come") {
  const Camera camera{100, 100, 50, 50, 101, 101};
  // Seen from 0.1 m aside: 10 px at 1 m, 5 px at 2 m.
  for (const int sign : {-1, 1}) {
    Image<float> depth(camera.width, camera.height);
    depth(50 - 10 * sign, 50) = 1;
    depth(50 - 5 * sign, 50) = 2;
    const Image<float> moved = depth_from_colour(depth, camera, shifted(0.1 * sign, 0, 0));
    CHECK(moved(50, 50) == 1);
    float sum = 0;
    for (std::size_t i = 0; i < moved.size(); ++i) sum += moved.data()[i];
    CHECK(sum == 1);
  }
}

TEST_CASE("what ends behind the camera is not seen") {
  const Camera camera = test::small_camera();
  const Image<float> depth(camera.width, camera.height, 1, 2.f);
  const Image<float> moved = depth_from_colour(depth, camera, shifted(0, 0, -2));
  for (std::size_t i = 0; i < moved.size(); ++i) REQUIRE(moved.data()[i] == 0);
}

TEST_CASE("a moved cloud lies where the colour camera sees it, shapes turned with it") {
  WorkerPool pool(1);
  const Camera camera = test::small_camera();
  const RgbdFrame frame = test::render_box_room(camera, test::random_motion(1, 0.2, 0.3));
  const SourceCloud before = make_source_cloud(frame, camera, {}, pool);
  const Pose T = test::random_motion(6, 0.05, 0.2);
  SourceCloud cloud = before;
  cloud.T_colour_depth = T;
  move_to_colour(cloud, camera, T);
  CHECK(cloud.T_colour_depth.matrix() == Pose::Identity().matrix());
  REQUIRE(cloud.size() == before.size());
  const Eigen::Matrix3f R = T.linear().cast<float>();
  int inside = 0;
  for (int i = 0; i < cloud.size(); ++i) {
    CHECK((cloud.points[i] - (T * before.points[i].cast<double>()).cast<float>()).norm() < 1e-6f);
    CHECK((cloud.covariances[i] - R * before.covariances[i] * R.transpose()).norm() < 1e-6f);
    const auto rotation = [](const Eigen::Vector4f& q) {
      return Eigen::Quaternionf(q[0], q[1], q[2], q[3]).toRotationMatrix();
    };
    CHECK((rotation(cloud.rotations[i]) - R * rotation(before.rotations[i])).norm() < 1e-5f);
    CHECK(cloud.rotations[i].norm() == doctest::Approx(1).epsilon(1e-5));
    CHECK(cloud.scales[i] == before.scales[i]);
    const Eigen::Vector2d at = camera.project(cloud.points[i].cast<double>());
    if (at.x() > -0.49 && at.y() > -0.49 && at.x() < camera.width - 0.51 && at.y() < camera.height - 0.51) {
      ++inside;
      CHECK((at - cloud.pixels[i].cast<double>()).cwiseAbs().maxCoeff() < 0.501);
    }
    CHECK(cloud.pixels[i].minCoeff() >= 0);
    CHECK((cloud.pixels[i].x() < camera.width && cloud.pixels[i].y() < camera.height));
  }
  CHECK(inside > cloud.size() / 2);
  CHECK(inside < cloud.size());
}
