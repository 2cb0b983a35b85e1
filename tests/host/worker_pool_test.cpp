// SPDX-License-Identifier: Apache-2.0
#include "langgs/host/worker_pool.hpp"

#include <doctest/doctest.h>

#include <atomic>
#include <stdexcept>
#include <vector>

using langgs::WorkerPool;

TEST_CASE("every task runs exactly once, for any number of threads and tasks") {
  for (const int threads : {1, 2, 3, 8}) {
    WorkerPool pool(threads);
    CHECK(pool.num_threads() == threads);
    for (const int tasks : {0, 1, 2, 7, 1000}) {
      std::vector<int> runs(static_cast<std::size_t>(tasks), 0);
      pool.run(tasks, [&](int i) { ++runs[static_cast<std::size_t>(i)]; });
      CHECK(runs == std::vector<int>(static_cast<std::size_t>(tasks), 1));
    }
  }
}

TEST_CASE("a negative number of tasks is none") {
  WorkerPool pool(2);
  bool ran = false;
  pool.run(-5, [&](int) { ran = true; });
  CHECK_FALSE(ran);
}

TEST_CASE("a pool needs at least one thread and a sane number of them") {
  for (const int threads : {0, -1, 1025}) CHECK_THROWS_AS(WorkerPool pool(threads), langgs::InvalidArgument);
}

TEST_CASE("what the tasks wrote is visible after run, through many short runs in a row") {
  WorkerPool pool(4);
  std::vector<long> values(5, 0);
  for (int round = 0; round < 20000; ++round) {
    // Plain memory on both sides: ThreadSanitizer sees a missing synchronisation here.
    pool.run(5, [&](int i) { values[static_cast<std::size_t>(i)] += i + round; });
    values[0] += 1;
  }
  const long rounds = 20000L * 19999 / 2;
  CHECK(values[0] == rounds + 20000);
  for (long i = 1; i < 5; ++i) CHECK(values[static_cast<std::size_t>(i)] == rounds + i * 20000);
}

TEST_CASE("the task of an earlier run is never called again") {
  WorkerPool pool(4);
  for (int round = 0; round < 3000; ++round) {
    std::vector<int> seen(3, -1);  // a new object per run: a late worker would write to freed memory
    pool.run(3, [&seen, round](int i) { seen[static_cast<std::size_t>(i)] = round; });
    REQUIRE(seen == std::vector<int>(3, round));
  }
}

TEST_CASE("an exception of a task reaches the caller, and the pool lives on") {
  for (const int threads : {1, 2, 5}) {
    WorkerPool pool(threads);
    for (int round = 0; round < 300; ++round) {
      std::atomic<int> ran{0};
      const int bad = round % 20;
      const auto task = [&](int i) {
        if (i == bad) throw std::runtime_error("task failed");
        ++ran;
      };
      CHECK_THROWS_WITH(pool.run(20, task), "task failed");
      CHECK(ran.load() < 20);
      ran = 0;
      pool.run(20, [&](int) { ++ran; });
      REQUIRE(ran.load() == 20);
    }
  }
}

TEST_CASE("if every task throws, the caller gets one exception and the others are dropped") {
  WorkerPool pool(4);
  for (int round = 0; round < 200; ++round) CHECK_THROWS_AS(pool.run(50, [](int i) { throw i; }), int);
  int calls = 0;
  pool.run(1, [&](int) { ++calls; });
  CHECK(calls == 1);
}

TEST_CASE("pools come and go, used or not") {
  for (int i = 0; i < 200; ++i) {
    WorkerPool pool(1 + i % 4);
    if (i % 3 == 0) continue;
    std::atomic<int> sum{0};
    pool.run(10, [&](int k) { sum += k; });
    REQUIRE(sum.load() == 45);
  }
}

TEST_CASE("two pools work at the same time, one inside the other") {
  WorkerPool outer(3);
  std::atomic<int> sum{0};
  outer.run(3, [&](int) {
    WorkerPool inner(2);
    inner.run(100, [&](int) { ++sum; });
  });
  CHECK(sum.load() == 300);
}

TEST_CASE("a task may be a const callable or a temporary") {
  WorkerPool pool(2);
  std::atomic<int> calls{0};
  const auto task = [&calls](int) { ++calls; };
  pool.run(4, task);
  pool.run(4, [&calls](int) mutable { ++calls; });
  CHECK(calls.load() == 8);
}
