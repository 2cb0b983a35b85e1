// SPDX-License-Identifier: Apache-2.0
#include "langgs/track/gicp_cost.hpp"

#include <doctest/doctest.h>

#include <Eigen/LU>
#include <cmath>
#include <vector>

#include "reference/central_difference.hpp"
#include "track/gicp_cases.hpp"
#include "track/textured_wall.hpp"

/// @file The vectorised cost and its linearisation against a naive one in double precision, and against differences.

using namespace langgs;
using detail::GicpCost, detail::GicpWeights, detail::NormalEquations;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

namespace {

constexpr float kGate = 0.3f;
constexpr GicpWeights kGeometric{0.02, 0, 0.1}, kBoth{0.02, 3, 0.1};

Eigen::Matrix3d full(const Symmetric3& s) {
  Eigen::Matrix3d m;
  m << s[0], s[1], s[2], s[1], s[3], s[4], s[2], s[4], s[5];
  return m;
}

/// The motion x -> x + rho + (Exp(theta) - I)(x - centre).
Pose about(const Eigen::Vector3d& centre, const Twist& step) {
  Pose motion = Pose::Identity();
  motion.linear() = so3_exp(step.tail<3>());
  motion.translation() = centre + step.head<3>() - motion.linear() * centre;
  return motion;
}

/// One correspondence as found and weighted at the linearisation.
struct Term {
  Eigen::Vector3d point, mean;
  Eigen::Matrix3d precision;  // weight and kernel included
  double intensity, colour_weight;
};

/// The grey value of the frame at a world point, and its gradient; false outside. Bilinear, as documented.
bool grey_at(const SourceCloud& source, const Pose& T_world_depth, const Eigen::Vector3d& world, double& value,
             Eigen::Vector3d& gradient) {
  const IntensityImage& image = source.intensity;
  const Pose T_colour_world = (T_world_depth * source.T_colour_depth.inverse()).inverse();
  const Eigen::Vector3d p = T_colour_world * world;
  if (image.empty() || p.z() <= 0.05) return false;
  const Camera& c = image.camera;
  const Eigen::Vector2d at = c.project(p);
  if (!(at.x() >= 0 && at.y() >= 0 && at.x() < c.width - 1 && at.y() < c.height - 1)) return false;
  const int x = static_cast<int>(at.x()), y = static_cast<int>(at.y());
  const double a = at.x() - x, b = at.y() - y;
  const auto i = [&](int dx, int dy) { return static_cast<double>(image.values[(y + dy) * c.width + x + dx]); };
  value = (1 - a) * (1 - b) * i(0, 0) + a * (1 - b) * i(1, 0) + (1 - a) * b * i(0, 1) + a * b * i(1, 1);
  const double gu = c.fx * ((1 - b) * (i(1, 0) - i(0, 0)) + b * (i(1, 1) - i(0, 1)));
  const double gv = c.fy * ((1 - a) * (i(0, 1) - i(0, 0)) + a * (i(1, 1) - i(1, 0)));
  const Eigen::Vector3d camera_gradient(gu / p.z(), gv / p.z(), -(gu * p.x() + gv * p.y()) / (p.z() * p.z()));
  gradient = T_colour_world.linear().transpose() * camera_gradient;
  return true;
}

struct Naive {
  NormalEquations system;
  std::vector<Term> terms;

  Naive(const SourceCloud& source, const GridTarget& target, const Pose& T, const GicpWeights& weights) {
    const Eigen::Vector3d centre = T * centroid(source);
    for (int i = 0; i < source.size(); ++i) {
      if (!source.trackable[i]) continue;
      const Eigen::Vector3d point = source.points[i].cast<double>(), x = T * point;
      const TargetMatch match = target.nearest(x.cast<float>(), kGate);
      if (match.gaussian == nullptr) continue;
      const Eigen::Vector3d mean = match.gaussian->mean.cast<double>(), e = mean - x;
      Eigen::Matrix3d m = (full(match.gaussian->covariance) +
                           T.linear() * source.covariances[i].cast<double>() * T.linear().transpose())
                              .inverse();
      const double squared = e.dot(m * e), squared_normal = squared / m.trace();
      const double kernel = 1 / (1 + squared_normal / (weights.robust_width * weights.robust_width));
      const double weight = source.weights[i] * kernel;
      m *= weight;
      Eigen::Matrix<double, 3, 6> J;
      J << -Eigen::Matrix3d::Identity(), skew(x - centre);
      add(m, J, e);
      system.cost += e.dot(m * e);
      system.squared_normal_distance += weight * squared_normal;
      system.weight += weight;
      ++system.count;
      Term term{point, mean, m, match.gaussian->intensity, 0};
      double grey = 0;
      Eigen::Vector3d gradient;
      if (weights.photometric_weight > 0 && term.intensity >= 0 && grey_at(source, T, mean, grey, gradient)) {
        const double r = grey - term.intensity;
        term.colour_weight =
            weight * weights.photometric_weight / (1 + r * r / (weights.photometric_width * weights.photometric_width));
        // A step of the camera moves the mean, seen from it, the other way: the Jacobian of e, along the gradient.
        const Twist jt = J.transpose() * gradient;
        system.hessian += term.colour_weight * jt * jt.transpose();
        system.gradient += term.colour_weight * r * jt;
        system.cost += term.colour_weight * r * r;
      }
      terms.push_back(term);
    }
  }

  void add(const Eigen::Matrix3d& m, const Eigen::Matrix<double, 3, 6>& J, const Eigen::Vector3d& e) {
    system.hessian += J.transpose() * m * J;
    system.gradient += J.transpose() * m * e;
  }

  /// The cost at another pose, correspondences and weights held.
  double value(const SourceCloud& source, const Pose& T) const {
    double cost = 0;
    for (const Term& t : terms) {
      const Eigen::Vector3d e = t.mean - T * t.point;
      cost += e.dot(t.precision * e);
      double grey = 0;
      Eigen::Vector3d gradient;
      if (t.colour_weight > 0 && grey_at(source, T, t.mean, grey, gradient))
        cost += t.colour_weight * (grey - t.intensity) * (grey - t.intensity);
    }
    return cost;
  }

  static Eigen::Vector3d centroid(const SourceCloud& source) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (int i = 0; i < source.size(); ++i)
      if (source.trackable[i]) sum += source.points[i].cast<double>();
    return sum / source.num_trackable();
  }
};

/// A frame of the room whose colour is a smooth texture in space, and a map measured from another place.
struct Problem {
  WorkerPool pool{1};
  SourceCloud source;
  GridTarget target;
  Pose guess;

  explicit Problem(std::uint64_t seed) {
    const Pose there = test::random_motion(seed, 0.2, 0.3);
    const SourceCloud map = test::textured_room_cloud(there, pool);
    target = test::target_of(map, test::small_camera(), there);
    const Pose truth = there * test::random_motion(seed + 50, 0.05, 0.05);
    source = test::textured_room_cloud(truth, pool);
    source.T_colour_depth = test::random_motion(seed + 70, 0.005, 0.005);
    guess = truth * test::random_motion(seed + 90, 0.02, 0.02);
  }
};

Matrix6 symmetric(const Matrix6& upper) { return upper.selfadjointView<Eigen::Upper>(); }

}  // namespace

TEST_CASE("the linearisation is that of the formulas, in double precision") {
  for (std::uint64_t seed = 0; seed < 6; ++seed) {
    Problem p(seed);
    for (const GicpWeights& weights : {kGeometric, kBoth}) {
      GicpCost cost(p.source, p.pool);
      CHECK((cost.centroid() - Naive::centroid(p.source)).norm() < 1e-6);
      cost.find_correspondences(p.target, p.guess, kGate);
      const NormalEquations found = cost.linearise(p.guess, p.guess * cost.centroid(), weights);
      const Naive naive(p.source, p.target, p.guess, weights);
      const NormalEquations& expected = naive.system;
      CHECK(found.count == expected.count);
      CHECK(found.count > 1000);
      // A pixel at the image's border may be in or out, so photometric sums are a little less exact.
      const double tolerance = weights.photometric_weight > 0 ? 1e-3 : 1e-5;
      CHECK((symmetric(found.hessian) - expected.hessian).norm() < tolerance * expected.hessian.norm());
      CHECK(std::abs(found.cost - expected.cost) < tolerance * expected.cost);
      // The gradient is a difference of large sums: relative to what pulls, not to what is left.
      const double pull = std::sqrt(expected.cost * expected.hessian.trace());
      CHECK((found.gradient - expected.gradient).norm() < tolerance * pull);
      CHECK(found.weight == doctest::Approx(expected.weight).epsilon(1e-5));
      CHECK(found.squared_normal_distance == doctest::Approx(expected.squared_normal_distance).epsilon(1e-4));
      CHECK(std::abs(cost.value(p.guess) - found.cost) < 1e-5 * found.cost);
      const Pose elsewhere = p.guess * test::random_motion(seed + 7, 0.01, 0.01);
      const double value = naive.value(p.source, elsewhere);
      CHECK(std::abs(cost.value(elsewhere) - value) < (weights.photometric_weight > 0 ? 5e-3 : 1e-5) * value);
    }
  }
}

TEST_CASE("the gradient is that of the cost, weights and correspondences held") {
  for (std::uint64_t seed = 0; seed < 6; ++seed) {
    Problem p(seed);
    for (const GicpWeights& weights : {kGeometric, kBoth}) {
      GicpCost cost(p.source, p.pool);
      cost.find_correspondences(p.target, p.guess, kGate);
      const Eigen::Vector3d centre = p.guess * cost.centroid();
      const NormalEquations found = cost.linearise(p.guess, centre, weights);
      const Naive naive(p.source, p.target, p.guess, weights);
      Twist step = Twist::Zero();
      for (int k = 0; k < 6; ++k) {
        // A bilinear image bends at pixels' centres: steps far smaller than a pixel, averaged over a thousand points.
        const double slope = reference::central_difference(
            [&] { return naive.value(p.source, about(centre, step) * p.guess); }, step[k], 2e-6);
        const double scale = std::sqrt(found.cost * found.hessian(k, k));
        // cost = sum e^T M e and gradient = sum J^T M e.
        CHECK(std::abs(0.5 * slope - found.gradient[k]) < 5e-3 * scale);
      }
    }
  }
}

TEST_CASE("the normal equations predict what the cost falls by") {
  Problem p(11);
  for (const GicpWeights& weights : {kGeometric, kBoth}) {
    GicpCost cost(p.source, p.pool);
    cost.find_correspondences(p.target, p.guess, kGate);
    const Eigen::Vector3d centre = p.guess * cost.centroid();
    const NormalEquations system = cost.linearise(p.guess, centre, weights);
    const Twist step = -symmetric(system.hessian).ldlt().solve(system.gradient);
    // A part of the step only: grey values are far from linear over centimetres.
    constexpr double kPart = 0.05;
    const double predicted = -kPart * (2 - kPart) * step.dot(system.gradient);
    CHECK(predicted > 0.05 * system.cost);
    CHECK(system.cost - cost.value(about(centre, kPart * step) * p.guess) == doctest::Approx(predicted).epsilon(0.03));
  }
}

TEST_CASE("the mean brightening of the frame is learnt at a linearisation and adopted when asked") {
  constexpr GicpWeights kColourful{0.02, 30, 0.3};
  Problem p(3);
  for (float& value : p.source.intensity.values) value += 0.08f;
  GicpCost cost(p.source, p.pool);
  cost.find_correspondences(p.target, p.guess, kGate);
  const Eigen::Vector3d centre = p.guess * cost.centroid();
  const double bright = cost.linearise(p.guess, centre, kColourful).cost;
  CHECK(cost.value(p.guess) == doctest::Approx(bright).epsilon(1e-5));  // not yet
  for (int i = 0; i < 5; ++i) {
    cost.adopt_exposure();
    (void)cost.linearise(p.guess, centre, kColourful);
  }
  Problem same(3);
  GicpCost usual(same.source, same.pool);
  usual.find_correspondences(same.target, same.guess, kGate);
  for (int i = 0; i < 6; ++i) {
    (void)usual.linearise(same.guess, centre, kColourful);
    usual.adopt_exposure();
  }
  const double expected = usual.linearise(same.guess, centre, kColourful).cost;
  CHECK(bright > 1.2 * expected);
  CHECK(cost.linearise(p.guess, centre, kColourful).cost == doctest::Approx(expected).epsilon(1e-3));
}

TEST_CASE("answers are kept until they may have changed: correspondences are those of a fresh search") {
  Problem p(5);
  GicpCost kept(p.source, p.pool);
  Pose T = p.guess;
  for (int i = 0; i < 30; ++i) {
    T = test::random_motion(300 + i, 0.002, 0.001) * T;
    const float gate = i < 10 ? 0.3f : i < 20 ? 0.1f : 0.05f;
    kept.find_correspondences(p.target, T, gate);
    GicpCost fresh(p.source, p.pool);
    fresh.find_correspondences(p.target, T, gate);
    int different = 0;
    for (int k = 0; k < kept.size(); ++k) {
      const float a = kept.squared_distance(k), b = fresh.squared_distance(k);
      different += !(a == b || std::abs(a - b) < 1e-5f * b + 1e-9f);
    }
    CHECK(different == 0);
  }
}
