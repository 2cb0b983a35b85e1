// SPDX-License-Identifier: Apache-2.0
// The feature kernels on CUDA against their formulas in double. 40 channels: one full warp and a tail.
#include <doctest/doctest.h>

#include <cmath>
#include <vector>

#include "cuda/device_array.hpp"
#include "langgs/core/rng.hpp"
#include "langgs/device/launch.hpp"
#include "langgs/optimize/feature_step.hpp"
#include "langgs/render/feature_compositor.hpp"

namespace langgs {
namespace {

using test::DeviceArray;

constexpr int kDim = 40, kPadding = 32, kPixels = 37, kGaussians = 11;

/// Random contributions: 0 to 4 a pixel, of Gaussians 0 .. 9; the last Gaussian is in none.
struct Field {
  std::vector<std::int32_t> begin{0}, gaussian;
  std::vector<float> weight, features;

  Field() {
    for (int p = 0; p < kPixels; ++p) {
      const CounterRng rng{3, static_cast<std::uint64_t>(p)};
      for (std::uint32_t i = 0, n = rng.below(0, 5); i < n; ++i) {
        gaussian.push_back(static_cast<std::int32_t>(rng.below(10 + i, kGaussians - 1)));
        weight.push_back(static_cast<float>(rng.uniform(20 + i)));
      }
      begin.push_back(static_cast<std::int32_t>(gaussian.size()));
    }
    for (int i = 0; i < kGaussians * kDim + kPadding; ++i)
      features.push_back(static_cast<float>(CounterRng{4, 0}.normal(i)));
  }
  [[nodiscard]] double rendered(int p, int c) const {
    double sum = 0;
    for (int i = begin[p]; i < begin[p + 1]; ++i)
      sum += static_cast<double>(weight[i]) * static_cast<double>(features[gaussian[i] * kDim + c]);
    return sum;
  }
};

struct DeviceField {
  explicit DeviceField(const Field& f) : begin(f.begin), gaussian(f.gaussian), weight(f.weight), features(f.features) {}
  [[nodiscard]] ContributionView view(const Field& f) const {
    return {kPixels, static_cast<int>(f.gaussian.size()), begin.data(), gaussian.data(), weight.data()};
  }
  DeviceArray<std::int32_t> begin, gaussian;
  DeviceArray<float> weight, features;
};

TEST_CASE("Composited features on CUDA are the weighted sums") {
  const Field field;
  const DeviceField device(field);
  const Executor<Cuda> executor;
  DeviceArray<float> out(kPixels * kDim);
  composite_features<kDim>(executor, device.view(field), device.features.data(), out.data());
  executor.synchronize();
  const std::vector<float> got = out.values();
  for (int p = 0; p < kPixels; ++p)
    for (int c = 0; c < kDim; ++c)
      CHECK(static_cast<double>(got[p * kDim + c]) == doctest::Approx(field.rendered(p, c)).epsilon(1e-5));
}

TEST_CASE("The feature step on CUDA is L1 and Adam") {
  const Field field;
  const DeviceField device(field);
  const Executor<Cuda> executor;
  using Signs = FeatureSigns<kDim>;
  using Update = FeatureUpdate<kDim>;
  std::vector<Half> teacher;
  for (int i = 0; i < kPixels * kDim; ++i)
    teacher.push_back(Half(i / kDim % 5 == 0 ? 0.f : static_cast<float>(CounterRng{5, 0}.normal(i))));
  DeviceArray<Half> device_teacher(teacher);
  DeviceArray<std::uint32_t> signs(kPixels * Signs::kWords);
  DeviceArray<float> loss(kPixels);
  launch(executor, (kPixels + Signs::kWarps - 1) / Signs::kWarps,
         Signs{device.view(field), device.features.data(), device_teacher.data(), signs.data(), loss.data()});
  executor.synchronize();

  std::vector<double> gradient(kGaussians * kDim, 0.);
  const std::vector<float> got_loss = loss.values();
  const std::vector<std::uint32_t> words = signs.values();
  for (int p = 0; p < kPixels; ++p) {
    const bool teaches = p % 5 != 0 && field.begin[p] < field.begin[p + 1];
    double sum = 0;
    for (int c = 0; c < kDim; ++c) {
      const double difference = field.rendered(p, c) - static_cast<double>(static_cast<float>(teacher[p * kDim + c]));
      const bool positive = ((words[p * Signs::kWords + c / 32] >> (c % 32)) & 1u) != 0;
      if (std::abs(difference) > 1e-5) CHECK(positive == (difference > 0));
      sum += std::abs(difference);
      for (int i = field.begin[p]; teaches && i < field.begin[p + 1]; ++i)
        gradient[field.gaussian[i] * kDim + c] += static_cast<double>(positive ? field.weight[i] : -field.weight[i]);
    }
    CHECK(static_cast<double>(got_loss[p]) == doctest::Approx(teaches ? sum : -1.).epsilon(1e-5));
  }

  std::vector<std::int32_t> touched, hit_begin{0}, hits, hit_pixel(field.gaussian.size());
  for (int g = 0; g < kGaussians; ++g) {
    for (int p = 0; p < kPixels; ++p)
      for (int i = field.begin[p]; i < field.begin[p + 1]; ++i)
        if (field.gaussian[i] == g) {
          hits.push_back(i);
          hit_pixel[i] = p;
        }
    hit_begin.push_back(static_cast<std::int32_t>(hits.size()));
    if (hit_begin[g + 1] > hit_begin[g]) touched.push_back(g);
  }
  const int num_touched = static_cast<int>(touched.size());
  REQUIRE(num_touched > 0);
  REQUIRE(num_touched < kGaussians);
  const DeviceArray<std::int32_t> device_touched(touched), device_hit_begin(hit_begin), device_hits(hits),
      device_hit_pixel(hit_pixel);
  DeviceArray<float> first(kGaussians * kDim + kPadding, 0), second(kGaussians * kDim + kPadding, 0);
  const double scale = 0.25, rate = 0.01;
  const AdamRule rule{0.9f, 0.99f, 1e-8f};
  launch(executor, (num_touched + Update::kWarps - 1) / Update::kWarps,
         Update{num_touched, device_touched.data(), device_hit_begin.data(), device_hits.data(),
                device_hit_pixel.data(), device.weight.data(), signs.data(), loss.data(), static_cast<float>(scale),
                static_cast<float>(rate), rule, device.features.data(), first.data(), second.data()});
  executor.synchronize();
  const std::vector<float> features = device.features.values(), moment = first.values();
  for (int i = 0; i < kGaussians * kDim; ++i) {
    const double g = scale * gradient[i];
    CHECK(static_cast<double>(moment[i]) == doctest::Approx(0.1 * g).epsilon(1e-4));
    if (g != 0 && std::abs(g) < 1e-4) continue;  // the quotient amplifies rounding
    const double step = g == 0 ? 0 : 0.1 * g / (std::sqrt(0.01 * g * g) + 1e-8);
    CHECK(std::abs(static_cast<double>(features[i]) - (static_cast<double>(field.features[i]) - rate * step)) < 1e-5);
  }
  // The padding belongs to nobody.
  for (int i = kGaussians * kDim; i < kGaussians * kDim + kPadding; ++i) CHECK(features[i] == field.features[i]);
}

}  // namespace
}  // namespace langgs
