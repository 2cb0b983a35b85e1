// SPDX-License-Identifier: Apache-2.0
#include "langgs/track/measured_surface.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <set>
#include <vector>

#include "track/box_room.hpp"

/// @file Gaussians as they were measured: which count, and what a target keeps of the former one.

using namespace langgs;
using test::isotropic_gaussians;

namespace {

std::vector<Eigen::Vector3f> row_of_points(int n) {
  std::vector<Eigen::Vector3f> points;
  for (int i = 0; i < n; ++i) points.emplace_back(static_cast<float>(i), 0.f, 0.f);  // a metre apart
  return points;
}

/// Which of the points of row_of_points the target has.
std::vector<int> present(const GridTarget& target, int n) {
  std::vector<int> result;
  for (int i = 0; i < n; ++i)
    if (target.nearest({static_cast<float>(i), 0, 0}, 1e-3f).gaussian != nullptr) result.push_back(i);
  return result;
}

const auto kAll = [](int) { return true; };

}  // namespace

TEST_CASE("measured points carry the shapes and grey values of their cloud into the world") {
  WorkerPool pool(1);
  const Camera camera = test::small_camera();
  RgbdFrame frame = test::render_box_room(camera, test::random_motion(1, 0.2, 0.3));
  frame.colour = Image<std::uint8_t>(camera.width, camera.height, 3);
  for (int v = 0; v < camera.height; ++v)
    for (int u = 0; u < camera.width; ++u)
      for (int c = 0; c < 3; ++c) frame.colour(u, v, c) = static_cast<std::uint8_t>(u + v / 2);
  SourceCloud cloud = make_source_cloud(frame, camera, {}, pool);
  cloud.trackable[4] = 0;
  const Pose T = test::random_motion(6, 1, 2);
  const Eigen::Matrix3f R = T.linear().cast<float>();
  const std::vector<std::int32_t> chosen = {0, 4, 9, cloud.size() / 2, cloud.size() - 1};
  for (const TargetShape shape : {TargetShape::anisotropic, TargetShape::isotropic}) {
    const std::vector<TargetGaussian> gaussians = measured(cloud, chosen, camera, T, shape);
    REQUIRE(gaussians.size() == chosen.size());
    for (std::size_t k = 0; k < chosen.size(); ++k) {
      const int i = chosen[k];
      CHECK((gaussians[k].mean - (T * cloud.points[i].cast<double>()).cast<float>()).norm() < 1e-6f);
      const bool surface = shape == TargetShape::anisotropic && cloud.trackable[i] != 0;
      const Eigen::Matrix3f covariance = surface ? Eigen::Matrix3f(R * cloud.covariances[i] * R.transpose())
                                                 : Eigen::Matrix3f(kIsotropicTarget * Eigen::Matrix3f::Identity());
      const Symmetric3 expected = symmetric3(covariance);
      for (int a = 0; a < 6; ++a) CHECK(gaussians[k].covariance[a] == doctest::Approx(expected[a]).epsilon(1e-5));
      const Eigen::Vector2i pixel = cloud.pixels[i];
      const bool at_border =
          pixel.x() < 2 || pixel.y() < 2 || pixel.x() >= camera.width - 2 || pixel.y() >= camera.height - 2;
      if (!at_border) CHECK(std::abs(gaussians[k].intensity * 255 - static_cast<float>(pixel.x() + pixel.y() / 2)) < 1);
    }
  }
  frame.colour = {};
  const SourceCloud grey = make_source_cloud(frame, camera, {}, pool);
  CHECK(measured(grey, {3}, camera, T, TargetShape::anisotropic)[0].intensity == -1);
}

TEST_CASE("pruning keeps the flagged ones in order") {
  MeasuredSurface surface;
  surface.append(isotropic_gaussians(row_of_points(6)));
  surface.prune({1, 0, 1, 1, 0, 7});
  REQUIRE(surface.size() == 4);
  const float expected[] = {0, 2, 3, 5};
  for (int i = 0; i < 4; ++i) CHECK(surface.mean(i).x() == expected[i]);
  CHECK_THROWS_AS(surface.prune({1, 1, 1}), InvalidArgument);
  CHECK(surface.size() == 4);
  surface.append(isotropic_gaussians({{9, 0, 0}}));
  CHECK(surface.mean(4).x() == 9);
  surface.prune(std::vector<std::int32_t>(5, 0));
  CHECK(surface.size() == 0);
  CHECK(surface.target([](int) { return Eigen::Vector3f(); }, kAll)->size() == 0);
}

TEST_CASE("a target has the opaque ones that have not strayed, where they were measured") {
  MeasuredSurface surface;
  surface.append(isotropic_gaussians(row_of_points(8)));
  const float nan = std::nanf("");
  const Eigen::Vector3f ways[8] = {{0, 0, 0},
                                   {0.049f, 0, 0},
                                   {0.051f, 0, 0},
                                   {0.03f, 0.03f, 0.03f},  // 5.2 cm
                                   {0.02f, -0.03f, 0.03f},
                                   {nan, 0, 0},
                                   {0, 1e30f, 0},
                                   {0, 0, 0}};
  const auto now = [&](int i) { return Eigen::Vector3f(surface.mean(i) + ways[i]); };
  CHECK(present(*surface.target(now, kAll), 8) == std::vector{0, 1, 4, 7});
  CHECK(present(*surface.target(now, [](int i) { return i % 4 == 0; }), 8) == std::vector{0, 4});
  CHECK(surface.target(now, kAll)->nearest({1.049f, 0, 0}, 0.1f).gaussian->mean.x() == 1);
}

TEST_CASE("targets share what stays; those handed out before do not change") {
  MeasuredSurface surface;
  surface.append(isotropic_gaussians(row_of_points(6)));
  const auto mean = [&](int i) { return surface.mean(i); };
  const auto first = surface.target(mean, kAll);
  CHECK(surface.target(mean, kAll)->num_shared_with(*first) == 6);
  surface.append(isotropic_gaussians({{2.01f, 0, 0}, {20, 0, 0}}));
  const auto second = surface.target(mean, kAll);
  CHECK(second->size() == 8);
  CHECK(second->num_shared_with(*first) == 5);
  const auto third = surface.target(mean, [](int i) { return i != 0; });
  CHECK(third->num_shared_with(*second) == second->num_blocks() - 1);
  CHECK(first->size() == 6);
  CHECK(present(*first, 6).size() == 6);
}
