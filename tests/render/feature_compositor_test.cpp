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
  RandomContributions(int columns, int rows, int num_gaussians) : width(columns), height(rows) {
    const CounterRng rng{31, 0};
    for (int p = 0; p < width * height; ++p) {
      for (std::uint32_t k = 0; k < rng.below(p, 6); ++k) {
        gaussian.push_back(static_cast<std::int32_t>(rng.below(10000 + 8 * p + k, num_gaussians)));
        contribution.push_back({p, static_cast<float>(rng.uniform(50000 + 8 * p + k))});
      }
      begin.push_back(static_cast<std::int32_t>(gaussian.size()));
    }
  }
  [[nodiscard]] ContributionView view() const {
    return {width, height, static_cast<int>(gaussian.size()), begin.data(), gaussian.data(), contribution.data()};
  }
  int width, height;
  std::vector<std::int32_t> begin{0}, gaussian;
  std::vector<Contribution> contribution;
};

/// Keeps the first channel of each pixel, and how often it was called.
struct FirstChannel {
  float* value;
  int* calls;
  template <class Warp, class Values>
  void operator()(const Warp&, int p, int c, const Values& values) const {
    if (c == 0) value[p] = values.vector[0].lane(0);
    ++calls[p];
  }
};

}  // namespace

TEST_CASE_TEMPLATE("features composite as a plain double loop says", Dim, std::integral_constant<int, 1>,
                   std::integral_constant<int, 3>, std::integral_constant<int, 16>, std::integral_constant<int, 31>,
                   std::integral_constant<int, 32>, std::integral_constant<int, 33>, std::integral_constant<int, 100>,
                   std::integral_constant<int, 512>, std::integral_constant<int, 1153>) {
  constexpr int D = Dim::value, kWidth = 19, kHeight = 18, kPixels = kWidth * kHeight, kGaussians = 20;
  const RandomContributions contributions(kWidth, kHeight, kGaussians);
  Rows<float, Host> features(D);
  Rows<Half, Host> halves(D);
  features.resize(Executor<Host>(), kGaussians);
  halves.resize(Executor<Host>(), kGaussians);
  for (int i = 0; i < kGaussians * D; ++i) {
    halves.data()[i] = Half(static_cast<float>(CounterRng{32, 0}.normal(i)));
    features.data()[i] = static_cast<float>(halves.data()[i]);  // so that both are compared with the same sums
  }

  std::vector<float> first;
  for (const int threads : {1, 3}) {
    const Executor<Host> executor(threads);
    std::vector<float> out(kPixels * D + 1, -7.f), from_halves(kPixels * D + 1, -7.f);  // the last value guards the end
    std::vector<Half> half_image(kPixels * D + 1, Half(-7.f));
    composite_features<D>(executor, contributions.view(), features.data(), out.data());
    composite_features<D>(executor, contributions.view(), halves.data(), from_halves.data());
    composite_features<D>(executor, contributions.view(), halves.data(), half_image.data());
    REQUIRE(out.back() == -7.f);
    REQUIRE(half_image.back() == Half(-7.f));
    REQUIRE(from_halves == out);
    for (int p = 0; p < kPixels; ++p)
      for (int c = 0; c < D; ++c) {
        double sum = 0;
        for (int i = contributions.begin[p]; i < contributions.begin[p + 1]; ++i)
          sum += static_cast<double>(contributions.contribution[i].weight) * features.row(contributions.gaussian[i])[c];
        REQUIRE(std::abs(out[p * D + c] - sum) < 2e-6);
        REQUIRE(half_image[p * D + c] == Half(out[p * D + c]));
      }
    if (first.empty()) first = out;
    CHECK(out == first);
  }
}

TEST_CASE("a sink sees each block of channels of each pixel once") {
  constexpr int D = 1153, kWidth = 21, kHeight = 3;
  const RandomContributions contributions(kWidth, kHeight, 20);
  Rows<Half, Host> features(D);
  features.resize(Executor<Host>(), 20);
  for (int g = 0; g < 20; ++g) features.row(g)[0] = Half(static_cast<float>(g));
  std::vector<float> value(kWidth * kHeight);
  std::vector<int> calls(kWidth * kHeight);
  stream_features<D>(Executor<Host>(2), contributions.view(), features.data(),
                     FirstChannel{value.data(), calls.data()});
  for (int p = 0; p < kWidth * kHeight; ++p) {
    float sum = 0;
    for (int i = contributions.begin[p]; i < contributions.begin[p + 1]; ++i)
      sum += contributions.contribution[i].weight * static_cast<float>(contributions.gaussian[i]);
    REQUIRE(value[p] == doctest::Approx(sum).epsilon(1e-6));
    REQUIRE(calls[p] == (D + FeatureChannels<D>::kBlock - 1) / FeatureChannels<D>::kBlock);
  }
}

TEST_CASE("no pixels are nothing to do") {
  const Executor<Host> executor(1);
  const std::int32_t begin = 0;
  const Half* no_features = nullptr;
  float* no_image = nullptr;
  composite_features<3>(executor, {0, 0, 0, &begin, nullptr, nullptr}, no_features, no_image);
}
