// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "langgs/core/rng.hpp"
#include "langgs/optimize/hybrid_schedule.hpp"
#include "langgs/optimize/pose_refinement.hpp"

using namespace langgs;

static_assert(require_optimization_schedule<HybridSchedule>());
static_assert(require_optimization_schedule<JointSchedule>());
static_assert(require_optimization_schedule<GeometrySchedule>());
static_assert(!OptimizationSchedule<int>);
static_assert(require_pose_refiner<PoseRefinement>());
static_assert(require_pose_refiner<NoPoseRefinement>());

namespace {

Twist random_twist(std::uint64_t seed, double scale) {
  const CounterRng rng{seed};
  Twist t;
  for (int i = 0; i < 6; ++i) t[i] = scale * (2 * rng.uniform(i) - 1);
  return t;
}

}  // namespace

TEST_CASE("schedules: geometry always, features every n-th iteration and at first visits") {
  HybridSchedule hybrid;
  int features = 0;
  for (int i = 0; i < 100; ++i) {
    const OptimizationStep step = hybrid({i, false});
    CHECK(step.geometry);
    CHECK(step.features == (i % 4 == 0));
    features += step.features;
  }
  CHECK(features == 25);
  CHECK(hybrid({3, true}).features);
  hybrid.features_at_first_visit = false;
  CHECK(!hybrid({3, true}).features);
  hybrid.feature_every = 0;
  CHECK_THROWS_AS((void)hybrid({0, false}), InvalidArgument);
  CHECK(JointSchedule{}({3, false}) == OptimizationStep{true, true});
  CHECK(GeometrySchedule{}({0, true}) == OptimizationStep{true, false});
}

TEST_CASE("pose refinement: one step and many agree with scalar Adam") {
  PoseRefinement refinement;
  refinement.start_after_visits = 0;
  refinement.max_translation = refinement.max_rotation = 10;
  PoseRefinementState state(se3_exp(random_twist(1, 0.5)));
  Pose expected = state.T_camera_world;
  double m[6] = {}, v[6] = {};
  for (int step = 1; step <= 100; ++step) {
    const Twist gradient = random_twist(step, std::pow(10.0, step % 5 - 2));
    Twist tau;
    for (int i = 0; i < 6; ++i) {
      m[i] = 0.9 * m[i] + 0.1 * gradient[i];
      v[i] = 0.999 * v[i] + 0.001 * gradient[i] * gradient[i];
      const double rate = i < 3 ? 5e-5 : 1.5e-4;
      tau[i] = -rate * (m[i] / (1 - std::pow(0.9, step))) / (std::sqrt(v[i] / (1 - std::pow(0.999, step))) + 1e-8);
    }
    expected = se3_exp(tau) * expected;
    const Pose got = refinement.step(state, gradient);
    REQUIRE((got.matrix() - expected.matrix()).norm() < 1e-12);
  }
  CHECK(state.steps == 100);
}

TEST_CASE("pose refinement: finds the pose that a quadratic loss prefers") {
  const Pose tracked = se3_exp(random_twist(3, 1.0));
  const Pose wanted = se3_exp(random_twist(4, 0.004)) * tracked;
  PoseRefinement refinement;
  refinement.lr_translation = refinement.lr_rotation = 1e-4;
  PoseRefinementState state(tracked);
  for (int i = 0; i < 1000; ++i) {
    // loss = |log(T wanted^-1)|^2 / 2, whose gradient by a left perturbation is the log itself to first order
    const Twist gradient = se3_log(state.T_camera_world * wanted.inverse());
    refinement.step(state, gradient);
  }
  CHECK(se3_log(state.T_camera_world * wanted.inverse()).norm() < 2e-4);
}

TEST_CASE("pose refinement: waits, keeps fixed poses, limits drift, survives bad gradients") {
  PoseRefinement refinement;
  refinement.lr_translation = refinement.lr_rotation = 0.01;
  const Pose tracked = se3_exp(random_twist(5, 1.0));
  PoseRefinementState state(tracked), fixed(tracked, true);
  const Twist gradient = Twist::Constant(-1);
  for (int i = 0; i < 5; ++i) CHECK(refinement.step(state, gradient).matrix() == tracked.matrix());
  CHECK(refinement.step(state, gradient).matrix() != tracked.matrix());
  for (int i = 0; i < 500; ++i) {
    const Pose pose = refinement.step(state, gradient);
    const double moved = (pose.inverse().translation() - tracked.inverse().translation()).norm();
    const double turned = so3_log((pose * tracked.inverse()).linear()).norm();
    REQUIRE(moved <= 0.02 * (1 + 1e-9));
    REQUIRE(turned <= std::numbers::pi / 180 * (1 + 1e-9));
    REQUIRE(refinement.step(fixed, gradient).matrix() == tracked.matrix());
  }
  const Pose before = state.T_camera_world;
  Twist bad = gradient;
  bad[2] = std::numeric_limits<double>::quiet_NaN();
  CHECK(refinement.step(state, bad).matrix() == before.matrix());
  CHECK(state.rejected == 1);
  CHECK(is_finite(refinement.step(state, Twist::Constant(1e200))));
  CHECK(is_finite(refinement.step(state, Twist::Zero())));
  refinement.beta1 = 1;
  CHECK_THROWS_AS(refinement.step(state, gradient), InvalidArgument);
  CHECK(NoPoseRefinement{}.step(fixed, gradient).matrix() == tracked.matrix());
}
