// SPDX-License-Identifier: Apache-2.0
// The feature kernels on CUDA against their formulas in double. 40 channels: one full warp and a tail; 544: two blocks
// of channels.
#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <type_traits>
#include <vector>

#include "cuda/device_array.hpp"
#include "langgs/core/rng.hpp"
#include "langgs/device/launch.hpp"
#include "langgs/optimize/feature_adam.hpp"
#include "langgs/optimize/feature_average.hpp"
#include "langgs/render/feature_compositor.hpp"

namespace langgs {
namespace {

using test::DeviceArray;

constexpr int kWidth = 19, kHeight = 2, kPixels = kWidth * kHeight, kGaussians = 11;

/// Random contributions: 0 to 4 a pixel, of Gaussians 0 .. 9; the last Gaussian is in none.
template <int kDim>
struct Field {
  std::vector<std::int32_t> begin{0}, gaussian;
  std::vector<Contribution> contribution;
  std::vector<Half> features, teacher;

  Field() {
    for (int p = 0; p < kPixels; ++p) {
      const CounterRng rng{3, static_cast<std::uint64_t>(p)};
      for (std::uint32_t i = 0, n = rng.below(0, 5); i < n; ++i) {
        gaussian.push_back(static_cast<std::int32_t>(rng.below(10 + i, kGaussians - 1)));
        contribution.push_back({p, static_cast<float>(rng.uniform(20 + i))});
      }
      begin.push_back(static_cast<std::int32_t>(gaussian.size()));
    }
    for (int i = 0; i < kGaussians * kDim; ++i)
      features.push_back(Half(static_cast<float>(CounterRng{4, 0}.normal(i))));
    for (int i = 0; i < kPixels * kDim; ++i) teacher.push_back(Half(static_cast<float>(CounterRng{5, 0}.normal(i))));
  }
  static double value(Half h) { return static_cast<double>(static_cast<float>(h)); }
  [[nodiscard]] double rendered(int p, int c) const {
    double sum = 0;
    for (int i = begin[p]; i < begin[p + 1]; ++i)
      sum += static_cast<double>(contribution[i].weight) * value(features[gaussian[i] * kDim + c]);
    return sum;
  }
  /// Hits in the order of the Gaussians.
  [[nodiscard]] std::vector<Contribution> hits() const {
    std::vector<Contribution> result;
    for (int g = 0; g < kGaussians; ++g)
      for (std::size_t i = 0; i < gaussian.size(); ++i)
        if (gaussian[i] == g) result.push_back(contribution[i]);
    return result;
  }
  [[nodiscard]] std::vector<TouchedGaussian> touched() const {
    std::vector<TouchedGaussian> result;
    std::int32_t next = 0;
    for (int g = 0; g < kGaussians; ++g) {
      const std::int32_t first = next;
      for (const std::int32_t id : gaussian) next += id == g ? 1 : 0;
      if (next > first) result.push_back({g, first, next});
    }
    return result;
  }
};

template <int kDim>
struct DeviceField {
  explicit DeviceField(const Field<kDim>& f)
      : begin(f.begin),
        gaussian(f.gaussian),
        contribution(f.contribution),
        hits(f.hits()),
        touched(f.touched()),
        features(f.features),
        teacher(f.teacher),
        num_touched(static_cast<int>(f.touched().size())) {}
  [[nodiscard]] ContributionView view(const Field<kDim>& f) const {
    return {kWidth, kHeight, static_cast<int>(f.gaussian.size()), begin.data(), gaussian.data(), contribution.data()};
  }
  [[nodiscard]] FeatureHitsView hits_view() const { return {num_touched, touched.data(), hits.data()}; }

  DeviceArray<std::int32_t> begin, gaussian;
  DeviceArray<Contribution> contribution, hits;
  DeviceArray<TouchedGaussian> touched;
  DeviceArray<Half> features, teacher;
  int num_touched;
};

}  // namespace

TEST_CASE_TEMPLATE("Composited features on CUDA are the weighted sums", Dim, std::integral_constant<int, 40>,
                   std::integral_constant<int, 544>) {
  constexpr int kDim = Dim::value;
  const Field<kDim> field;
  const DeviceField<kDim> device(field);
  const Executor<Cuda> executor;
  DeviceArray<float> out(kPixels * kDim);
  DeviceArray<Half> halves(kPixels * kDim);
  composite_features<kDim>(executor, device.view(field), device.features.data(), out.data());
  composite_features<kDim>(executor, device.view(field), device.features.data(), halves.data());
  executor.synchronize();
  const std::vector<float> got = out.values();
  const std::vector<Half> got_halves = halves.values();
  for (int p = 0; p < kPixels; ++p)
    for (int c = 0; c < kDim; ++c) {
      REQUIRE(std::abs(static_cast<double>(got[p * kDim + c]) - field.rendered(p, c)) < 1e-5);
      REQUIRE(got_halves[p * kDim + c] == Half(got[p * kDim + c]));
    }
}

TEST_CASE_TEMPLATE("The average step on CUDA is its formula", Dim, std::integral_constant<int, 40>,
                   std::integral_constant<int, 544>) {
  constexpr int kDim = Dim::value;
  const Field<kDim> field;
  DeviceField<kDim> device(field);
  const Executor<Cuda> executor;
  using Update = detail::AverageUpdate<kDim, Half>;
  const float prior = 0.5f;
  DeviceArray<float> confidence(kGaussians, 0);
  launch(executor, (device.num_touched + Update::kWarps - 1) / Update::kWarps,
         Update{device.hits_view(), device.teacher.data(), device.features.data(), confidence.data(), prior, 100.f});
  executor.synchronize();
  const std::vector<Half> got = device.features.values();
  const std::vector<float> got_confidence = confidence.values();
  for (int g = 0; g < kGaussians; ++g) {
    double weight = 0;
    for (std::size_t i = 0; i < field.gaussian.size(); ++i)
      weight += field.gaussian[i] == g ? static_cast<double>(field.contribution[i].weight) : 0;
    CHECK(static_cast<double>(got_confidence[g]) == doctest::Approx(weight == 0 ? 0 : prior + weight).epsilon(1e-5));
    for (int c = 0; c < kDim; ++c) {
      double sum = static_cast<double>(prior) * field.value(field.features[g * kDim + c]);
      for (std::size_t i = 0; i < field.gaussian.size(); ++i)
        if (field.gaussian[i] == g)
          sum += static_cast<double>(field.contribution[i].weight) *
                 field.value(field.teacher[field.contribution[i].pixel * kDim + c]);
      const double expected = weight == 0 ? field.value(field.features[g * kDim + c]) : sum / (prior + weight);
      REQUIRE(std::abs(field.value(got[g * kDim + c]) - expected) < 1e-5 + std::abs(expected) * 0x1p-11);
    }
  }
}

TEST_CASE_TEMPLATE("The Adam step on CUDA is L1 and Adam", Dim, std::integral_constant<int, 40>,
                   std::integral_constant<int, 544>) {
  constexpr int kDim = Dim::value;
  const Field<kDim> field;
  const DeviceField<kDim> device(field);
  const Executor<Cuda> executor;
  using Signs = detail::FeatureSigns<kDim>;
  using Update = detail::AdamFeatureUpdate<kDim, float>;
  DeviceArray<std::uint32_t> signs(kPixels * Signs::kWords);
  stream_features<kDim>(executor, device.view(field), device.features.data(),
                        Signs{device.teacher.data(), signs.data()});
  executor.synchronize();

  std::vector<double> gradient(kGaussians * kDim, 0.);
  const std::vector<std::uint32_t> words = signs.values();
  for (int p = 0; p < kPixels; ++p)
    for (int c = 0; c < kDim; ++c) {
      const double difference = field.rendered(p, c) - field.value(field.teacher[p * kDim + c]);
      const bool positive = ((words[p * Signs::kWords + c / 32] >> (c % 32)) & 1u) != 0;
      if (std::abs(difference) > 1e-5) REQUIRE(positive == (difference > 0));
      for (int i = field.begin[p]; i < field.begin[p + 1]; ++i) {
        const double w = static_cast<double>(field.contribution[i].weight);
        gradient[field.gaussian[i] * kDim + c] += positive ? w : -w;
      }
    }

  std::vector<float> start;
  for (const Half h : field.features) start.push_back(static_cast<float>(h));
  DeviceArray<float> features(start), first(kGaussians * kDim, 0), second(kGaussians * kDim, 0);
  const double scale = 0.25, rate = 0.01;
  launch(executor, (device.num_touched + Update::kWarps - 1) / Update::kWarps,
         Update{device.hits_view(), signs.data(), static_cast<float>(scale), static_cast<float>(rate),
                AdamRule{0.9f, 0.99f, 1e-8f}, features.data(), first.data(), second.data()});
  executor.synchronize();
  const std::vector<float> got = features.values(), moment = first.values();
  for (int i = 0; i < kGaussians * kDim; ++i) {
    const double g = scale * gradient[i];
    REQUIRE(static_cast<double>(moment[i]) == doctest::Approx(0.1 * g).epsilon(1e-4));
    if (g != 0 && std::abs(g) < 1e-4) continue;  // the quotient amplifies rounding
    const double step = g == 0 ? 0 : 0.1 * g / (std::sqrt(0.01 * g * g) + 1e-8);
    REQUIRE(std::abs(static_cast<double>(got[i]) - (static_cast<double>(start[i]) - rate * step)) < 1e-5);
  }
}

}  // namespace langgs
