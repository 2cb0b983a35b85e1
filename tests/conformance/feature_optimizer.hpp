// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <vector>

#include "langgs/core/rng.hpp"
#include "langgs/optimize/feature_step.hpp"

/// @file What LangGsSlam relies on in a feature optimiser. For a type of your own, in one source file:
///
///   #include "conformance/feature_optimizer.hpp"
///   TEST_CASE_TEMPLATE_INVOKE(langgs_feature_optimizer_conformance, MyOptimizer);

namespace langgs::conformance {

/// 40 Gaussians, three to a pixel of an 8x6 teacher that has the same unit vector everywhere; the last Gaussian is in
/// no pixel.
template <class Optimizer, int D = 20>
struct OneTeacher {
  static constexpr int kWidth = 8, kHeight = 6, kGaussians = 40;

  OneTeacher() : teacher(kWidth, kHeight) {
    const CounterRng rng{5, 0};
    std::vector<Gaussian<D>> gaussians(kGaussians);
    for (int g = 0; g < kGaussians; ++g)
      for (int c = 0; c < D; ++c) gaussians[g].feature[c] = static_cast<float>(0.2 * rng.normal(g * D + c));
    map.append(gaussians, 0, 0);
    std::vector<float> vector(D);
    for (int c = 0; c < D; ++c) vector[c] = c % 2 == 0 ? 1.f : -1.f;
    for (int p = 0; p < kWidth * kHeight; ++p) {
      teacher.set_pixel(p % kWidth, p / kWidth, vector.data());
      for (int k = 0; k < 3; ++k) {
        gaussian.push_back((5 * p + 7 * k) % (kGaussians - 1));
        contribution.push_back({p, 1.f / 3});
      }
      begin.push_back(static_cast<std::int32_t>(gaussian.size()));
    }
  }
  void step(const Executor<Host>& executor) {
    feature_step.step(
        executor, optimizer, map,
        {kWidth, kHeight, static_cast<int>(gaussian.size()), begin.data(), gaussian.data(), contribution.data()},
        teacher);
  }
  [[nodiscard]] std::vector<float> feature(int g) const {
    const auto row = map[g].feature;
    return std::vector<float>(row.begin(), row.end());
  }
  /// Mean cosine of the composited pixels to the teacher.
  [[nodiscard]] double cosine() const {
    double sum = 0;
    for (int p = 0; p < kWidth * kHeight; ++p) {
      std::vector<double> pixel(D);
      for (int i = begin[p]; i < begin[p + 1]; ++i)
        for (int c = 0; c < D; ++c) pixel[c] += static_cast<double>(contribution[i].weight * feature(gaussian[i])[c]);
      double product = 0, norm2 = 0;
      for (int c = 0; c < D; ++c) {
        product += (c % 2 == 0 ? pixel[c] : -pixel[c]) / std::sqrt(static_cast<double>(D));
        norm2 += pixel[c] * pixel[c];
      }
      sum += product / std::sqrt(norm2);
    }
    return sum / (kWidth * kHeight);
  }

  Optimizer optimizer{};
  GaussianMap<D, Host, Optimizer> map;
  FeatureMap<D> teacher;
  FeatureStep<D, Optimizer> feature_step;
  std::vector<std::int32_t> begin{0}, gaussian;
  std::vector<Contribution> contribution;
};

}  // namespace langgs::conformance

TEST_CASE_TEMPLATE_DEFINE("feature optimiser conformance", Optimizer, langgs_feature_optimizer_conformance) {
  using namespace langgs;
  static_assert(FeatureOptimizer<Optimizer>, "see the concept FeatureOptimizer");
  using Problem = conformance::OneTeacher<Optimizer>;

  SUBCASE("features come near the teacher and stay finite") {
    Problem problem;
    const Executor<Host> executor(1);
    const double first = problem.cosine();
    for (int i = 0; i < 500; ++i) problem.step(executor);
    CHECK(first < 0.5);
    CHECK(problem.cosine() > 0.98);
  }
  SUBCASE("a Gaussian that no pixel uses keeps its feature") {
    Problem problem;
    const std::vector<float> before = problem.feature(Problem::kGaussians - 1);
    for (int i = 0; i < 3; ++i) problem.step(Executor<Host>(1));
    CHECK(problem.feature(Problem::kGaussians - 1) == before);
  }
  SUBCASE("the same bits for any number of threads") {
    Problem one, three;
    for (int i = 0; i < 5; ++i) {
      one.step(Executor<Host>(1));
      three.step(Executor<Host>(3));
    }
    for (int g = 0; g < Problem::kGaussians; ++g) REQUIRE(one.feature(g) == three.feature(g));
  }
  SUBCASE("what it keeps beside a Gaussian goes with the Gaussian") {
    Problem whole, pruned;
    const Executor<Host> executor(1);
    for (int i = 0; i < 4; ++i) {
      whole.step(executor);
      pruned.step(executor);
    }
    std::vector<std::int32_t> keep(Problem::kGaussians, 1);
    keep[3] = 0;
    pruned.map.prune(keep);
    std::vector<float> before, after;
    whole.map.for_each_feature_array([&](const auto& rows) {
      for (int g = 0; g < Problem::kGaussians; ++g)
        for (int c = 0; c < rows.width() && g != 3; ++c) before.push_back(static_cast<float>(rows.row(g)[c]));
    });
    pruned.map.for_each_feature_array([&](const auto& rows) {
      for (int g = 0; g + 1 < Problem::kGaussians; ++g)
        for (int c = 0; c < rows.width(); ++c) after.push_back(static_cast<float>(rows.row(g)[c]));
    });
    CHECK(before == after);
  }
}
