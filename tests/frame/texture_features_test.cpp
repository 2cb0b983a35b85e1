// SPDX-License-Identifier: Apache-2.0
#include "langgs/frame/texture_features.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "langgs/frame/synthetic_room.hpp"

using namespace langgs;

namespace {

constexpr int kDim = 64;

double dot(const std::vector<float>& a, const std::vector<float>& b) {
  double sum = 0;
  for (int c = 0; c < kDim; ++c) sum += static_cast<double>(a[c]) * b[c];
  return sum;
}

}  // namespace

TEST_CASE("texture features follow surfaces between views and tell surfaces apart") {
  const SyntheticRoom room;
  const Camera camera = room.camera();
  const RgbdFrame a = room.frame(20), b = room.frame(25);
  const Image<std::uint16_t> labels = room.labels(20);
  const TextureFeatures<kDim> features;
  const FeatureMap<kDim> map_a = features(a), map_b = features(b);
  const Pose T_b_a = b.T_world_camera->inverse() * *a.T_world_camera;

  std::vector<double> same, other;
  std::vector<float> fa(kDim), fb(kDim), fo(kDim);
  for (int y = 16; y < 224; y += 4) {
    for (int x = 16; x < 304; x += 4) {
      const Eigen::Vector3d p = T_b_a * camera.back_project(x, y, a.depth(x, y));
      const Eigen::Vector2d uv = camera.project(p);
      if (uv.x() < 16 || uv.y() < 16 || uv.x() > 303 || uv.y() > 223) continue;
      const float z = b.depth(static_cast<int>(std::lround(uv.x())), static_cast<int>(std::lround(uv.y())));
      if (std::abs(z - p.z()) > 0.02) continue;
      map_a.sample(x, y, camera, fa.data());
      map_b.sample(uv.x(), uv.y(), camera, fb.data());
      same.push_back(dot(fa, fb));
      const CounterRng rng{5, static_cast<std::uint64_t>(y * 320 + x)};
      const int ox = 16 + static_cast<int>(rng.below(0, 288)), oy = 16 + static_cast<int>(rng.below(1, 208));
      if (labels(ox, oy) == labels(x, y)) continue;
      map_a.sample(ox, oy, camera, fo.data());
      other.push_back(dot(fa, fo));
    }
  }
  REQUIRE(same.size() > 1500);
  REQUIRE(other.size() > 800);
  std::sort(same.begin(), same.end());
  std::sort(other.begin(), other.end());
  MESSAGE("cosine of the same surface: 10 % below ", same[same.size() / 10], ", median ", same[same.size() / 2],
          "; of other surfaces: median ", other[other.size() / 2], ", 10 % above ", other[other.size() * 9 / 10]);
  CHECK(same[same.size() / 2] > 0.95);
  CHECK(same[same.size() / 10] > 0.85);
  CHECK(other[other.size() / 2] < 0.7);
}

TEST_CASE("texture features have unit length, any size of image, and the same bits for any number of threads") {
  for (const int side : {1, 5, 8, 33}) {
    RgbdFrame frame;
    frame.colour = Image<std::uint8_t>(side, side + 3, 3);
    for (std::size_t i = 0; i < frame.colour.size(); ++i) {
      frame.colour.data()[i] = static_cast<std::uint8_t>(CounterRng{1, 2}.below(i, 256));
    }
    WorkerPool pool(3);
    const auto map = TextureFeatures<16>({.stride = 4})(frame);
    const auto again = TextureFeatures<16>({.stride = 4}, &pool)(frame);
    REQUIRE(map.width() == (side + 3) / 4);
    REQUIRE(map.height() == (side + 6) / 4);
    for (int y = 0; y < map.height(); ++y) {
      for (int x = 0; x < map.width(); ++x) {
        double norm2 = 0;
        for (int c = 0; c < 16; ++c) norm2 += std::pow(float(map.pixel(x, y)[c]), 2);
        CHECK(norm2 == doctest::Approx(1).epsilon(5e-3));
        CHECK(std::equal(map.pixel(x, y), map.pixel(x, y) + 16, again.pixel(x, y)));
      }
    }
  }
}

TEST_CASE("a flat image gives one feature everywhere, and colours differ") {
  RgbdFrame red, green;
  red.colour = green.colour = Image<std::uint8_t>(64, 48, 3, 40);
  for (std::size_t i = 0; i < red.colour.size(); i += 3) red.colour.data()[i] = green.colour.data()[i + 1] = 200;
  const TextureFeatures<64> features;
  const auto a = features(red), b = features(green);
  double across = 0;
  for (int c = 0; c < 64; ++c) {
    CHECK(float(a.pixel(0, 0)[c]) == doctest::Approx(float(a.pixel(5, 3)[c])).epsilon(1e-3));
    across += float(a.pixel(2, 2)[c]) * float(b.pixel(2, 2)[c]);
  }
  CHECK(across < 0.7);
}

TEST_CASE("frames without usable colour") {
  RgbdFrame frame;
  CHECK(TextureFeatures<8>()(frame).empty());
  frame.colour = Image<std::uint8_t>(16, 16, 1);
  CHECK_THROWS_AS((void)TextureFeatures<8>()(frame), InvalidArgument);
  CHECK_THROWS_AS(TextureFeatures<8>({.stride = 0}), InvalidArgument);
}
