// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <algorithm>
#include <cstdint>
#include <memory>
#include <type_traits>
#include <utility>
#include <vector>

#include "langgs/device/buffer.hpp"
#include "langgs/device/copy.hpp"

namespace langgs {
namespace {

using FloatBuffer = Buffer<float, Cuda>;
static_assert(!std::is_copy_constructible_v<FloatBuffer> && !std::is_copy_assignable_v<FloatBuffer>);
static_assert(std::is_nothrow_move_constructible_v<FloatBuffer> && std::is_nothrow_move_assignable_v<FloatBuffer>);

std::vector<float> values(const Executor<Cuda>& executor, const FloatBuffer& buffer) {
  std::vector<float> result(buffer.size());
  copy_to_host(executor, buffer.data(), result.size(), result.data());
  return result;
}

TEST_CASE("A Buffer on CUDA moves, grows and keeps as on the host") {
  const Executor<Cuda> executor{gpu::Stream()};
  FloatBuffer buffer;
  CHECK(buffer.size() == 0);
  buffer.fill(executor, 1.f);
  std::size_t filled = 0;
  for (const std::size_t size : {1u, 3u, 100u, 50u, 60u, 1000u, 0u, 7u}) {
    const std::size_t common = std::min(filled, size);
    buffer.resize_keep(executor, size);
    REQUIRE(buffer.size() == size);
    const std::vector<float> kept = values(executor, buffer);
    std::vector<float> fresh(size);
    for (std::size_t i = 0; i < common; ++i) REQUIRE(kept[i] == static_cast<float>(i));
    for (std::size_t i = 0; i < size; ++i) fresh[i] = static_cast<float>(i);
    copy_from_host(executor, fresh.data(), size, buffer.data());
    filled = size;
  }
  buffer.resize_discard(executor, 1000);
  const float* const memory = buffer.data();
  CHECK(reinterpret_cast<std::uintptr_t>(memory) % 256 == 0);
  for (const std::size_t size : {10u, 1000u, 0u, 999u}) {
    buffer.resize_discard(executor, size);
    CHECK(buffer.data() == memory);
  }
  FloatBuffer other(executor, 5);
  other = std::move(buffer);
  other.fill(executor, 3.f);
  CHECK(other.data() == memory);
  CHECK(values(executor, other) == std::vector<float>(999, 3.f));
  CHECK_THROWS_AS(other.resize_discard(executor, std::size_t{1} << 60), InvalidArgument);
  CHECK_THROWS_AS(other.resize_discard(executor, std::size_t{1} << 43), DeviceError);
  CHECK(other.size() == 999);
  CHECK(values(executor, other)[998] == 3.f);
}

TEST_CASE("A Buffer on CUDA outlives the executor that it was made on") {
  FloatBuffer buffer;
  {
    const Executor<Cuda> executor{gpu::Stream()};
    buffer.resize_discard(executor, 10);
    buffer.fill(executor, 2.f);
    executor.synchronize();
  }
  const Executor<Cuda> later;
  CHECK(values(later, buffer) == std::vector<float>(10, 2.f));
}

}  // namespace
}  // namespace langgs
