// SPDX-License-Identifier: Apache-2.0
#include "langgs/track/motion_model.hpp"

#include <doctest/doctest.h>

#include <cmath>

using namespace langgs;

namespace {

Twist some_velocity() {  // per second, in the camera frame
  Twist v;
  v << 0.3, -0.6, 0.9, 0.6, 0.3, -0.9;
  return v;
}

bool same(const Pose& a, const Pose& b) { return (a.matrix() - b.matrix()).norm() < 1e-12; }

}  // namespace

TEST_CASE("motion goes on at constant velocity, whatever the intervals") {
  const Twist velocity = some_velocity();
  const Pose start = se3_exp(0.3 * velocity);
  MotionModel constant(InitialGuess::constant_velocity), last(InitialGuess::last_pose);
  double time = 7.5;
  Pose T_world_camera = start;
  constant.restart(T_world_camera, time);
  last.restart(T_world_camera, time);
  CHECK(same(constant.predict(time + 0.1), T_world_camera));  // nothing is known of the motion yet
  CHECK(same(constant.motion(0.1), Pose::Identity()));
  for (const double interval : {0.033, 0.033, 0.1, 0.01, 0.067, 1.0}) {
    T_world_camera = T_world_camera * se3_exp(interval * velocity);
    time += interval;
    constant.observe(T_world_camera, time);
    last.observe(T_world_camera, time);
    CHECK(same(last.predict(time + interval), T_world_camera));
    CHECK(same(constant.predict(time), T_world_camera));
    for (const double ahead : {0.2, 1.0, 2.9})
      CHECK(same(constant.predict(time + ahead * interval), T_world_camera * se3_exp(ahead * interval * velocity)));
    CHECK(constant.last().matrix() == T_world_camera.matrix());
  }
}

TEST_CASE("motion within a frame runs both ways") {
  MotionModel model;
  model.restart(Pose::Identity(), 0);
  model.observe(se3_exp(0.033 * some_velocity()), 0.033);
  CHECK(same(model.motion(0.02), se3_exp(0.02 * some_velocity())));
  CHECK(same(model.motion(-0.02) * model.motion(0.02), Pose::Identity()));
}

TEST_CASE("over a gap motion ends after three intervals, and nothing is predicted backwards") {
  const Twist velocity = some_velocity();
  MotionModel model;
  model.restart(Pose::Identity(), 0);
  const Pose T_world_camera = se3_exp(0.1 * velocity);
  model.observe(T_world_camera, 0.1);
  const Pose farthest = T_world_camera * se3_exp(0.3 * velocity);
  for (const double gap : {0.3, 0.5, 10.0, 1e9}) CHECK(same(model.predict(0.1 + gap), farthest));
  CHECK(same(model.predict(0.05), T_world_camera));
  CHECK(same(model.predict(-1e9), T_world_camera));
  // After the gap the velocity is that over the gap.
  model.observe(T_world_camera * se3_exp(0.2 * velocity), 1.1);
  CHECK(same(model.motion(1), se3_exp(0.2 * velocity)));
}

TEST_CASE("equal and decreasing time stamps stop the motion") {
  for (const double time : {0.1, 0.05}) {
    MotionModel model;
    model.restart(Pose::Identity(), 0);
    model.observe(se3_exp(0.1 * some_velocity()), 0.1);
    const Pose elsewhere = se3_exp(0.2 * some_velocity());
    model.observe(elsewhere, time);
    CHECK(same(model.predict(5), elsewhere));
    CHECK(same(model.motion(0.1), Pose::Identity()));
  }
}

TEST_CASE("a restart forgets the motion") {
  MotionModel model;
  model.restart(Pose::Identity(), 0);
  model.observe(se3_exp(0.1 * some_velocity()), 0.1);
  const Pose elsewhere = se3_exp(-2 * some_velocity());
  model.restart(elsewhere, 0.2);
  CHECK(same(model.predict(0.3), elsewhere));
  CHECK(same(model.motion(-1), Pose::Identity()));
  model.observe(elsewhere * se3_exp(0.1 * some_velocity()), 0.3);
  CHECK(same(model.predict(0.4), elsewhere * se3_exp(0.2 * some_velocity())));
}
