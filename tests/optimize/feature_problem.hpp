// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "langgs/core/rng.hpp"
#include "langgs/device/copy.hpp"
#include "langgs/map/gaussian_map.hpp"
#include "langgs/optimize/feature_step.hpp"

namespace langgs::test {

/// Made-up contributions of 12 Gaussians to the pixels of a small teacher. Pixel 0 has none, pixel 1 no teacher and
/// therefore none either; the last Gaussian is never seen.
template <int D, class Optimizer, class Backend = Host>
struct FeatureProblem {
  static constexpr int kWidth = 5, kHeight = 3, kPixels = kWidth * kHeight, kGaussians = 12;

  explicit FeatureProblem(std::uint64_t seed) : teacher(kWidth, kHeight) {
    const CounterRng rng{seed, 0};
    std::vector<Gaussian<D>> gaussians(kGaussians);
    for (int i = 0; i < kGaussians; ++i)
      for (int c = 0; c < D; ++c) gaussians[i].feature[c] = static_cast<float>(0.3 * rng.normal(1000 + i * D + c));
    map.append(executor, gaussians, 0, 0);

    begin.push_back(0);
    for (int p = 0; p < kPixels; ++p) {
      const int hits = p < 2 ? 0 : 1 + static_cast<int>(rng.below(p, 4));
      for (int k = 0; k < hits; ++k) {
        gaussian.push_back((3 * p + 5 * k) % (kGaussians - 1));
        contribution.push_back({p, static_cast<float>(0.1 + 0.8 * rng.uniform(500 + 8 * p + k))});
      }
      begin.push_back(static_cast<std::int32_t>(gaussian.size()));
      std::vector<float> target(D);
      for (int c = 0; c < D; ++c) target[c] = static_cast<float>(rng.normal(90000 + p * D + c));
      if (p != 1) teacher.set_pixel(p % kWidth, p / kWidth, target.data());
    }
  }
  [[nodiscard]] ContributionView view() {
    return {kWidth,
            kHeight,
            static_cast<int>(gaussian.size()),
            begin_upload(executor, begin.data(), begin.size()),
            gaussian_upload(executor, gaussian.data(), gaussian.size()),
            contribution_upload(executor, contribution.data(), contribution.size())};
  }
  /// The map's features as they are stored.
  [[nodiscard]] std::vector<double> features() const { return on_host(map.features()); }
  template <class T>
  [[nodiscard]] std::vector<double> on_host(const Rows<T, Backend>& rows) const {
    Download<T, Backend> download;
    const int n = kGaussians * rows.width();
    const T* const from = download(executor, rows.data(), n);
    std::vector<double> values;
    for (int i = 0; i < n; ++i) values.push_back(static_cast<double>(static_cast<float>(from[i])));
    return values;
  }
  [[nodiscard]] double target(int p, int c) const {
    return static_cast<double>(static_cast<float>(teacher.pixel(p % kWidth, p / kWidth)[c]));
  }
  [[nodiscard]] double rendered(const std::vector<double>& f, int p, int c) const {
    double value = 0;
    for (int i = begin[p]; i < begin[p + 1]; ++i)
      value += static_cast<double>(contribution[i].weight) * f[gaussian[i] * D + c];
    return value;
  }
  /// L_feat = mean |F - F*| over pixels and channels, with nothing where a pixel has no contributions; `least` becomes
  /// the smallest difference met.
  [[nodiscard]] double loss(const std::vector<double>& f, double* least = nullptr) const {
    double sum = 0;
    for (int p = 2; p < kPixels; ++p)
      for (int c = 0; c < D; ++c) {
        const double difference = std::abs(rendered(f, p, c) - target(p, c));
        sum += difference;
        if (least) *least = std::min(*least, difference);
      }
    return sum / (kPixels * D);
  }
  void step(const Executor<Backend>& on, const Optimizer& optimizer = {}) {
    feature_step.step(on, optimizer, map, view(), teacher);
  }

  Executor<Backend> executor;  ///< sets up and looks
  GaussianMap<D, Backend, Optimizer> map;
  FeatureMap<D> teacher;
  std::vector<std::int32_t> begin, gaussian;
  std::vector<Contribution> contribution;
  Upload<std::int32_t, Backend> begin_upload, gaussian_upload;
  Upload<Contribution, Backend> contribution_upload;
  FeatureStep<D, Optimizer, Backend> feature_step;
};

}  // namespace langgs::test
