// SPDX-License-Identifier: Apache-2.0
#include "langgs/track/source_cloud.hpp"

#include <doctest/doctest.h>

#include <cstring>
#include <limits>

#include "track/box_room.hpp"

using namespace langgs;

namespace {

/// Depth of the plane normal . x = offset seen by the camera.
RgbdFrame render_plane(const Camera& camera, const Eigen::Vector3d& normal, double offset) {
  RgbdFrame frame;
  frame.depth = Image<float>(camera.width, camera.height);
  for (int v = 0; v < camera.height; ++v)
    for (int u = 0; u < camera.width; ++u)
      frame.depth(u, v) = static_cast<float>(offset / normal.dot(camera.back_project(u, v, 1)));
  return frame;
}

Eigen::Matrix3d axes_of(const SourceCloud& cloud, int i) {
  const Eigen::Vector4f q = cloud.rotations[i];
  return Eigen::Quaternionf(q[0], q[1], q[2], q[3]).toRotationMatrix().cast<double>();
}

bool same_bits(const SourceCloud& a, const SourceCloud& b) {
  const auto equal = [](const auto& x, const auto& y) {
    return x.size() == y.size() && (x.empty() || std::memcmp(x.data(), y.data(), x.size() * sizeof(x[0])) == 0);
  };
  return equal(a.points, b.points) && equal(a.pixels, b.pixels) && equal(a.rotations, b.rotations) &&
         equal(a.scales, b.scales) && equal(a.covariances, b.covariances) && equal(a.trackable, b.trackable) &&
         equal(a.weights, b.weights);
}

}  // namespace

TEST_CASE("principal axes rebuild the covariance and are a proper rotation") {
  for (std::uint64_t seed = 0; seed < 2000; ++seed) {
    const CounterRng rng{seed};
    Eigen::Matrix3d samples;  // a flat random patch: in-plane centimetres, thickness from 10 um to 1 cm
    const Eigen::Matrix3d rotation = test::random_motion(seed, 0, 3.1).linear();
    const Eigen::Vector3d sigma(0.03, 0.01 + 0.02 * rng.uniform(1), std::pow(10.0, -5 + 3 * rng.uniform(2)));
    samples = rotation * sigma.cwiseAbs2().asDiagonal() * rotation.transpose();
    const detail::LocalShape shape = detail::principal_shape(samples);
    CHECK(shape.axes.determinant() == doctest::Approx(1).epsilon(1e-9));
    CHECK((shape.axes.transpose() * shape.axes - Eigen::Matrix3d::Identity()).norm() < 1e-9);
    CHECK((shape.axes * shape.variances.asDiagonal() * shape.axes.transpose() - samples).norm() <
          1e-6 * samples.norm());
    CHECK(shape.variances[0] >= shape.variances[1]);
    CHECK(shape.variances[1] >= shape.variances[2]);
    // Through the quaternion and back: a reflection would not survive this.
    const Eigen::Quaterniond q(shape.axes);
    CHECK((q.toRotationMatrix() - shape.axes).norm() < 1e-9);
  }
}

TEST_CASE("principal axes of shapeless covariances are still a rotation") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const Eigen::Vector3d line = Eigen::Vector3d(1, 2, -3).normalized();
  const Eigen::Matrix3d cases[] = {Eigen::Matrix3d::Zero(),        Eigen::Matrix3d::Identity(),
                                   line * line.transpose(),        1e-300 * Eigen::Matrix3d::Identity(),
                                   Eigen::Matrix3d::Constant(nan), Eigen::Matrix3d::Constant(1e308)};
  for (const Eigen::Matrix3d& covariance : cases) {
    const detail::LocalShape shape = detail::principal_shape(covariance);
    CHECK(shape.variances.allFinite());
    CHECK(shape.variances.minCoeff() >= 0);
    CHECK((shape.axes.transpose() * shape.axes - Eigen::Matrix3d::Identity()).norm() < 1e-9);
    CHECK(shape.axes.determinant() == doctest::Approx(1));
  }
}

TEST_CASE("planes from any side: normals, scales and covariances") {
  const Camera camera = test::small_camera();
  WorkerPool pool(1);
  for (std::uint64_t seed = 0; seed < 40; ++seed) {
    const Eigen::Vector3d normal = so3_exp(test::random_motion(seed, 0.8, 0).translation()) * Eigen::Vector3d::UnitZ();
    const SourceCloudSettings settings;
    const SourceCloud cloud = make_source_cloud(render_plane(camera, normal, 1.5), camera, settings, pool);
    REQUIRE(cloud.size() > 100);
    for (int i = 0; i < cloud.size(); ++i) {
      // The point lies on the plane and at its pixel.
      CHECK(normal.dot(cloud.points[i].cast<double>()) == doctest::Approx(1.5).epsilon(1e-5));
      const Eigen::Vector2d pixel = camera.project(cloud.points[i].cast<double>());
      CHECK((pixel - cloud.pixels[i].cast<double>()).norm() < 1e-4);

      const Eigen::Vector3f scales = cloud.scales[i];
      CHECK(scales[0] >= scales[1]);
      CHECK(scales[1] >= scales[2]);
      CHECK(scales[2] >= kMinShapeScale);  // exactly flat, yet its logarithm is finite
      CHECK(scales[1] > 100 * scales[2]);
      CHECK(std::abs(axes_of(cloud, i).col(2).dot(normal)) > 1 - 1e-5);
      CHECK(cloud.rotations[i].norm() == doctest::Approx(1).epsilon(1e-5));
      const Eigen::Matrix3d expected =
          Eigen::Matrix3d::Identity() - (1 - settings.plane_thickness) * normal * normal.transpose();
      CHECK((cloud.covariances[i].cast<double>() - expected).norm() < 5e-3);
      CHECK(cloud.trackable[i] == (cloud.points[i].z() <= settings.depth_trunc ? 1 : 0));
    }
  }
}

TEST_CASE("surfaces on both sides of a depth edge do not mix") {
  const Camera camera = test::small_camera();
  RgbdFrame frame;
  frame.depth = Image<float>(camera.width, camera.height, 1, 1.0f);
  for (int v = 0; v < camera.height; ++v)
    for (int u = 80; u < camera.width; ++u) frame.depth(u, v) = 1.2f;
  WorkerPool pool(1);
  const SourceCloud cloud = make_source_cloud(frame, camera, {}, pool);
  int at_edge = 0;
  for (int i = 0; i < cloud.size(); ++i) {
    at_edge += std::abs(cloud.pixels[i].x() - 80) < 5;
    CHECK(std::abs(axes_of(cloud, i)(2, 2)) > 0.9999);
    CHECK(cloud.scales[i][2] < 1e-4f);
  }
  CHECK(at_edge > 10);
}

TEST_CASE("unusable depth is dropped, far depth is kept untracked") {
  const Camera camera = test::small_camera();
  RgbdFrame frame;
  frame.depth = Image<float>(camera.width, camera.height, 1, 2.0f);
  const float inf = std::numeric_limits<float>::infinity();
  const float bad[] = {0.0f, -1.0f, inf, -inf, std::numeric_limits<float>::quiet_NaN(), 65.535f, 1e30f, -0.0f};
  for (int v = 0; v < camera.height; ++v)
    for (int u = 0; u < camera.width; ++u) {
      if (u < 40) frame.depth(u, v) = bad[(u + 3 * v) % 8];
      if (u >= 120) frame.depth(u, v) = 6.0f;
    }
  WorkerPool pool(1);
  const SourceCloud cloud = make_source_cloud(frame, camera, {}, pool);
  CHECK(cloud.num_trackable() > 100);
  for (int i = 0; i < cloud.size(); ++i) {
    CHECK(cloud.pixels[i].x() >= 40);
    CHECK(cloud.points[i].allFinite());
    CHECK(cloud.covariances[i].allFinite());
    CHECK(cloud.scales[i].array().log().allFinite());
    if (cloud.pixels[i].x() >= 120) CHECK(cloud.trackable[i] == 0);
  }
}

TEST_CASE("isolated pixels and thin lines have a shape but are not tracked") {
  const Camera camera = test::small_camera();
  RgbdFrame frame;
  frame.depth = Image<float>(camera.width, camera.height);
  frame.depth(52, 52) = 1;                                            // alone
  for (int u = 0; u < camera.width; ++u) frame.depth(u, 102) = 1.5f;  // a line
  WorkerPool pool(1);
  const SourceCloud cloud = make_source_cloud(frame, camera, {}, pool);
  CHECK(cloud.size() == 1 + camera.width / 5);
  CHECK(cloud.num_trackable() == 0);
  for (int i = 0; i < cloud.size(); ++i) {
    CHECK(cloud.rotations[i].norm() == doctest::Approx(1));
    CHECK(cloud.scales[i].minCoeff() > 1e-3f);
  }
}

TEST_CASE("empty frames, any stride, same bits for any number of threads, clear errors") {
  const Camera camera = test::small_camera();
  WorkerPool one(1), two(2);
  RgbdFrame frame;
  frame.depth = Image<float>(camera.width, camera.height);
  CHECK(make_source_cloud(frame, camera, {}, one).size() == 0);

  frame = test::render_box_room(camera, Pose::Identity(), 0.002);
  for (const int stride : {1, 2, 3, 7, 1000}) {
    SourceCloudSettings settings;
    settings.stride = stride;
    const SourceCloud cloud = make_source_cloud(frame, camera, settings, one);
    CHECK(same_bits(cloud, make_source_cloud(frame, camera, settings, two)));
    if (stride < 8) CHECK(cloud.num_trackable() > 0.8 * (160 / stride) * (120 / stride) * 0.8);
  }
  frame.depth = Image<float>(camera.width, camera.height - 1);
  CHECK_THROWS_AS((void)make_source_cloud(frame, camera, {}, one), InvalidArgument);
  SourceCloudSettings settings;
  settings.stride = 0;
  CHECK_THROWS_AS((void)make_source_cloud(frame, camera, settings, one), InvalidArgument);
  CHECK_THROWS_AS((void)make_source_cloud(frame, Camera{}, {}, one), InvalidArgument);
}
