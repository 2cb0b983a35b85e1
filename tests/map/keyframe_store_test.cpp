// SPDX-License-Identifier: Apache-2.0
#include "langgs/map/keyframe_store.hpp"

#include <doctest/doctest.h>

#include <cstdint>
#include <cstdlib>
#include <string>
#include <vector>

using namespace langgs;

namespace {

constexpr int kStoredDim = 8, kImageBytes = 10 * 6 * (3 + 4), kFeatureBytes = 5 * 3 * (2 * kStoredDim + 1);

Keyframe<kStoredDim> keyframe(int index, bool with_features = true) {
  Keyframe<kStoredDim> k;
  k.frame_index = index;
  k.T_world_camera.translation().x() = index;
  k.colour = Image<std::uint8_t>(10, 6, 3);
  k.depth = Image<float>(10, 6);
  if (with_features) k.features = FeatureMap<kStoredDim>(5, 3);
  return k;
}

/// What each keyframe holds: F features and images, i images alone, - its pose alone.
std::string holdings(const KeyframeStore<kStoredDim>& store) {
  std::string text;
  for (const Keyframe<kStoredDim>& k : store.all()) text += !k.has_images() ? '-' : k.features.empty() ? 'i' : 'F';
  return text;
}

}  // namespace

TEST_CASE("a keyframe store within its budget keeps everything") {
  KeyframeStore<kStoredDim> store(4 * (kImageBytes + kFeatureBytes));
  for (int i = 0; i < 4; ++i) store.add(keyframe(i));
  CHECK(holdings(store) == "FFFF");
  CHECK(store.bytes() == 4 * (kImageBytes + kFeatureBytes));
  CHECK(store.feature_bytes() == 4 * kFeatureBytes);
  CHECK(store.trainable() == std::vector<std::int32_t>{0, 1, 2, 3});
}

TEST_CASE("keyframes never visited come first, the oldest first; then any, all alike") {
  const CounterRng choice{3, 0};
  KeyframeStore<kStoredDim> store(5 * (kImageBytes + kFeatureBytes));
  for (int i = 0; i < 4; ++i) store.add(keyframe(i));
  for (int i = 0; i < 4; ++i) {
    REQUIRE(store.next(choice, 100) == i);
    ++store[i].visits;
  }
  std::vector<int> visits(4, 0);
  for (std::uint64_t iteration = 0; iteration < 4000; ++iteration) ++visits[store.next(choice, iteration)];
  for (const int v : visits) CHECK(std::abs(v - 1000) < 150);  // five standard deviations
  store.add(keyframe(4));
  CHECK(store.next(choice, 7) == 4);
}

TEST_CASE("a keyframe without images is not visited") {
  KeyframeStore<kStoredDim> store(2 * kImageBytes);
  for (int i = 0; i < 3; ++i) store.add(keyframe(i, /*with_features=*/false));
  REQUIRE(holdings(store) == "-ii");
  CHECK(store.next({3, 0}, 0) == 1);  // not the oldest that was never visited
  store[1].visits = store[2].visits = 1;
  for (std::uint64_t iteration = 0; iteration < 100; ++iteration) CHECK(store.next({3, 0}, iteration) != 0);
}

TEST_CASE("beyond the budget feature maps go first, those of the most visited keyframe, the oldest of equals") {
  KeyframeStore<kStoredDim> store(4 * (kImageBytes + kFeatureBytes));
  for (int i = 0; i < 4; ++i) store.add(keyframe(i));
  store[0].visits = 3;
  store[1].visits = 5;
  store[2].visits = 5;
  store[3].visits = 1;
  store.add(keyframe(4));  // over by images and features: three maps go
  CHECK(holdings(store) == "iiiFF");
  CHECK(store.bytes() <= 4 * (kImageBytes + kFeatureBytes));
}

TEST_CASE("images go when no feature map is left, and never the newest keyframe's") {
  KeyframeStore<kStoredDim> store(2 * kImageBytes + kFeatureBytes);
  for (int i = 0; i < 50; ++i) {
    store.add(keyframe(i));
    store[i].visits = 50 - i;
    REQUIRE(store[i].has_images());
    REQUIRE(!store[i].features.empty());
    REQUIRE(store.bytes() <= 2 * kImageBytes + kFeatureBytes);
    std::size_t bytes = 0;
    for (const Keyframe<kStoredDim>& k : store.all()) bytes += k.bytes();
    REQUIRE(store.bytes() == bytes);
    REQUIRE(store.trainable().back() == i);
    REQUIRE(store[i].T_world_camera.translation().x() == i);  // poses stay
  }
  CHECK(holdings(store) == std::string(48, '-') + "iF");
  CHECK(store.trainable() == std::vector<std::int32_t>{48, 49});
}

TEST_CASE("a budget smaller than one keyframe keeps the newest") {
  KeyframeStore<kStoredDim> store(1);
  for (int i = 0; i < 3; ++i) store.add(keyframe(i, i != 1));
  CHECK(holdings(store) == "--F");
}
