// SPDX-License-Identifier: Apache-2.0
#include "langgs/render/feature_compositor.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <vector>

#include "langgs/core/rng.hpp"
#include "langgs/map/gaussian_map.hpp"

using namespace langgs;

namespace {

/// Contributions with 0 to 5 hits a pixel.
struct RandomContributions {
  explicit RandomContributions(int num_pixels, int num_gaussians) : begin{0} {
    const CounterRng rng{31, 0};
    for (int p = 0; p < num_pixels; ++p) {
      for (std::uint32_t k = 0; k < rng.below(p, 6); ++k) {
        gaussian.push_back(static_cast<std::int32_t>(rng.below(10000 + 8 * p + k, num_gaussians)));
        weight.push_back(static_cast<float>(rng.uniform(50000 + 8 * p + k)));
      }
      begin.push_back(static_cast<std::int32_t>(gaussian.size()));
    }
  }
  [[nodiscard]] ContributionView view() const {
    return {static_cast<int>(begin.size()) - 1, static_cast<int>(gaussian.size()), begin.data(), gaussian.data(),
            weight.data()};
  }
  std::vector<std::int32_t> begin, gaussian;
  std::vector<float> weight;
};

}  // namespace

TEST_CASE_TEMPLATE("features composite as a plain double loop says", Dim, std::integral_constant<int, 1>,
                   std::integral_constant<int, 3>, std::integral_constant<int, 16>, std::integral_constant<int, 31>,
                   std::integral_constant<int, 32>, std::integral_constant<int, 33>, std::integral_constant<int, 100>,
                   std::integral_constant<int, 512>, std::integral_constant<int, 1153>) {
  constexpr int D = Dim::value, kPixels = 53, kGaussians = 20;
  const RandomContributions contributions(kPixels, kGaussians);
  Rows<float, Host> features(D);
  features.resize(kGaussians);
  for (int i = 0; i < kGaussians * D; ++i) features.data()[i] = static_cast<float>(CounterRng{32, 0}.normal(i));

  std::vector<float> first;
  for (const int threads : {1, 3}) {
    const Executor<Host> executor(threads);
    std::vector<float> out(kPixels * D + 1, -7.f);  // the last value guards the end
    composite_features<D>(executor, contributions.view(), features.data(), out.data());
    REQUIRE(out.back() == -7.f);
    for (int p = 0; p < kPixels; ++p)
      for (int c = 0; c < D; ++c) {
        double sum = 0;
        for (int i = contributions.begin[p]; i < contributions.begin[p + 1]; ++i)
          sum += static_cast<double>(contributions.weight[i]) * features.row(contributions.gaussian[i])[c];
        REQUIRE(std::abs(out[p * D + c] - sum) < 2e-6);
      }
    if (first.empty()) first = out;
    CHECK(out == first);
  }
}

TEST_CASE("no pixels are nothing to do") {
  const Executor<Host> executor(1);
  const std::int32_t begin = 0;
  composite_features<3>(executor, {0, 0, &begin, nullptr, nullptr}, nullptr, nullptr);
}
