// SPDX-License-Identifier: Apache-2.0
#include "langgs/eval/trajectory.hpp"

#include <doctest/doctest.h>

#include <limits>

using namespace langgs;

namespace {

std::vector<StampedPose> curve(int n) {
  std::vector<StampedPose> poses;
  for (int i = 0; i < n; ++i) {
    const double t = 0.1 * i;
    StampedPose pose;
    pose.timestamp = 1000 + t;
    pose.T_world_camera.translation() = Eigen::Vector3d(std::cos(t), 0.5 * std::sin(2 * t), 0.1 * t);
    poses.push_back(pose);
  }
  return poses;
}

std::vector<StampedPose> moved(std::vector<StampedPose> poses, const Pose& T) {
  for (StampedPose& pose : poses) pose.T_world_camera = T * pose.T_world_camera;
  return poses;
}

const Pose kOffset = se3_exp((Twist() << 10, -3, 200, 0.5, -2.0, 1.0).finished());

}  // namespace

TEST_CASE("ate_umeyama_se3: a planted transform is recovered and leaves no error") {
  const auto reference = curve(60);
  const AteResult ate = ate_umeyama_se3(moved(reference, kOffset.inverse()), reference);
  CHECK(ate.matched == 60);
  CHECK(ate.max_m < 1e-12 * 200);
  CHECK(ate.T_reference_estimate.matrix().isApprox(kOffset.matrix(), 1e-10));
}

TEST_CASE("ate_umeyama_se3: known residuals give RMSE, mean, median and maximum") {
  // A cross whose arms are lengthened in pairs: by symmetry the best alignment is the identity, so the residuals are
  // just the lengthenings: 0.1, 0.1, 0.2, 0.2, 0, 0.
  std::vector<StampedPose> reference(6), estimate(6);
  const double stretch[] = {0.1, 0.2, 0.0};
  for (int i = 0; i < 6; ++i) {
    const Eigen::Vector3d axis = (i % 2 == 0 ? 1.0 : -1.0) * Eigen::Vector3d::Unit(i / 2);
    reference[i].timestamp = estimate[i].timestamp = i;
    reference[i].T_world_camera.translation() = axis;
    estimate[i].T_world_camera.translation() = (1 + stretch[i / 2]) * axis;
  }
  const AteResult ate = ate_umeyama_se3(estimate, reference);
  CHECK(ate.rmse_m == doctest::Approx(std::sqrt((2 * 0.01 + 2 * 0.04) / 6)));
  CHECK(ate.mean_m == doctest::Approx(0.1));
  CHECK(ate.median_m == doctest::Approx(0.1));
  CHECK(ate.max_m == doctest::Approx(0.2));
  CHECK(ate.rmse_m > ate.mean_m);
}

TEST_CASE("ate_umeyama_se3: scale is not aligned away") {
  const auto reference = curve(60);
  auto estimate = reference;
  for (StampedPose& pose : estimate) pose.T_world_camera.translation() *= 1.1;
  CHECK(ate_umeyama_se3(estimate, reference).rmse_m > 0.05);
}

TEST_CASE("umeyama_se3: a mirrored point set gets the best rotation, never a mirror") {
  std::vector<Eigen::Vector3d> from, onto;
  for (int i = 0; i < 30; ++i) {
    from.emplace_back(3 * std::sin(i), 2 * std::cos(1.7 * i), std::sin(0.3 * i * i));
    onto.emplace_back(from.back().x(), from.back().y(), -from.back().z());
  }
  const Pose best = umeyama_se3(from, onto);
  CHECK(best.linear().determinant() == doctest::Approx(1));
  const auto cost = [&](const Pose& T) {
    double sum = 0;
    for (std::size_t i = 0; i < from.size(); ++i) sum += (T * from[i] - onto[i]).squaredNorm();
    return sum;
  };
  const double least = cost(best);
  for (int i = 0; i < 200; ++i) {
    Twist xi;
    for (int k = 0; k < 6; ++k) xi[k] = std::sin(12.9898 * (6 * i + k) + 1) * (i < 100 ? 1e-3 : 3.0);
    CHECK(cost(se3_exp(xi) * best) >= least);
  }
}

TEST_CASE("umeyama_se3: flat, straight and standing trajectories give a rotation and the least error") {
  for (const int rank : {0, 1, 2}) {
    CAPTURE(rank);
    std::vector<Eigen::Vector3d> from, onto;
    for (int i = 0; i < 20; ++i) {
      from.emplace_back(rank > 0 ? i : 2.0, rank > 1 ? i * i * 0.1 : 1.0, 3.0);
      onto.push_back(kOffset * from.back());
    }
    const Pose best = umeyama_se3(from, onto);
    CHECK((best.linear() * best.linear().transpose()).isIdentity(1e-9));
    CHECK(best.linear().determinant() == doctest::Approx(1));
    for (std::size_t i = 0; i < from.size(); ++i) CHECK((best * from[i] - onto[i]).norm() < 1e-9);
  }
  CHECK_THROWS_AS((void)umeyama_se3({}, {}), InvalidArgument);
}

TEST_CASE("ate_umeyama_se3: pairs by time; too few pairs and bad numbers are refused") {
  const auto reference = curve(60);
  auto estimate = moved(reference, kOffset);
  for (StampedPose& pose : estimate) pose.timestamp += 0.004;
  CHECK(ate_umeyama_se3(estimate, reference, 0.005).rmse_m < 1e-9);
  CHECK_THROWS_AS((void)ate_umeyama_se3(estimate, reference, 0.003), InvalidArgument);
  const std::vector<StampedPose> two(estimate.begin(), estimate.begin() + 2);
  CHECK_THROWS_AS((void)ate_umeyama_se3(two, reference, 0.005), InvalidArgument);
  CHECK_THROWS_AS((void)ate_umeyama_se3({}, {}), InvalidArgument);
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(), 1e200}) {
    estimate[7].T_world_camera.translation().y() = bad;
    CHECK_THROWS_AS((void)ate_umeyama_se3(estimate, reference, 0.005), InvalidArgument);
  }
}
