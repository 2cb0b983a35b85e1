// SPDX-License-Identifier: Apache-2.0
#include "langgs/frame/label_features.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <vector>

using namespace langgs;

namespace {

/// Left half label 1, right half label 2.
Image<std::uint16_t> two_halves(int width, int height) {
  Image<std::uint16_t> labels(width, height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) labels(x, y) = x < width / 2 ? 1 : 2;
  }
  return labels;
}

const std::vector<float> kThree{0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 2, 0};  // nothing, e0, 2 e2

template <int D>
double norm(const FeatureMap<D>& map, int x, int y) {
  double sum = 0;
  for (int c = 0; c < D; ++c) sum += std::pow(float(map.pixel(x, y)[c]), 2);
  return std::sqrt(sum);
}

}  // namespace

TEST_CASE("features are pure inside regions and mixed at borders") {
  LabelFeatureSettings settings;
  settings.stride = 4;
  settings.blur = 4;
  const auto map = feature_map_from_labels<4>(two_halves(64, 32), kThree, settings);
  REQUIRE(map.width() == 16);
  REQUIRE(map.height() == 8);
  for (int y = 0; y < 8; ++y) {
    for (int x = 0; x < 16; ++x) CHECK(norm(map, x, y) == doctest::Approx(1).epsilon(2e-3));
    CHECK(float(map.pixel(3, y)[0]) == 1.f);
    CHECK(float(map.pixel(12, y)[2]) == 1.f);
    CHECK(float(map.pixel(6, y)[2]) == 0.f);
    // Cell 7 sees columns 24 to 35: eight of label 1, four of label 2 with a vector twice as long.
    CHECK(float(map.pixel(7, y)[0]) == doctest::Approx(std::sqrt(0.5)).epsilon(2e-3));
    CHECK(float(map.pixel(7, y)[2]) == doctest::Approx(std::sqrt(0.5)).epsilon(2e-3));
  }
}

TEST_CASE("labels without a vector contribute nothing") {
  Image<std::uint16_t> labels = two_halves(64, 8);
  for (int y = 0; y < 8; ++y) {
    for (int x = 32; x < 64; ++x) labels(x, y) = 0;
  }
  LabelFeatureSettings settings;
  settings.noise = 0.2;
  const auto map = feature_map_from_labels<4>(labels, kThree, settings);
  CHECK(norm(map, 12, 1) == 0);  // not even noise
  CHECK(norm(map, 8, 1) == doctest::Approx(1).epsilon(2e-3));
  CHECK(float(map.pixel(8, 1)[0]) > 0.8f);
}

TEST_CASE("odd sizes cover the whole image") {
  for (const int stride : {1, 3, 7, 8, 64}) {
    LabelFeatureSettings settings;
    settings.stride = stride;
    settings.blur = 0;
    const auto map = feature_map_from_labels<4>(two_halves(61, 37), kThree, settings);
    CHECK(map.width() == (61 + stride - 1) / stride);
    CHECK(map.height() == (37 + stride - 1) / stride);
    CHECK(norm(map, map.width() - 1, map.height() - 1) == doctest::Approx(1).epsilon(2e-3));
  }
}

TEST_CASE("noise has the given length, differs between pixels and repeats") {
  constexpr int kDim = 256;
  std::vector<float> vectors(2 * kDim, 0.f);
  vectors[kDim] = 1;
  const Image<std::uint16_t> labels(64, 64, 1, 1);
  LabelFeatureSettings settings;
  settings.noise = 0.5;
  const auto map = feature_map_from_labels<kDim>(labels, vectors, settings);
  double mean = 0;
  for (int y = 0; y < 16; ++y) {
    for (int x = 0; x < 16; ++x) mean += float(map.pixel(x, y)[0]) / 256.0;
  }
  CHECK(mean == doctest::Approx(1 / std::sqrt(1.25)).epsilon(0.01));  // unit vector plus noise of length one half
  CHECK_FALSE(map.pixel(0, 0)[1] == map.pixel(1, 0)[1]);
  const auto again = feature_map_from_labels<kDim>(labels, vectors, settings);
  CHECK(map.pixel(3, 5)[7] == again.pixel(3, 5)[7]);
}

TEST_CASE("as a feature source each frame has its own noise") {
  LabelFeatures<4> source{
      [](const RgbdFrame& frame) { return frame.timestamp < 5 ? two_halves(16, 16) : Image<std::uint16_t>{}; },
      kThree,
      {.stride = 4, .blur = 0, .noise = 0.3, .seed = 3}};
  RgbdFrame first, second, unlabelled;
  second.timestamp = 1;
  unlabelled.timestamp = 9;
  CHECK_FALSE(source(first).pixel(0, 0)[1] == source(second).pixel(0, 0)[1]);
  CHECK(source(first).pixel(0, 0)[1] == source(first).pixel(0, 0)[1]);
  CHECK(source(unlabelled).empty());
  CHECK_THROWS_AS((void)LabelFeatures<4>{}(first), InvalidArgument);
}

TEST_CASE("wrong input is refused") {
  const Image<std::uint16_t> labels = two_halves(16, 16);
  CHECK_THROWS_AS((void)feature_map_from_labels<4>({}, kThree), InvalidArgument);
  CHECK_THROWS_AS((void)feature_map_from_labels<5>(labels, kThree), InvalidArgument);
  CHECK_THROWS_AS((void)feature_map_from_labels<4>(labels, {}), InvalidArgument);
  CHECK_THROWS_AS((void)feature_map_from_labels<4>(labels, std::vector<float>(8)), InvalidArgument);  // no label 2
  std::vector<float> broken = kThree;
  broken[5] = std::numeric_limits<float>::quiet_NaN();
  CHECK_THROWS_AS((void)feature_map_from_labels<4>(labels, broken), InvalidArgument);
  CHECK_THROWS_AS((void)feature_map_from_labels<4>(labels, kThree, {.stride = 0}), InvalidArgument);
  CHECK_THROWS_AS((void)feature_map_from_labels<4>(labels, kThree, {.noise = NAN}), InvalidArgument);
}
