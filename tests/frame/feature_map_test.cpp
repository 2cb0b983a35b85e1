// SPDX-License-Identifier: Apache-2.0
#include "langgs/frame/feature_map.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "langgs/core/rng.hpp"

namespace {

using langgs::Camera, langgs::FeatureMap;

constexpr Camera image_of(int width, int height) { return {100, 100, 0, 0, width, height}; }

template <int D>
std::vector<float> random_feature(std::uint64_t stream) {
  const langgs::CounterRng rng{17, stream};
  std::vector<float> feature(D);
  for (int c = 0; c < D; ++c)
    feature[static_cast<std::size_t>(c)] = static_cast<float>(rng.normal(static_cast<std::uint64_t>(c)));
  return feature;
}

template <int D>
double norm_of(const std::vector<float>& f) {
  double sum = 0;
  for (int c = 0; c < D; ++c)
    sum += static_cast<double>(f[static_cast<std::size_t>(c)]) * f[static_cast<std::size_t>(c)];
  return std::sqrt(sum);
}

template <int D>
FeatureMap<D> random_map(int width, int height) {
  FeatureMap<D> map(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      map.set_pixel(x, y, random_feature<D>(static_cast<std::uint64_t>(y * width + x)).data());
  return map;
}

/// Bilinear interpolation in double with border clamping, as a weighted sum over the whole map.
template <int D>
std::vector<double> reference_sample(const FeatureMap<D>& map, double u, double v, const Camera& image) {
  const double x = std::clamp((u + 0.5) / image.width * map.width() - 0.5, 0.0, map.width() - 1.0);
  const double y = std::clamp((v + 0.5) / image.height * map.height() - 0.5, 0.0, map.height() - 1.0);
  std::vector<double> sum(D, 0.0);
  for (int j = 0; j < map.height(); ++j)
    for (int i = 0; i < map.width(); ++i) {
      const double weight = std::max(0.0, 1 - std::abs(x - i)) * std::max(0.0, 1 - std::abs(y - j));
      for (int c = 0; c < D; ++c) sum[static_cast<std::size_t>(c)] += weight * static_cast<float>(map.pixel(i, j)[c]);
    }
  double norm2 = 0;
  for (const double value : sum) norm2 += value * value;
  for (double& value : sum) value = norm2 > 0 ? value / std::sqrt(norm2) : 0;
  return sum;
}

template <int D>
double worst_difference(const FeatureMap<D>& map, double u, double v, const Camera& image) {
  std::vector<float> sampled(D, -9.f);
  map.sample(u, v, image, sampled.data());
  const std::vector<double> expected = reference_sample(map, u, v, image);
  double worst = 0;
  for (std::size_t c = 0; c < D; ++c) worst = std::max(worst, std::abs(sampled[c] - expected[c]));
  return worst;
}

}  // namespace

TEST_CASE_TEMPLATE("stored features are unit vectors in the direction given", Dim, std::integral_constant<int, 1>,
                   std::integral_constant<int, 3>, std::integral_constant<int, 100>, std::integral_constant<int, 512>,
                   std::integral_constant<int, 1152>, std::integral_constant<int, 4096>) {
  constexpr int D = Dim::value;
  FeatureMap<D> map(3, 2);
  CHECK(map.bytes() == 3 * 2 * (D * 2 + 1));
  const std::vector<float> feature = random_feature<D>(1);
  map.set_pixel(2, 1, feature.data());
  double norm2 = 0, dot = 0;
  for (int c = 0; c < D; ++c) {
    const double stored = static_cast<float>(map.pixel(2, 1)[c]);
    norm2 += stored * stored;
    dot += stored * feature[static_cast<std::size_t>(c)];
    CHECK_MESSAGE(map.pixel(1, 1)[c].bits == 0, "the neighbour must stay untouched");
  }
  CHECK(std::sqrt(norm2) == doctest::Approx(1).epsilon(2e-3));
  CHECK(dot / norm_of<D>(feature) == doctest::Approx(1).epsilon(2e-3));
}

TEST_CASE("a feature that is zero or not finite is stored as zeros") {
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  for (const std::array<float, 3>& bad :
       {std::array{0.f, 0.f, 0.f}, {1.f, nan, 0.f}, {inf, 0.f, 0.f}, {-inf, inf, nan}, {-0.f, 0.f, -0.f}}) {
    FeatureMap<3> map(1, 1);
    const std::array<float, 3> good{1, 2, 3};
    map.set_pixel(0, 0, good.data());
    map.set_pixel(0, 0, bad.data());
    for (int c = 0; c < 3; ++c) CHECK(static_cast<float>(map.pixel(0, 0)[c]) == 0);
  }
}

TEST_CASE("huge and tiny features keep their direction") {
  for (const float size : {3e38f, 1e30f, 1e-18f, 1e-30f, 1e-40f}) {
    CAPTURE(size);
    FeatureMap<2> map(1, 1);
    const std::array<float, 2> feature{size, -size};
    map.set_pixel(0, 0, feature.data());
    CHECK(static_cast<float>(map.pixel(0, 0)[0]) == doctest::Approx(std::sqrt(0.5)).epsilon(1e-3));
    CHECK(static_cast<float>(map.pixel(0, 0)[1]) == doctest::Approx(-std::sqrt(0.5)).epsilon(1e-3));
  }
}

TEST_CASE("sampling agrees with a bilinear reference in double, at any relative size and beyond the borders") {
  const FeatureMap<16> map = random_map<16>(7, 5);
  for (const Camera& image : {image_of(7, 5), image_of(64, 48), image_of(3, 2), image_of(1, 1)}) {
    for (double v = -3; v < image.height + 3; v += 0.37)
      for (double u = -3; u < image.width + 3; u += 0.73) {
        CAPTURE(u);
        CAPTURE(v);
        REQUIRE(worst_difference(map, u, v, image) < 1e-5);
      }
  }
}

TEST_CASE("with equal sizes an integer pixel gives that pixel's feature") {
  const FeatureMap<8> map = random_map<8>(6, 4);
  std::vector<float> sampled(8);
  for (int y = 0; y < 4; ++y)
    for (int x = 0; x < 6; ++x) {
      map.sample(x, y, image_of(6, 4), sampled.data());
      for (int c = 0; c < 8; ++c)
        CHECK(sampled[static_cast<std::size_t>(c)] ==
              doctest::Approx(static_cast<float>(map.pixel(x, y)[c])).epsilon(2e-3));
    }
}

TEST_CASE("sampled features are unit vectors, or zeros where no neighbour has one") {
  FeatureMap<4> map(4, 1);
  const std::array<float, 4> feature{1, 1, 1, 1};
  map.set_pixel(0, 0, feature.data());
  const Camera image = image_of(4, 1);
  std::vector<float> sampled(4);
  map.sample(0.75, 0, image, sampled.data());  // a quarter of a feature and three quarters of nothing
  CHECK(norm_of<4>(sampled) == doctest::Approx(1).epsilon(1e-5));
  map.sample(2.5, 0, image, sampled.data());
  CHECK(norm_of<4>(sampled) == 0);
}

TEST_CASE("opposite neighbours cancel to zeros and not to NaN") {
  FeatureMap<2> map(2, 1);
  const std::array<float, 2> plus{1, 0}, minus{-1, 0};
  map.set_pixel(0, 0, plus.data());
  map.set_pixel(1, 0, minus.data());
  std::vector<float> sampled(2, 5.f);
  map.sample(0.5, 0, image_of(2, 1), sampled.data());
  CHECK(sampled[0] == 0);
  CHECK(sampled[1] == 0);
}

TEST_CASE("a map of one pixel answers everywhere") {
  const FeatureMap<5> map = random_map<5>(1, 1);
  CHECK(worst_difference(map, 300, -20, image_of(640, 480)) < 1e-5);
}

TEST_CASE("a default map is empty; sides must be positive") {
  CHECK(FeatureMap<512>().empty());
  CHECK(FeatureMap<512>().bytes() == 0);
  CHECK_THROWS_AS(FeatureMap<8>(0, 4), langgs::InvalidArgument);
  CHECK_THROWS_WITH_AS(FeatureMap<8>(4, -1), doctest::Contains("4x-1"), langgs::InvalidArgument);
}

TEST_CASE("NoFeatures is a feature source") {
  static_assert(langgs::FeatureSource<langgs::NoFeatures, 1>);
  static_assert(!langgs::FeatureSource<langgs::NoFeatures, 2>);
  CHECK(langgs::NoFeatures{}(langgs::RgbdFrame{}).empty());
}
