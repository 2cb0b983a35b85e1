// SPDX-License-Identifier: Apache-2.0
// The small CUDA runtime: streams, events, memory, errors and graphs.
#include <doctest/doctest.h>

#include <memory>
#include <type_traits>
#include <utility>
#include <vector>

#include "cuda/counted_memory.hpp"
#include "cuda/device_array.hpp"
#include "langgs/cuda/graph.hpp"
#include "langgs/cuda/profile_range.hpp"
#include "langgs/device/copy.hpp"
#include "langgs/device/launch.hpp"
#include "langgs/device/replay.hpp"

namespace langgs {
namespace {

using test::CountedMemory;
using test::DeviceArray;

template <class T>
constexpr bool kMoveOnly =
    std::is_nothrow_move_constructible_v<T>&& std::is_nothrow_move_assignable_v<T> && !std::is_copy_constructible_v<T>;
static_assert(kMoveOnly<gpu::Stream> && kMoveOnly<gpu::Event> && kMoveOnly<gpu::Graph>);
static_assert(kMoveOnly<gpu::PinnedBuffer<int>> && kMoveOnly<Readback<int, Cuda>>);

struct AddOne {
  int* values;
  LANGGS_HD void operator()(int i) const { values[i] += 1; }
};

TEST_CASE("Events order two streams, and the host waits for them") {
  const Executor<Cuda> first{gpu::Stream{}};
  gpu::Stream second_stream;
  const Executor<Cuda> second(second_stream.get());
  DeviceArray<int> values(std::vector<int>(1000, 5));
  gpu::Event first_done, all_done;
  for_each_n(first, 1000, AddOne{values.data()});
  first_done.record(first.stream());
  second_stream.wait(first_done);
  for_each_n(second, 1000, AddOne{values.data()});
  all_done.record(second.stream());
  gpu::PinnedBuffer<int> got(1000);
  all_done.synchronize();
  CHECK(all_done.is_done());
  detail::check_cuda(cudaMemcpyAsync(got.data(), values.data(), 4000, cudaMemcpyDeviceToHost, second.stream()), "copy");
  second_stream.synchronize();
  for (int i = 0; i < 1000; ++i) REQUIRE(got.data()[i] == 7);
  const int* const memory = got.data();
  got.resize_discard(10);
  CHECK(got.data() == memory);
  gpu::PinnedBuffer<int> moved(std::move(got));
  CHECK(moved.data() == memory);
  CHECK(got.size() == 0);
  got.resize_discard(5);
  CHECK(got.data() != memory);
}

TEST_CASE("A Readback keeps the values of its time, and may be moved while they are under way") {
  const Executor<Cuda> executor{gpu::Stream{}};
  DeviceArray<int> values(std::vector<int>(300, 1));
  Readback<int, Cuda> before;
  before.start(executor, values.data(), 300);
  for_each_n(executor, 300, AddOne{values.data()});
  Readback<int, Cuda> moved(std::move(before)), after;
  after.start(executor, values.data(), 200);
  CHECK(moved.values()[299] == 1);
  CHECK(after.values()[199] == 2);
  CHECK(after.size() == 200);
  CHECK(before.size() == 0);
  before.start(executor, values.data(), 300);
  CHECK(before.values()[299] == 2);
}

TEST_CASE("The workspace grows to the largest request, from memory that a user may bring") {
  const auto memory = std::make_shared<CountedMemory>();
  {
    const Executor<Cuda> executor(nullptr, memory);
    CHECK(memory->allocations == 0);
    void* const large = executor.workspace(1000);
    CHECK(executor.workspace(10) == large);
    const Executor<Cuda> copy = executor;
    CHECK(copy.workspace(1000) == large);
    CHECK(memory->allocations == 1);
    CHECK(executor.workspace(1001) != nullptr);
    CHECK(memory->allocations == 2);
    CHECK(memory->live >= 1001);
  }
  CHECK(memory->live == 0);
}

TEST_CASE("A graph repeats what it captured, and what is thrown meanwhile ends the capture") {
  const gpu::ProfileRange range("graph test");
  const Executor<Cuda> executor{gpu::Stream{}};
  DeviceArray<int> values(std::vector<int>(300, 0));
  const gpu::Graph graph(executor, [&] {
    for_each_n(executor, 300, AddOne{values.data()});
    for_each_n(executor, 200, AddOne{values.data()});
  });
  executor.synchronize();
  CHECK(values.values()[0] == 0);
  for (int i = 0; i < 3; ++i) graph.launch(executor);
  executor.synchronize();
  CHECK(values.values()[0] == 6);
  CHECK(values.values()[299] == 3);

  CHECK_THROWS_AS(gpu::Graph(executor, [] { throw InvalidArgument("mine"); }), InvalidArgument);
  for_each_n(executor, 300, AddOne{values.data()});
  executor.synchronize();
  CHECK(values.values()[299] == 4);
  CHECK_THROWS_WITH_AS(gpu::Graph(Executor<Cuda>(), [] {}), doctest::Contains("capture"), DeviceError);
}

TEST_CASE("Work that is replayed is done once, captured once and then launched, until its arguments change") {
  Executor<Cuda> executor{gpu::Stream{}};
  DeviceArray<int> values(std::vector<int>(300, 0));
  Replay<int, Cuda> replay;
  int calls = 0;
  const auto add = [&](int n) {
    replay(executor, n, [&] {
      ++calls;
      (void)executor.workspace(static_cast<std::size_t>(n));
      for_each_n(executor, n, AddOne{values.data()});
    });
  };
  for (int i = 0; i < 4; ++i) add(300);
  CHECK(calls == 2);
  for (int i = 0; i < 3; ++i) add(100);
  CHECK(calls == 4);
  (void)executor.workspace(1 << 20);  // what the graph knows has moved
  for (int i = 0; i < 3; ++i) add(100);
  CHECK(calls == 6);
  executor.set_launch_checks(LaunchChecks::after_each_launch);  // waits, which a capture must not
  add(100);
  CHECK(calls == 7);
  executor.synchronize();
  CHECK(values.values()[99] == 11);
  CHECK(values.values()[299] == 4);

  const Executor<Cuda> of_default_stream;
  for (int i = 0; i < 3; ++i) replay(of_default_stream, 1, [&] { ++calls; });
  CHECK(calls == 10);
}

TEST_CASE("Errors name the call, the error and the remedy") {
  CHECK_THROWS_WITH_AS(detail::check_cuda(cudaErrorInvalidConfiguration, "launch of X with ", 3, " blocks"),
                       doctest::Contains("launch of X with 3 blocks: cudaErrorInvalidConfiguration"), DeviceError);
  CHECK_THROWS_WITH_AS(detail::check_cuda(cudaErrorMemoryAllocation, "X"), doctest::Contains("free device memory"),
                       DeviceError);
  const Executor<Cuda> executor;
  DeviceArray<int> values(std::vector<int>(300, 0));
  CHECK_THROWS_WITH_AS(
      detail::launch_cuda<AddOne>(executor, &detail::run_elements<AddOne>, 3, 2048, AddOne{values.data()}, 300),
      doctest::Contains("AddOne with 3 blocks of 2048 threads"), DeviceError);
  CHECK_THROWS_WITH_AS(static_cast<void>(executor.workspace(std::size_t{1} << 60)),
                       doctest::Contains("bytes of device memory"), DeviceError);
  // Neither is reported again.
  for_each_n(executor, 300, AddOne{values.data()});
  CHECK_NOTHROW(executor.synchronize());

  Executor<Cuda> checked;
  checked.set_launch_checks(LaunchChecks::after_each_launch);
  CHECK_NOTHROW(for_each_n(checked, 300, AddOne{values.data()}));
  CHECK(values.values()[7] == 2);
}

}  // namespace
}  // namespace langgs
