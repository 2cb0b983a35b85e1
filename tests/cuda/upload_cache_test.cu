// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "cuda/counted_memory.hpp"
#include "langgs/device/buffer.hpp"
#include "langgs/device/copy.hpp"
#include "langgs/device/upload_cache.hpp"

namespace langgs {
namespace {

struct AddArrays {
  const std::uint8_t* first;
  const float* second;
  float* to;
  LANGGS_HD void operator()(int i) const { to[i] = static_cast<float>(first[i]) + second[i]; }
};

TEST_CASE(
    "An upload cache copies each pair once while it has room, beside the work, and evicts what was used longest ago") {
  constexpr int kValues = 1000, kKeys = 4;
  const auto memory = std::make_shared<test::CountedMemory>();
  const Executor<Cuda> executor(gpu::Stream(), memory);
  std::vector<std::uint8_t> first(kValues);
  std::vector<float> second(kValues);
  Buffer<float, Cuda> sums(executor, 20 * kValues);
  std::vector<float> expected;
  UploadCache<Cuda> cache(2 * (1024 + kValues * sizeof(float)));
  const auto fill = [&](int key) {  // the host's arrays may change as soon as a call returns
    for (int i = 0; i < kValues; ++i) {
      first[i] = static_cast<std::uint8_t>(key);
      second[i] = static_cast<float>(i);
    }
  };
  const auto use = [&](int key) {
    fill(key);
    const auto pair = cache(executor, key, std::span<const std::uint8_t>(first), std::span<const float>(second));
    for_each_n(executor, kValues, AddArrays{pair.first, pair.second, sums.data() + expected.size()});
    for (int i = 0; i < kValues; ++i) expected.push_back(static_cast<float>(key + i));
  };
  for (int key : {0, 1, 0, 1, 1, 0}) use(key);
  CHECK(cache.num_uploads() == 2);
  const int allocations = memory->allocations;
  use(2);  // instead of 1
  use(0);
  CHECK(cache.num_uploads() == 3);
  for (int key = 0; key < kKeys; ++key) use(key);  // 0 is there; 1, 2 and 3 go by turns
  CHECK(cache.num_uploads() == 6);
  fill(1);
  cache.prefetch(executor, 1, std::span<const std::uint8_t>(first), std::span<const float>(second));
  use(3);
  use(1);
  CHECK(cache.num_uploads() == 7);
  CHECK(memory->allocations == allocations);
  CHECK(cache.bytes() == 2 * (1024 + kValues * sizeof(float)));
  CHECK(executor.num_waits() == 0);
  std::vector<float> got(expected.size());
  copy_to_host(executor, sums.data(), got.size(), got.data());
  CHECK(got == expected);
}

}  // namespace
}  // namespace langgs
