// SPDX-License-Identifier: Apache-2.0
#include "langgs/core/image.hpp"

#include <doctest/doctest.h>

#include <cstdint>
#include <set>

using langgs::Image;

TEST_CASE("a default image is empty") {
  const Image<float> image;
  CHECK(image.empty());
  CHECK(image.size() == 0);
  CHECK(image.width() == 0);
  CHECK(image.height() == 0);
}

TEST_CASE("elements are row-major and interleaved") {
  Image<int> image(5, 3, 2, -1);
  CHECK(image.size() == 30);
  CHECK(image(4, 2, 1) == -1);
  std::set<int*> addresses;
  for (int y = 0; y < 3; ++y)
    for (int x = 0; x < 5; ++x)
      for (int c = 0; c < 2; ++c) {
        CHECK(&image(x, y, c) == image.data() + (y * 5 + x) * 2 + c);
        addresses.insert(&image(x, y, c));
      }
  CHECK(addresses.size() == 30);
}

TEST_CASE("images compare by shape and content") {
  const Image<std::uint8_t> wide(6, 2), tall(2, 6);
  CHECK(wide.size() == tall.size());
  CHECK(wide != tall);
  Image<std::uint8_t> copy = wide;
  CHECK(copy == wide);
  copy(5, 1) = 1;
  CHECK(copy != wide);
}

TEST_CASE("a side may be zero, never negative, and there is at least one channel") {
  CHECK(Image<float>(0, 10).empty());
  CHECK_THROWS_AS(Image<float>(-1, 10), langgs::InvalidArgument);
  CHECK_THROWS_AS(Image<float>(10, -1), langgs::InvalidArgument);
  CHECK_THROWS_WITH_AS(Image<float>(10, 20, 0), doctest::Contains("[20, 10, 0]"), langgs::InvalidArgument);
}
