// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cstring>
#include <string>
#include <vector>

#include "langgs/core/rng.hpp"
#include "langgs/device/buffer.hpp"
#include "langgs/device/launch.hpp"

using namespace langgs;

namespace {

/// Which mistake a kernel makes.
enum class Mistake { none, no_sync, two_writers, past_the_end, before_the_begin, sync_in_phase, nested_phase };

/// Each block reverses its 64 numbers in shared memory and adds each warp's sum.
struct Reverse {
  static constexpr int kThreads = 64;
  template <class Block>
  struct Shared {
    typename Block::template SharedArray<float, kThreads> values;
    typename Block::template SharedArray<float, Block::kWarps> sums;
  };
  const float* in;
  float* out;
  Mistake mistake = Mistake::none;

  template <class Block>
  void operator()(Block& block, Shared<Block>& shared) const {
    typename Block::template PerThread<float> mine;
    const float* const values = in + block.index() * kThreads;
    block.threads([&](auto t) {
      mine[t] = 0.25f * values[t.index];
      shared.values.set(mistake == Mistake::two_writers ? 0 : t.index, values[t.index]);
      if (mistake == Mistake::sync_in_phase) block.sync();
      if (mistake == Mistake::nested_phase) block.threads([](auto) {});
    });
    if (mistake != Mistake::no_sync) block.sync();
    block.warps([&](const auto& warp) {
      const auto sum = warp.sum(shared.values.load(warp.index() * 32, warp) + mine.load(warp));
      shared.sums.set(warp.index(), sum);
    });
    block.sync();
    block.threads([&](auto t) {
      int from = kThreads - 1 - t.index;
      if (mistake == Mistake::past_the_end) ++from;
      if (mistake == Mistake::before_the_begin) --from;
      out[block.index() * kThreads + t.index] = shared.values[from] + shared.sums[0] + shared.sums[1];
    });
  }
};

constexpr int kBlocks = 37, kSize = kBlocks * Reverse::kThreads;

template <class Backend>
std::vector<float> run(const Executor<Backend>& executor, Mistake mistake = Mistake::none) {
  const CounterRng rng{3};
  std::vector<float> in(kSize), out(kSize, -1.f);
  for (int i = 0; i < kSize; ++i) in[i] = static_cast<float>(rng.normal(i));
  launch(executor, kBlocks, Reverse{in.data(), out.data(), mistake});
  return out;
}

bool same_bits(const std::vector<float>& a, const std::vector<float>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(float)) == 0;
}

Executor<CheckedHost> checked(int threads, ExecutionOrder order, std::uint64_t seed = 0) {
  Executor<CheckedHost> executor(threads);
  executor.order = order;
  executor.seed = seed;
  return executor;
}

constexpr ExecutionOrder kOrders[] = {ExecutionOrder::ascending, ExecutionOrder::descending, ExecutionOrder::shuffled};

std::string error_of(Mistake mistake, ExecutionOrder order) {
  try {
    run(checked(1, order), mistake);
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

bool contains(const std::string& text, const char* part) { return text.find(part) != std::string::npos; }

}  // namespace

TEST_CASE("blocks: the same bits for any number of threads, any order, checked or not") {
  const std::vector<float> expected = run(Executor<Host>(1));
  for (const float value : expected) REQUIRE(value != -1.f);
  for (const int threads : {1, 2, 5}) {
    CHECK(same_bits(run(Executor<Host>(threads)), expected));
    for (const ExecutionOrder order : kOrders)
      for (const std::uint64_t seed : {0, 1, 99}) CHECK(same_bits(run(checked(threads, order, seed)), expected));
  }
}

TEST_CASE("checked blocks: mistakes that would race or deadlock on a GPU are errors in every order") {
  for (const ExecutionOrder order : kOrders) {
    CHECK(contains(error_of(Mistake::no_sync, order), "missing sync"));
    CHECK(contains(error_of(Mistake::two_writers, order), "missing sync"));
    CHECK(contains(error_of(Mistake::past_the_end, order), "outside a SharedArray of 64"));
    CHECK(contains(error_of(Mistake::before_the_begin, order), "outside a SharedArray of 64"));
    CHECK(contains(error_of(Mistake::sync_in_phase, order), "sync() inside a phase"));
    CHECK(contains(error_of(Mistake::nested_phase, order), "phase inside a phase"));
    CHECK(error_of(Mistake::none, order) == "no error");
  }
}

TEST_CASE("launch: an exception in a kernel reaches the caller, and the executor lives on") {
  for (const int threads : {1, 2, 5}) {
    const Executor<CheckedHost> executor = checked(threads, ExecutionOrder::shuffled);
    CHECK_THROWS_AS(run(executor, Mistake::no_sync), Error);
    CHECK(same_bits(run(executor), run(Executor<Host>(1))));
  }
}

TEST_CASE("launch: no blocks, no calls") {
  launch(Executor<Host>(2), 0, Reverse{nullptr, nullptr});
  for_each_n(Executor<Host>(2), 0, [](int) { FAIL("called"); });
  for_each_lanes(Executor<Host>(2), 0, [](const auto&) { FAIL("called"); });
}

TEST_CASE("permutations visit every index once") {
  for (const ExecutionOrder order : kOrders)
    for (const int n : {1, 2, 3, 8, 30, 97, 1024})
      for (const std::uint64_t seed : {0, 5, 77}) {
        const host::Permutation permutation{order, seed};
        std::vector<int> visits(n);
        for (int i = 0; i < n; ++i) ++visits.at(permutation(i, n));
        for (const int v : visits) REQUIRE(v == 1);
      }
}

namespace {

/// Each block offers its items, of which some concern no warp, to warps, and totals what the lanes add.
struct TotalItems {
  static constexpr int kThreads = 128, kItems = 40;
  template <class Block>
  struct Shared {
    typename Block::template SharedArray<WarpRange, kItems> warps;
    typename Block::template ItemTotals<2, kItems> sums;
    typename Block::template ItemTotals<1, kItems> largest;
  };
  float* out;  ///< [blocks, kItems, 3]
  bool forgets_sync = false;

  template <class Block>
  void operator()(Block& block, Shared<Block>& shared) const {
    using F = VaryingOf<float, Block>;
    block.threads(kItems, [&](auto t) { shared.warps.set(t.index, {t.index % 5, 4 - t.index % 3 - 1}); });
    if (!forgets_sync) block.sync();
    block.for_each_item(
        kItems, [&](int j) { return shared.warps[j]; },
        [&](const auto& item) {
          F sums[2] = {F(0.f), F(0.f)}, largest(-1.f);
          item.warps([&](const auto& warp) {
            const F v = to_float(warp.lane_index()) + static_cast<float>(100 * warp.index() + item.index());
            sums[0] += v;
            sums[1] += F(1.f);
            largest = max(largest, v);
          });
          shared.sums.put_sums(item, sums);
          shared.largest.put_max(item, largest);
        });
    block.sync();
    block.threads(kItems, [&](auto t) {
      float* const row = out + (block.index() * kItems + t.index) * 3;
      const WarpRange warps = shared.warps[t.index];
      alignas(64) float line[16];
      shared.sums.write_sums(t.index, warps, line);
      row[0] = line[0];
      row[1] = line[1];
      if (warps.last < warps.first) return;
      row[2] = shared.largest.max(t.index, warps);
    });
  }
};

template <class Backend>
std::vector<float> item_totals(const Executor<Backend>& executor, bool forgets_sync = false) {
  std::vector<float> out(3 * TotalItems::kItems * 3, -7.f);
  launch(executor, 3, TotalItems{out.data(), forgets_sync});
  return out;
}

}  // namespace

TEST_CASE("items: each meets the warps of its range, and totals cover them all") {
  const std::vector<float> got = item_totals(Executor<Host>(1));
  for (int i = 0; i < 3 * TotalItems::kItems; ++i) {
    const int j = i % TotalItems::kItems, first = j % 5, last = 3 - j % 3;
    CAPTURE(j);
    float sum = 0;
    for (int w = first; w <= last; ++w)
      for (int lane = 0; lane < 32; ++lane) sum += static_cast<float>(lane + 100 * w + j);
    const bool any = last >= first;
    CHECK(got[3 * i] == (any ? sum : 0.f));
    CHECK(got[3 * i + 1] == (any ? 32.f * static_cast<float>(last - first + 1) : 0.f));
    CHECK(got[3 * i + 2] == (any ? static_cast<float>(31 + 100 * last + j) : -7.f));
  }
  for (const ExecutionOrder order : kOrders) {
    CHECK(same_bits(item_totals(checked(2, order, 4)), got));
    CHECK_THROWS_WITH_AS(item_totals(checked(1, order), true), doctest::Contains("missing sync"), Error);
  }
}

TEST_CASE("warp: rectangles are read and written inside their valid part only") {
  const host::Warp<32, false> warp(0);
  std::vector<float> image(10 * 4), out(10 * 4, -1.f);
  for (int i = 0; i < 40; ++i) image[i] = static_cast<float>(i);
  const auto v = warp.load_rect<16>(image.data() + 7, 10, 3, 2, 99.f);
  for (int i = 0; i < 32; ++i) {
    const int row = i / 16, column = i % 16;
    CHECK(v.lane(i) == (column < 3 ? image[7 + row * 10 + column] : 99.f));
  }
  warp.store_rect<16>(out.data() + 7, 10, 3, 1, v);
  for (int i = 0; i < 40; ++i) CHECK(out[i] == (i >= 7 && i < 10 ? image[i] : -1.f));
}

TEST_CASE("for_each_lanes and for_each_n cover every element once, tails included") {
  for (const int n : {1, 31, 32, 33, 1023, 1024, 1025, 5000}) {
    for (const int threads : {1, 2, 5}) {
      CAPTURE(n);
      const Executor<Host> executor(threads);
      Buffer<float, Host> in(n), out(n + 64);
      for (int i = 0; i < n; ++i) in.data()[i] = static_cast<float>(i);
      out.fill(-1.f);
      for_each_lanes(executor, n, [&](const auto& lanes) {
        lanes.store(out.data(), lanes.load(in.data()) + host::to_float(lanes.index()));
      });
      for (int i = 0; i < n + 64; ++i) REQUIRE(out.data()[i] == (i < n ? 2.f * static_cast<float>(i) : -1.f));
      std::vector<int> visits(n);
      for_each_n(executor, n, [&](int i) { ++visits[i]; });
      for (const int v : visits) REQUIRE(v == 1);
    }
  }
}

TEST_CASE("lanes: gather and scatter touch the elements of the range only") {
  const host::Lanes lanes(64, 5);
  std::vector<float> memory(10, 2.f);
  memory[4] = 7;
  const Varying<std::int32_t> reversed = Varying<std::int32_t>(68) - lanes.index();  // 4 .. 0, then out of range
  const Varying<float> got = lanes.gather(memory.data(), reversed);
  CHECK(got.lane(0) == 7);
  CHECK(got.lane(5) == 0);
  lanes.scatter(memory.data(), reversed, host::to_float(lanes.index()));
  for (int i = 0; i < 10; ++i) CHECK(memory[i] == (i < 5 ? static_cast<float>(68 - i) : 2.f));
}
