// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "langgs/core/error.hpp"
#include "langgs/core/pose.hpp"
#include "langgs/core/symmetric_eigen.hpp"
#include "langgs/host/worker_pool.hpp"
#include "langgs/track/gicp_cost.hpp"
#include "langgs/track/source_cloud.hpp"
#include "langgs/track/target.hpp"

/// @file Generalised ICP (Segal et al. 2009) of a frame's grid cloud to map Gaussians (A.6).

namespace langgs {

struct GicpSettings {
  double max_distance = 0.10;  ///< correspondences are closer than this [m]
  /// The same in the first iteration [m]; then it follows the size of the steps down to max_distance, and the kernel's
  /// width with it.
  double coarse_distance = 0.30;
  int max_iterations = 30;            ///< linearisations
  double rotation_epsilon = 5e-4;     ///< converged when a step turns by less [rad]
  double translation_epsilon = 2e-4;  ///< and moves the cloud's centre by less [m]
  /// Residual along the surface normal at which a correspondence has half its weight (Cauchy kernel) [m]; 0: no kernel.
  double robust_width = 0.01;
  /// What a grey value off by 1 costs, relative to a point 1 m off along its surface: colour decides where geometry
  /// leaves the pose open, and hardly elsewhere. 0: colour is not used.
  double photometric_weight = 1;
  double photometric_below = 3e-3;  ///< colour enters where geometry alone is conditioned worse than this
  double photometric_width = 0.1;   ///< grey value off at which a point has half its photometric weight
  int min_correspondences = 50;
  /// Directions whose curvature is less than this fraction of the best one's count as open: the paper's covariances
  /// alone leave 2e-3 along a bare wall.
  double degenerate_ratio = 3e-3;
  double overlap_squared_distance = 1e-3;  ///< a point is covered by the map if closer than this [m^2]
};

inline void validate(const GicpSettings& s) {
  LANGGS_EXPECTS(s.max_distance > 0 && s.coarse_distance >= s.max_distance && s.coarse_distance < 1e3,
                 "correspondence distances are ", s.max_distance, " and ", s.coarse_distance,
                 " m; they must be positive, coarse_distance not the smaller one");
  LANGGS_EXPECTS(s.max_iterations >= 1 && s.max_iterations <= 10000, "max_iterations is ", s.max_iterations,
                 "; it must be in [1, 10000]");
  LANGGS_EXPECTS(s.rotation_epsilon > 0 && s.translation_epsilon > 0, "epsilons are ", s.rotation_epsilon, " rad and ",
                 s.translation_epsilon, " m; they must be positive");
  LANGGS_EXPECTS(s.robust_width >= 0, "robust_width is ", s.robust_width, " m; it must not be negative");
  LANGGS_EXPECTS(s.photometric_weight >= 0 && s.photometric_width > 0, "photometric weight and width are ",
                 s.photometric_weight, " and ", s.photometric_width,
                 "; the weight must not be negative, the width positive");
  LANGGS_EXPECTS(s.min_correspondences >= 6, "min_correspondences is ", s.min_correspondences,
                 "; a pose needs at least 6");
  LANGGS_EXPECTS(s.degenerate_ratio >= 0 && s.degenerate_ratio < 1, "degenerate_ratio is ", s.degenerate_ratio,
                 "; it must be in [0, 1)");
  LANGGS_EXPECTS(s.overlap_squared_distance > 0, "overlap_squared_distance is ", s.overlap_squared_distance,
                 " m^2; it must be positive");
}

enum class GicpStatus {
  converged,
  iteration_limit,          ///< the pose is the best found; steps were still larger than the epsilons
  degenerate,               ///< geometry leaves directions open; there the pose is the initial guess
  too_few_correspondences,  ///< the pose is the initial guess
  failed,                   ///< arithmetic went wrong; the pose is the initial guess
};

/// True where the pose is an estimate rather than the initial guess handed back.
[[nodiscard]] inline bool has_pose(GicpStatus status) {
  return status == GicpStatus::converged || status == GicpStatus::iteration_limit || status == GicpStatus::degenerate;
}

struct GicpResult {
  Pose T_world_camera = Pose::Identity();
  GicpStatus status = GicpStatus::failed;
  int iterations = 0;
  int num_correspondences = 0;
  double overlap = 0;     ///< fraction of trackable points closer to the map than overlap_squared_distance
  double inlier_rms = 0;  ///< of the distances along the surface normals of corresponding points [m]
  /// Smallest over largest curvature of the cost, rotations taken about the cloud's centre on its own radius; near 0
  /// where geometry leaves a direction open.
  double conditioning = 0;
  /// Unit twists along which the cost curves less than GicpSettings::degenerate_ratio allows, as left perturbations of
  /// T_world_camera: there the pose is the initial guess.
  std::vector<Twist> open_directions;
  /// [N] squared distance of each source point to the nearest target mean at the final pose [m^2]; +inf where the point
  /// is not trackable or nothing lies within max_distance.
  std::vector<float> squared_distance;
  /// Half the Hessian of the cost at the final pose over the residual variance, in 1/m^2, 1/(m rad), 1/rad^2; order and
  /// frame of Twist: a left perturbation [rho; theta] of T_world_camera in the world.
  Eigen::Matrix<double, 6, 6> information = Eigen::Matrix<double, 6, 6>::Zero();
};

class GicpTracker {
 public:
  explicit GicpTracker(GicpSettings settings = {}) : settings_(settings) { validate(settings_); }

  [[nodiscard]] const GicpSettings& settings() const { return settings_; }

  /// What `align` would report at a pose that is known: overlap, distances, information. The pose is not changed.
  template <RegistrationTarget Target>
  [[nodiscard]] GicpResult evaluate(const SourceCloud& source, const Target& target, const Pose& T_world_camera,
                                    WorkerPool& pool) const {
    LANGGS_EXPECTS(is_finite(T_world_camera), "the pose to evaluate is not finite");
    GicpResult result;
    result.T_world_camera = T_world_camera;
    result.status = GicpStatus::converged;
    detail::GicpCost cost(source, pool);
    report(cost, target, source.size(), result);
    return result;
  }

  /// Registers the trackable points of `source` to `target`, from the guess `initial_T_world_camera`.
  ///
  /// Minimises sum_i e_i^T (C_B + R C_A R^T)^-1 e_i, e_i = b_i - T a_i (A.6.1), by Levenberg-Marquardt with a left
  /// perturbation about the cloud's centre. Never throws for bad data, never loops beyond the cap, and its pose is
  /// always finite if the guess is: failure hands the guess back and says so in the status. The same bits for any
  /// number of threads. Throws InvalidArgument if the guess is not finite.
  template <RegistrationTarget Target>
  [[nodiscard]] GicpResult align(const SourceCloud& source, const Target& target, const Pose& initial_T_world_camera,
                                 WorkerPool& pool) const {
    LANGGS_EXPECTS(is_finite(initial_T_world_camera), "initial pose is not finite; pass the last good pose");
    const std::size_t n = source.points.size();
    LANGGS_EXPECTS(source.covariances.size() == n && source.weights.size() == n && source.trackable.size() == n,
                   "source cloud has ", n, " points but ", source.covariances.size(), " covariances, ",
                   source.weights.size(), " weights, ", source.trackable.size(), " flags; use make_source_cloud");
    GicpResult result;
    detail::GicpCost cost(source, pool);
    result.status = iterate(cost, target, initial_T_world_camera, result);
    if (!is_finite(result.T_world_camera)) result.status = GicpStatus::failed;
    if (!has_pose(result.status)) result.T_world_camera = initial_T_world_camera;
    report(cost, target, source.size(), result);
    return result;
  }

 private:
  /// Eigenvalues (ascending) of the Hessian in comparable units: rotations as the motion of a typical point.
  struct Curvature {
    Twist units;  ///< diagonal S, step = S y
    Twist values;
    Eigen::Matrix<double, 6, 6> directions;  ///< columns, of y
    [[nodiscard]] double conditioning() const { return std::max(0.0, values[0] / values[5]); }
  };

  template <class Target>
  GicpStatus iterate(detail::GicpCost& cost, const Target& target, const Pose& initial_T_world_camera,
                     GicpResult& result) const {
    Pose& T = result.T_world_camera;
    T = initial_T_world_camera;
    double gate = settings_.coarse_distance;
    Progress progress;
    double photometric_weight = 0;
    double moved = std::numeric_limits<double>::infinity();  // a typical point, by the last step [m]
    while (result.iterations < settings_.max_iterations) {
      ++result.iterations;
      const bool is_last_stage = gate <= settings_.max_distance && moved <= kCoarseStep;
      cost.use_quarter(!is_last_stage);
      cost.find_correspondences(target, T, static_cast<float>(gate));
      const Eigen::Vector3d centre = T * cost.centroid();
      // A kernel as wide as the gate asks for: far from the solution large residuals are the signal.
      const double width = settings_.robust_width * gate / settings_.max_distance;
      detail::NormalEquations system =
          cost.linearise(T, centre, {width, photometric_weight, settings_.photometric_width});
      if (system.count < settings_.min_correspondences) return GicpStatus::too_few_correspondences;
      if (!system.hessian.allFinite() || !system.gradient.allFinite()) return GicpStatus::failed;

      Curvature curvature = decompose(system.hessian, cost.radius());
      if (photometric_weight == 0 && curvature.conditioning() < settings_.photometric_below) {
        photometric_weight = settings_.photometric_weight;
        system = cost.linearise(T, centre, {width, photometric_weight, settings_.photometric_width});
        curvature = decompose(system.hessian, cost.radius());
      }
      const Twist step = damped_step(cost, system, curvature, T, progress);
      T = renormalized(moved_about(centre, step) * T);
      cost.adopt_exposure();

      moved = step.head<3>().norm() + cost.radius() * step.tail<3>().norm();
      gate = std::clamp(kGateOverStep * moved, settings_.max_distance, gate);
      const bool small =
          step.head<3>().norm() < settings_.translation_epsilon && step.tail<3>().norm() < settings_.rotation_epsilon;
      if (is_last_stage && small) return GicpStatus::converged;
    }
    return GicpStatus::iteration_limit;
  }

  /// What one step leaves for the next.
  struct Progress {
    double damping = kInitialDamping;
    Twist direction = Twist::Zero();  ///< of the last step, in Curvature's units, before it was lengthened
    double relaxation = 1;            ///< and by how much it was

    /// By how much to lengthen a step. Correspondences follow the pose, so on noisy surfaces every step covers the same
    /// part of what is left; which part, two steps tell (Irons and Tuck 1969).
    [[nodiscard]] double relax(const Twist& next) const {
      const Twist change = next - direction;
      const double ratio = -relaxation * direction.dot(change) / change.squaredNorm();
      return ratio > 1 ? std::min(ratio, kMostRelaxation) : 1;
    }
  };

  /// Levenberg-Marquardt: the first step, with growing damping, that does not raise the cost; zero if none does.
  /// Directions that geometry leaves open do not move: there the guess is worth more than noise (A.19, item 3).
  [[nodiscard]] Twist damped_step(detail::GicpCost& cost, const detail::NormalEquations& system,
                                  const Curvature& curvature, const Pose& T, Progress& progress) const {
    double& damping = progress.damping;
    const double largest = curvature.values[5];
    const Twist slope = curvature.directions.transpose() * (curvature.units.asDiagonal() * system.gradient);
    const Eigen::Vector3d centre = T * cost.centroid();
    for (int trial = 0; trial < kMaxTrials; ++trial, damping *= 10) {
      Twist along = Twist::Zero();
      for (int k = 0; k < 6; ++k)
        if (curvature.values[k] > settings_.degenerate_ratio * largest)
          along[k] = -slope[k] / (curvature.values[k] + damping * largest);
      const Twist direction = curvature.directions * along;
      const double relaxation = trial == 0 ? progress.relax(direction) : 1;
      const Twist step = relaxation * (curvature.units.asDiagonal() * direction);
      if (step.allFinite() && cost.value(moved_about(centre, step) * T) <= system.cost * (1 + kCostNoise)) {
        progress = {std::max(kInitialDamping, 0.1 * damping), direction, relaxation};
        return step;
      }
    }
    progress = {};
    return Twist::Zero();
  }

  /// Everything that is said about the final pose, computed at the final pose (A.18, B9).
  template <class Target>
  void report(detail::GicpCost& cost, const Target& target, int num_points, GicpResult& result) const {
    const Pose& T = result.T_world_camera;
    const double reach = std::max(settings_.max_distance, std::sqrt(settings_.overlap_squared_distance));
    cost.use_quarter(false);
    cost.find_correspondences(target, T, static_cast<float>(reach));
    result.squared_distance.assign(num_points, std::numeric_limits<float>::infinity());
    int covered = 0;
    for (int k = 0; k < cost.size(); ++k) {
      result.squared_distance[cost.source(k)] = cost.squared_distance(k);
      covered += static_cast<double>(cost.squared_distance(k)) < settings_.overlap_squared_distance;
    }
    if (cost.size() > 0) result.overlap = covered / static_cast<double>(cost.size());

    const Eigen::Vector3d centre = T * cost.centroid();
    detail::GicpWeights weights{settings_.robust_width, 0, settings_.photometric_width};
    detail::NormalEquations system = cost.linearise(T, centre, weights);
    result.num_correspondences = system.count;
    if (system.count == 0 || !(system.weight > 0) || !system.hessian.allFinite()) return;
    result.inlier_rms = std::sqrt(system.squared_normal_distance / system.weight);
    Curvature curvature = decompose(system.hessian, cost.radius());
    if (curvature.conditioning() < settings_.photometric_below) {
      weights.photometric_weight = settings_.photometric_weight;
      system = cost.linearise(T, centre, weights);
      curvature = decompose(system.hessian, cost.radius());
    }
    result.conditioning = curvature.conditioning();
    const bool settled = result.status == GicpStatus::converged || result.status == GicpStatus::iteration_limit;
    if (settled && result.conditioning <= settings_.degenerate_ratio) result.status = GicpStatus::degenerate;

    // From a rotation about the centre to one about the world's origin.
    Eigen::Matrix<double, 6, 6> shift = Eigen::Matrix<double, 6, 6>::Identity();
    shift.topRightCorner<3, 3>() = -skew(centre);
    const double variance = std::max(system.cost / system.weight, kMinVariance);
    result.information = full(shift.transpose() * full(system.hessian) * shift / variance);
    for (int k = 0; k < 6; ++k) {
      if (curvature.values[k] > settings_.degenerate_ratio * curvature.values[5]) continue;
      Twist direction = curvature.units.asDiagonal() * curvature.directions.col(k);
      direction.head<3>() += centre.cross(direction.tail<3>());  // about the origin
      result.open_directions.push_back(direction.normalized());
    }
  }

  [[nodiscard]] static Eigen::Matrix<double, 6, 6> full(const Eigen::Matrix<double, 6, 6>& upper) {
    return upper.selfadjointView<Eigen::Upper>();
  }

  [[nodiscard]] static Curvature decompose(const Eigen::Matrix<double, 6, 6>& hessian, double radius) {
    Curvature curvature;
    curvature.units << 1, 1, 1, 1 / radius, 1 / radius, 1 / radius;
    const SymmetricEigen<6> eigen =
        symmetric_eigen<6>(curvature.units.asDiagonal() * full(hessian) * curvature.units.asDiagonal());
    curvature.values = eigen.values;
    curvature.directions = eigen.vectors;
    return curvature;
  }

  /// The motion x -> x + rho + (Exp(theta) - I)(x - centre) for step = [rho; theta].
  [[nodiscard]] static Pose moved_about(const Eigen::Vector3d& centre, const Twist& step) {
    Pose motion = Pose::Identity();
    motion.linear() = so3_exp(step.tail<3>());
    motion.translation() = centre + step.head<3>() - motion.linear() * centre;
    return motion;
  }

  static constexpr double kInitialDamping = 1e-9;  // of the largest curvature: Gauss-Newton unless that fails
  static constexpr double kCoarseStep = 0.004;     // m; a quarter of the points is enough for longer ones
  static constexpr double kGateOverStep = 3;  // what is left to move is about the last step: keep thrice that in reach
  static constexpr double kMostRelaxation = 1.6;  // below 2, or a step could raise the cost that it was made for
  static constexpr double kCostNoise = 1e-6;      // of sums in single precision
  static constexpr int kMaxTrials = 10;           // ends at a damping of 1: plain gradient descent
  static constexpr double kMinVariance = 1e-12;   // m^2; perfect data must not claim infinite information

  GicpSettings settings_;
};

}  // namespace langgs
