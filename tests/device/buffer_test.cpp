// SPDX-License-Identifier: Apache-2.0
#include "langgs/device/buffer.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cstdint>
#include <type_traits>
#include <utility>

using namespace langgs;
using FloatBuffer = Buffer<float, Host>;

static_assert(!std::is_copy_constructible_v<FloatBuffer> && !std::is_copy_assignable_v<FloatBuffer>);
static_assert(std::is_nothrow_move_constructible_v<FloatBuffer> && std::is_nothrow_move_assignable_v<FloatBuffer>);

TEST_CASE("buffer: an empty one holds nothing") {
  FloatBuffer buffer;
  CHECK(buffer.size() == 0);
  CHECK(buffer.bytes() == 0);
  buffer.fill(1.f);
  buffer.resize_keep(0);
  FloatBuffer other = std::move(buffer);
  CHECK(other.size() == 0);
}

TEST_CASE("buffer: moving hands over the memory") {
  FloatBuffer a(100);
  a.fill(3.f);
  const float* const memory = a.data();
  FloatBuffer b = std::move(a);
  CHECK(b.data() == memory);
  CHECK(b.size() == 100);
  FloatBuffer c(5);
  c = std::move(b);
  CHECK(c.data() == memory);
  CHECK(c.data()[99] == 3.f);
}

TEST_CASE("buffer: resize_keep keeps the common part through growth and shrinkage") {
  FloatBuffer buffer;
  std::size_t filled = 0;
  for (const std::size_t size : {1u, 3u, 100u, 50u, 60u, 1000u, 0u, 7u}) {
    const std::size_t common = std::min(filled, size);
    buffer.resize_keep(size);
    REQUIRE(buffer.size() == size);
    for (std::size_t i = 0; i < common; ++i) REQUIRE(buffer.data()[i] == static_cast<float>(i));
    for (std::size_t i = 0; i < size; ++i) buffer.data()[i] = static_cast<float>(i);
    filled = size;
  }
}

TEST_CASE("buffer: memory is allocated for new largest sizes only, aligned, and may be read past its end") {
  FloatBuffer buffer(1000);
  const float* const memory = buffer.data();
  for (const std::size_t size : {10u, 1000u, 0u, 999u}) {
    buffer.resize_discard(size);
    CHECK(buffer.data() == memory);
  }
  for (std::size_t size = 1; size < 200; size += 7) {
    FloatBuffer other(size);
    other.fill(1.f);
    CHECK(reinterpret_cast<std::uintptr_t>(other.data()) % 64 == 0);
    // The whole padding is ours: a sanitizer build reports it if it is not.
    for (std::size_t i = size; i < size + 32; ++i) other.data()[i] = 2.f;
    CHECK(other.data()[size - 1] == 1.f);
  }
}

TEST_CASE("buffer: an absurd size is an error, and leaves the buffer as it was") {
  FloatBuffer buffer(4);
  buffer.fill(8.f);
  CHECK_THROWS_AS(buffer.resize_discard(std::size_t{1} << 60), InvalidArgument);
  CHECK_THROWS_AS(buffer.resize_keep(std::size_t{1} << 62), InvalidArgument);
  CHECK(buffer.size() == 4);
  CHECK(buffer.data()[3] == 8.f);
}
