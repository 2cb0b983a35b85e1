// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <vector>

#include "langgs/core/pose.hpp"
#include "langgs/host/worker_pool.hpp"
#include "langgs/track/gicp_target.hpp"
#include "langgs/track/source_cloud.hpp"

/// @file The G-ICP cost of a frame at a pose: correspondences, linearisation, value. Sums run over chunks of a fixed
/// size and are added in chunk order, so they do not depend on the number of threads.

namespace langgs::detail {

/// One source point of a running alignment and its present correspondence.
struct GicpPair {
  Eigen::Vector3d point;       ///< camera frame
  Eigen::Matrix3d covariance;  ///< camera frame
  double weight;
  int source;             ///< index in the source cloud
  Neighbour target = {};  ///< index -1: none within the gate
  /// (C_B + R C_A R^T)^-1 in the world frame times weight and kernel; 0 without a correspondence.
  Eigen::Matrix3d precision = Eigen::Matrix3d::Zero();
};

/// Normal equations of a step [rho; theta] that moves world points x by rho + theta x (x - centre).
struct NormalEquations {
  Eigen::Matrix<double, 6, 6> hessian = Eigen::Matrix<double, 6, 6>::Zero();  ///< sum J^T M J
  Twist gradient = Twist::Zero();                                             ///< sum J^T M e
  double cost = 0;                                                            ///< sum e^T M e
  double squared_normal_distance = 0;                                         ///< weighted sum [m^2]
  double weight = 0;                                                          ///< sum of weights, kernel included
  int count = 0;                                                              ///< correspondences

  NormalEquations& operator+=(const NormalEquations& other) {
    hessian += other.hessian;
    gradient += other.gradient;
    cost += other.cost;
    squared_normal_distance += other.squared_normal_distance;
    weight += other.weight;
    count += other.count;
    return *this;
  }
};

class GicpCost {
 public:
  GicpCost(const SourceCloud& source, const GicpTarget& target, WorkerPool& pool) : target_(target), pool_(pool) {
    pairs_.reserve(source.points.size());
    for (int i = 0; i < source.size(); ++i) {
      if (!source.trackable[i]) continue;
      if (!source.points[i].allFinite() || !source.covariances[i].allFinite() || !(source.weights[i] > 0)) continue;
      pairs_.push_back({source.points[i].cast<double>(), source.covariances[i].cast<double>(), source.weights[i], i});
      centroid_ += pairs_.back().point;
    }
    if (pairs_.empty()) return;
    centroid_ /= static_cast<double>(pairs_.size());
    double squared_radius = 0;
    for (const GicpPair& pair : pairs_) squared_radius += (pair.point - centroid_).squaredNorm();
    radius_ = std::max(1e-3, std::sqrt(squared_radius / static_cast<double>(pairs_.size())));
  }

  [[nodiscard]] const std::vector<GicpPair>& pairs() const { return pairs_; }
  /// Mean of the points [m], camera frame, and their rms distance from it.
  [[nodiscard]] const Eigen::Vector3d& centroid() const { return centroid_; }
  [[nodiscard]] double radius() const { return radius_; }

  /// Nearest target of every point at pose T, if closer than `gate` [m] (A.6.2).
  void find_correspondences(const Pose& T_world_camera, double gate) {
    const auto squared_gate = static_cast<float>(gate * gate);
    for_each_chunk([&](int, int begin, int end) {
      for (int i = begin; i < end; ++i) {
        GicpPair& pair = pairs_[i];
        const Eigen::Vector3f query = (T_world_camera * pair.point).cast<float>();
        Neighbour bound{-1, squared_gate};
        if (pair.target.index >= 0) {
          // The former correspondence bounds the search tightly, for the pose has moved little.
          const float squared_distance = (target_.mean(pair.target.index) - query).squaredNorm();
          if (squared_distance < squared_gate) bound = {pair.target.index, squared_distance};
        }
        pair.target = target_.nearest(query, bound);
      }
    });
  }

  /// Linearises about pose T with the present correspondences, whose precisions it sets for that pose (A.6.3). A
  /// correspondence `robust_width` off along its normal has half its weight (Cauchy kernel); 0: no kernel.
  [[nodiscard]] NormalEquations linearise(const Pose& T_world_camera, const Eigen::Vector3d& centre,
                                          double robust_width) {
    const double squared_width = robust_width * robust_width;
    return sum<NormalEquations>([&](int i, NormalEquations& sum) {
      GicpPair& pair = pairs_[i];
      pair.precision.setZero();
      if (pair.target.index < 0) return;
      const Eigen::Matrix3d rotation = T_world_camera.linear();
      const Eigen::Vector3d x = T_world_camera * pair.point;
      const Eigen::Vector3d error = target_.mean(pair.target.index).cast<double>() - x;
      const Eigen::Matrix3d covariance =
          target_.covariance(pair.target.index).cast<double>() + rotation * pair.covariance * rotation.transpose();
      const Eigen::Matrix3d precision = covariance.inverse();
      if (!precision.allFinite()) return;
      const double squared = error.dot(precision * error);
      // The trace is nearly the precision along the normal alone: this is the distance along it.
      const double squared_normal_distance = squared / precision.trace();
      if (!(squared_normal_distance >= 0)) return;
      const double kernel = squared_width > 0 ? 1 / (1 + squared_normal_distance / squared_width) : 1;
      const double weight = pair.weight * kernel;
      pair.precision = weight * precision;

      const Eigen::Matrix3d hat = skew(x - centre);  // J = [-I, hat]
      const Eigen::Matrix3d precision_hat = pair.precision * hat;
      const Eigen::Vector3d force = pair.precision * error;
      sum.hessian.topLeftCorner<3, 3>() += pair.precision;
      sum.hessian.topRightCorner<3, 3>() -= precision_hat;
      sum.hessian.bottomRightCorner<3, 3>() += hat.transpose() * precision_hat;
      sum.gradient.head<3>() -= force;
      sum.gradient.tail<3>() += hat.transpose() * force;
      sum.cost += weight * squared;
      sum.squared_normal_distance += weight * squared_normal_distance;
      sum.weight += weight;
      ++sum.count;
    });
  }

  /// The cost at another pose with the correspondences and precisions of the last linearisation.
  [[nodiscard]] double value(const Pose& T_world_camera) {
    return sum<double>([&](int i, double& sum) {
      const GicpPair& pair = pairs_[i];
      if (pair.target.index < 0) return;
      const Eigen::Vector3d error = target_.mean(pair.target.index).cast<double>() - T_world_camera * pair.point;
      sum += error.dot(pair.precision * error);
    });
  }

 private:
  static constexpr int kChunk = 256;

  template <class Body>
  void for_each_chunk(Body&& body) {
    const int n = static_cast<int>(pairs_.size());
    pool_.run((n + kChunk - 1) / kChunk,
              [&](int chunk) { body(chunk, chunk * kChunk, std::min(n, (chunk + 1) * kChunk)); });
  }

  template <class Sum, class Body>
  [[nodiscard]] Sum sum(Body&& body) {
    std::vector<Sum> partial((pairs_.size() + kChunk - 1) / kChunk, Sum{});
    for_each_chunk([&](int chunk, int begin, int end) {
      for (int i = begin; i < end; ++i) body(i, partial[chunk]);
    });
    Sum total{};
    for (const Sum& part : partial) total += part;
    return total;
  }

  const GicpTarget& target_;
  WorkerPool& pool_;
  std::vector<GicpPair> pairs_;
  Eigen::Vector3d centroid_ = Eigen::Vector3d::Zero();
  double radius_ = 1;
};

}  // namespace langgs::detail
