// SPDX-License-Identifier: Apache-2.0
#include "langgs/frame/synthetic_room.hpp"

#include <doctest/doctest.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <set>
#include <vector>

#include "langgs/host/worker_pool.hpp"

using namespace langgs;

namespace {

SyntheticRoomSettings small_room() {
  SyntheticRoomSettings settings;
  settings.width = 160;
  settings.height = 120;
  return settings;
}

double turn_between(const Pose& a, const Pose& b) { return so3_log(a.linear().transpose() * b.linear()).norm(); }

}  // namespace

TEST_CASE("solids are met where their equations say") {
  using detail::Shape;
  using detail::Solid;
  const Eigen::Matrix3d attitude = so3_exp({0.3, -0.5, 0.9});
  const Eigen::Vector3d centre{0.4, -0.2, 3}, half{0.5, 0.3, 0.8};
  for (const Solid solid : {Solid::kBox, Solid::kEllipsoid, Solid::kFrustum}) {
    Shape shape = Shape::make(solid, centre, attitude, half);
    shape.taper = solid == Solid::kFrustum ? 0.6 : 1;
    int hits = 0;
    for (int i = 0; i < 2000; ++i) {
      const CounterRng rng{7, static_cast<std::uint64_t>(i)};
      const detail::Ray ray{Eigen::Vector3d::Zero(), {0.6 * rng.normal(0), 0.6 * rng.normal(1), 1}};
      const auto inside = [&](double t) {
        const Eigen::Vector3d p = (attitude.transpose() * (t * ray.direction - centre)).cwiseQuotient(half);
        if (solid == Solid::kBox) return p.cwiseAbs().maxCoeff() <= 1;
        if (solid == Solid::kEllipsoid) return p.squaredNorm() <= 1;
        return std::abs(p.z()) <= 1 && p.head<2>().norm() <= 0.8 - 0.2 * p.z();
      };
      detail::SurfaceHit hit;
      const bool met = shape.intersect(ray, hit);
      double first = 0;
      for (double t = 1; t < 5 && first == 0; t += 0.002) first = inside(t) ? t : 0;
      if (!met) {
        CHECK(first == 0);
        continue;
      }
      ++hits;
      CHECK_FALSE(inside(hit.t - 1e-7));
      CHECK((first == 0 || (hit.t <= first && hit.t > first - 0.0021)));
      // The normal is that of the level set: it faces the ray and a step along it leaves the solid.
      const Eigen::Vector3d n = shape.normal(shape.to_unit(hit.t * ray.direction), hit.face);
      CHECK(n.norm() == doctest::Approx(1));
      CHECK(n.dot(ray.direction) < 1e-9);
    }
    CHECK(hits > 50);
  }
}

TEST_CASE("bounds of a view hold every hit") {
  const detail::Scene scene = detail::furnished_room(1);
  const detail::HandheldPath path(600, 1, 1);
  for (int frame = 0; frame < 600; frame += 97) {
    const Pose pose = path.T_room_camera(frame);
    for (const detail::Shape& shape : scene.shapes) {
      const detail::ViewExtent extent = detail::view_extent(shape, 1e-4, pose.translation(), pose.linear());
      for (int i = 0; i < 40; ++i) {
        const CounterRng rng{11, static_cast<std::uint64_t>(i)};
        const double u = 2 * rng.uniform(0) - 1, v = 2 * rng.uniform(1) - 1;
        detail::SurfaceHit hit;
        if (!shape.intersect({pose.translation(), pose.linear() * Eigen::Vector3d{u, v, 1}}, hit)) continue;
        CHECK((u >= extent.u0 && u <= extent.u1 && v >= extent.v0 && v <= extent.v1 && hit.t >= extent.nearest));
      }
    }
  }
}

TEST_CASE("culling changes nothing: depth equals the minimum over all solids") {
  SyntheticRoom room(small_room());
  const detail::Scene scene = detail::furnished_room(small_room().seed);
  const detail::HandheldPath path(small_room().frames, 1, small_room().seed);
  const RgbdFrame frame = room.frame(70);
  const Image<std::uint16_t> labels = room.labels(frame);
  const Pose pose = path.T_room_camera(70);
  for (int y = 0; y < 120; y += 3) {
    for (int x = 0; x < 160; x += 3) {
      const detail::Ray ray{pose.translation(), pose.linear() * room.camera().back_project(x, y, 1)};
      detail::SurfaceHit hit = scene.leave_shell(ray);
      for (int i = 0; i < static_cast<int>(scene.shapes.size()); ++i) {
        if (scene.shapes[i].intersect(ray, hit)) hit.shape = i;
      }
      CHECK(frame.depth(x, y) == doctest::Approx(hit.t).epsilon(1e-6));
      CHECK(labels(x, y) == scene.label(hit));
    }
  }
}

TEST_CASE("frames agree with each other through the true poses") {
  SyntheticRoom room(small_room());
  const RgbdFrame a = room.frame(40), b = room.frame(46);
  const Image<std::uint16_t> labels_a = room.labels(40), labels_b = room.labels(46);
  const Pose T_b_a = b.T_world_camera->inverse() * *a.T_world_camera;
  int compared = 0, agreeing = 0;
  double colour_error = 0;
  for (int y = 2; y < 118; ++y) {
    for (int x = 2; x < 158; ++x) {
      const Eigen::Vector3d p = T_b_a * room.camera().back_project(x, y, a.depth(x, y));
      const Eigen::Vector2d uv = room.camera().project(p);
      const int u = static_cast<int>(std::floor(uv.x())), v = static_cast<int>(std::floor(uv.y()));
      if (u < 0 || v < 0 || u > 158 || v > 118) continue;
      const double fu = uv.x() - u, fv = uv.y() - v;
      // Inverse depth is linear in the image of a plane.
      const auto inverse = [&](int i, int j) { return 1.0 / b.depth(i, j); };
      const double z = 1 / ((1 - fv) * ((1 - fu) * inverse(u, v) + fu * inverse(u + 1, v)) +
                            fv * ((1 - fu) * inverse(u, v + 1) + fu * inverse(u + 1, v + 1)));
      ++compared;
      const int nu = static_cast<int>(std::lround(uv.x())), nv = static_cast<int>(std::lround(uv.y()));
      if (std::abs(z - p.z()) > 2e-4 * p.z() || labels_a(x, y) != labels_b(nu, nv)) continue;
      ++agreeing;
      for (int c = 0; c < 3; ++c) colour_error += std::abs(a.colour(x, y, c) - b.colour(nu, nv, c)) / 3.0;
    }
  }
  CHECK(compared > 12000);
  CHECK(agreeing > 0.7 * compared);    // the rest: borders, round things, what the other view cannot see
  CHECK(colour_error / agreeing < 6);  // 8-bit levels at nearest pixels: matt and free of aliasing
}

TEST_CASE("every measurement lies in the room, every label has a name, most things are seen") {
  SyntheticRoom room(small_room());
  std::set<int> seen;
  for (int i = 0; i < room.size(); i += 15) {
    const RgbdFrame frame = room.frame(i);
    const Image<std::uint16_t> labels = room.labels(i);
    for (std::size_t j = 0; j < labels.size(); ++j) {
      REQUIRE(labels.data()[j] >= 1);
      REQUIRE(labels.data()[j] <= SyntheticRoom::num_classes());
      REQUIRE(frame.depth.data()[j] > 0.25f);
      REQUIRE(frame.depth.data()[j] < 6.6f);
      seen.insert(labels.data()[j]);
    }
  }
  CHECK(seen.size() >= 20);
  CHECK(SyntheticRoom::class_names().size() == static_cast<std::size_t>(SyntheticRoom::num_classes()) + 1);
}

TEST_CASE("the picture has enough contrast and no wall is bare") {
  SyntheticRoom room(small_room());
  for (int i = 0; i < room.size(); i += 45) {
    const RgbdFrame frame = room.frame(i);
    double sum = 0, sum2 = 0;
    for (std::size_t j = 0; j < frame.colour.size(); ++j) {
      sum += frame.colour.data()[j];
      sum2 += static_cast<double>(frame.colour.data()[j]) * frame.colour.data()[j];
    }
    const double n = static_cast<double>(frame.colour.size()), mean = sum / n;
    CHECK(mean > 70);
    CHECK(mean < 180);
    CHECK(std::sqrt(sum2 / n - mean * mean) > 25);
  }
}

TEST_CASE("depth constrains every direction of motion along the whole path") {
  for (const int frames : {180, 600}) {
    SyntheticRoomSettings settings = small_room();
    settings.frames = frames;
    SyntheticRoom room(settings);
    const Camera camera = room.camera();
    for (int i = 0; i < frames; i += frames / 12) {
      const Image<float> depth = room.frame(i).depth;
      Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
      int count = 0;
      for (int y = 1; y + 1 < depth.height(); y += 2) {
        for (int x = 1; x + 1 < depth.width(); x += 2) {
          const auto point = [&](int u, int v) { return camera.back_project(u, v, depth(u, v)); };
          const float z = depth(x, y);
          const bool jump = std::abs(depth(x + 1, y) + depth(x - 1, y) - 2 * z) > 0.02f * z ||
                            std::abs(depth(x, y + 1) + depth(x, y - 1) - 2 * z) > 0.02f * z;
          if (jump) continue;
          const Eigen::Vector3d n = (point(x + 1, y) - point(x - 1, y)).cross(point(x, y + 1) - point(x, y - 1));
          scatter += n.normalized() * n.normalized().transpose();
          ++count;
        }
      }
      const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(scatter / count);
      INFO("frame ", i, " of ", frames);
      CHECK(solver.eigenvalues()[0] > 0.03);  // share of surface that faces the least constrained direction
    }
  }
}

TEST_CASE("the path is smooth, starts at the identity and comes back") {
  for (const int frames : {60, 180, 500, 1500}) {
    SyntheticRoomSettings settings = small_room();
    settings.frames = frames;
    SyntheticRoom room(settings);
    CHECK(room.ground_truth(0).matrix() == Pose::Identity().matrix());
    double length = 0, turn = 0;
    for (int i = 1; i < frames; ++i) {
      const Pose a = room.ground_truth(i - 1), b = room.ground_truth(i);
      const double step = (b.translation() - a.translation()).norm(), angle = turn_between(a, b);
      REQUIRE(step < 0.05);
      REQUIRE(angle < 0.045);
      length += step;
      turn += angle;
      if (i + 1 == frames) continue;
      const Pose c = room.ground_truth(i + 1);
      REQUIRE((c.translation() - 2 * b.translation() + a.translation()).norm() < 0.006);
    }
    CHECK(length / frames > 0.008);
    CHECK(length / frames < 0.03);
    CHECK(turn / frames > 0.007);
    CHECK(turn / frames < 0.02);
    CHECK(room.ground_truth(frames - 1).translation().norm() < 0.1);
    CHECK(turn_between(room.ground_truth(0), room.ground_truth(frames - 1)) < 0.08);
  }
}

TEST_CASE("the depth error has the statistics of its model") {
  SyntheticRoomSettings settings = small_room();
  const SyntheticRoom exact_room(settings);
  settings.depth_noise = true;
  const SyntheticRoom noisy_room(settings);
  double ratio2 = 0, bias = 0;
  int measured = 0, holes_inside = 0, inside = 0, edges = 0, holes_at_edges = 0;
  for (const int i : {10, 90, 150}) {
    const Image<float> exact = exact_room.frame(i).depth, noisy = noisy_room.frame(i).depth;
    for (int y = 1; y < 119; ++y) {
      for (int x = 1; x < 159; ++x) {
        const double z = exact(x, y);
        const double jump = std::max({std::abs(exact(x + 1, y) - z), std::abs(exact(x - 1, y) - z),
                                      std::abs(exact(x, y + 1) - z), std::abs(exact(x, y - 1) - z)});
        if (jump > 0.1 * z) ++edges, holes_at_edges += noisy(x, y) == 0;
        if (jump < 0.01 * z) ++inside, holes_inside += noisy(x, y) == 0;
        if (noisy(x, y) == 0) continue;
        const double step = z * z / detail::kDisparitySteps;  // quantisation: uniform over one step of disparity
        const double sigma2 = std::pow(detail::axial_sigma(z), 2) + step * step / 12;
        ratio2 += std::pow(noisy(x, y) - z, 2) / sigma2;
        bias += (noisy(x, y) - z) / std::sqrt(sigma2);
        ++measured;
        const double steps = detail::kDisparitySteps / noisy(x, y);
        REQUIRE(std::abs(steps - std::round(steps)) < 1e-3);
      }
    }
  }
  CHECK(ratio2 / measured == doctest::Approx(1).epsilon(0.05));
  CHECK(std::abs(bias / measured) < 0.03);
  CHECK(holes_at_edges > 0.7 * edges);
  CHECK(holes_inside < 0.02 * inside);
}

TEST_CASE("colour noise has the given spread") {
  SyntheticRoomSettings settings = small_room();
  const Image<std::uint8_t> exact = SyntheticRoom(settings).frame(3).colour;
  settings.colour_noise = 5;
  const Image<std::uint8_t> noisy = SyntheticRoom(settings).frame(3).colour;
  double sum2 = 0;
  int count = 0;
  for (std::size_t i = 0; i < exact.size(); ++i) {
    if (exact.data()[i] < 25 || exact.data()[i] > 230) continue;
    sum2 += std::pow(noisy.data()[i] - exact.data()[i], 2);
    ++count;
  }
  CHECK(std::sqrt(sum2 / count) == doctest::Approx(5).epsilon(0.03));
}

TEST_CASE("the same settings give the same bits") {
  SyntheticRoomSettings settings = small_room();
  settings.depth_noise = true;
  settings.colour_noise = 2;
  WorkerPool pool(3);
  SyntheticRoom alone(settings), shared(settings, &pool);
  RgbdFrame first, second;
  REQUIRE(alone.next(first));
  REQUIRE(alone.next(second));
  const RgbdFrame again = shared.frame(1);
  CHECK(second.colour == again.colour);
  CHECK(second.depth == again.depth);
  CHECK(second.timestamp == again.timestamp);
  CHECK(alone.labels(1) == shared.labels(again));
  settings.seed = 2;
  CHECK_FALSE(SyntheticRoom(settings).frame(1).colour == again.colour);
}

TEST_CASE("a source ends, and bad requests say what is wrong") {
  SyntheticRoomSettings settings = small_room();
  settings.frames = 2;
  SyntheticRoom room(settings);
  RgbdFrame frame;
  CHECK(room.next(frame));
  CHECK(room.next(frame));
  CHECK_FALSE(room.next(frame));
  CHECK_THROWS_AS((void)room.frame(2), InvalidArgument);
  CHECK_THROWS_AS((void)room.labels(-1), InvalidArgument);
  CHECK_THROWS_AS((void)SyntheticRoom::class_vectors(0), InvalidArgument);
  for (int field = 0; field < 6; ++field) {
    SyntheticRoomSettings bad = small_room();
    if (field == 0) bad.width = 0;
    if (field == 1) bad.frames = 0;
    if (field == 2) bad.field_of_view = 180;
    if (field == 3) bad.motion = NAN;
    if (field == 4) bad.colour_noise = -1;
    if (field == 5) bad.frames_per_second = 0;
    CHECK_THROWS_AS(SyntheticRoom{bad}, InvalidArgument);
  }
}

TEST_CASE("class vectors are unit vectors, alike where things are") {
  const std::vector<float> vectors = SyntheticRoom::class_vectors<512>();
  REQUIRE(vectors.size() == 512u * (SyntheticRoom::num_classes() + 1));
  const auto cosine = [&](int a, int b) {
    double dot = 0;
    for (int c = 0; c < 512; ++c) dot += static_cast<double>(vectors[a * 512 + c]) * vectors[b * 512 + c];
    return dot;
  };
  CHECK(cosine(0, 0) == 0);
  for (int a = 1; a <= SyntheticRoom::num_classes(); ++a) {
    CHECK(cosine(a, a) == doctest::Approx(1).epsilon(1e-5));
    for (int b = 1; b < a; ++b) {
      CHECK(cosine(a, b) > 0.25);
      CHECK(cosine(a, b) < 0.92);
    }
  }
  CHECK(cosine(detail::kChair, detail::kSofa) > 0.78);
  CHECK(cosine(detail::kBook, detail::kCarton) > 0.78);
  CHECK(cosine(detail::kRedBall, detail::kBlueBall) > 0.78);
  CHECK(cosine(detail::kLamp, detail::kFloor) < 0.6);
  for (const int dim : {1, 3, 1152}) {
    for (const float v : SyntheticRoom::class_vectors(dim)) CHECK(std::isfinite(v));
  }
}
