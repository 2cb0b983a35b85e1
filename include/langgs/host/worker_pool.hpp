// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <exception>
#include <mutex>
#include <thread>
#include <type_traits>
#include <utility>
#include <vector>

#include "langgs/core/error.hpp"

namespace langgs {

/// A small fixed set of threads that run numbered tasks.
///
/// Which thread runs which task is not defined, so tasks must write to disjoint places. Results then never depend on
/// the number of threads. The calling thread works too: a pool of one thread starts none. One `run` at a time.
///
/// Each thread begins with its own share of consecutive tasks, the same in every run of as many tasks, and then helps
/// the others with theirs: so it often finds in its cache what it wrote in the run before.
///
/// A loop over a few thousand elements takes less time than waking a thread. So a thread without work looks for some
/// during a moment before it sleeps, and `run` waits for the workers that have begun, not for those that still sleep.
class WorkerPool {
 public:
  explicit WorkerPool(int num_threads) : num_threads_(num_threads), shares_(num_threads > 0 ? num_threads : 0) {
    LANGGS_EXPECTS(num_threads >= 1 && num_threads <= 1024, "number of threads is ", num_threads,
                   "; it must be in [1, 1024]");
    for (int i = 1; i < num_threads; ++i) workers_.emplace_back([this, i] { work(i); });
  }
  ~WorkerPool() {
    {
      std::lock_guard lock(mutex_);
      stopping_.store(true, std::memory_order_relaxed);
    }
    wake_.notify_all();
    for (std::thread& worker : workers_) worker.join();
  }
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;

  [[nodiscard]] int num_threads() const { return num_threads_; }

  /// Calls `task(i)` once for each i in [0, num_tasks) and returns when all are done.
  /// The first exception thrown by a task is rethrown here; tasks not yet begun are then skipped.
  template <class Task>
  void run(int num_tasks, Task&& task) {
    if (num_tasks <= 0) return;
    if (workers_.empty() || num_tasks == 1) {
      for (int i = 0; i < num_tasks; ++i) task(i);
      return;
    }
    // A plain function pointer and a context: no allocation per run.
    invoke_ = [](void* context, int i) { (*static_cast<std::remove_reference_t<Task>*>(context))(i); };
    context_ = const_cast<void*>(static_cast<const void*>(&task));
    for (int t = 0; t < num_threads_; ++t) {
      shares_[t].next.store(first_task(t, num_tasks), std::memory_order_relaxed);
      shares_[t].end = first_task(t + 1, num_tasks);
    }
    {
      std::lock_guard lock(mutex_);  // no worker falls asleep between its last look and the call
      state_.fetch_add(kNextRun + kOpen, std::memory_order_release);
    }
    wake_.notify_all();
    drain(0);
    state_.fetch_sub(kOpen, std::memory_order_relaxed);
    wait_until(finished_, [this] { return state_.load(std::memory_order_acquire) % kOpen == 0; });
    if (failure_) std::rethrow_exception(std::exchange(failure_, nullptr));
  }

 private:
  /// The state is the number of workers inside the run, a bit that says whether it takes more, and the run's number.
  static constexpr std::uint64_t kOpen = 1 << 16, kNextRun = 2 * kOpen;

  /// Returns when `is_ready()`. Somebody makes it true, then locks the mutex and notifies `condition`.
  template <class IsReady>
  void wait_until(std::condition_variable& condition, const IsReady& is_ready) {
    constexpr int kLooks = 100;  // some 50 us, unless others want the core
    for (int i = 0; i < kLooks; ++i) {
      if (is_ready()) return;
      std::this_thread::yield();
    }
    std::unique_lock lock(mutex_);
    condition.wait(lock, is_ready);
  }

  /// Where the share of a thread begins.
  [[nodiscard]] int first_task(int thread, int num_tasks) const {
    return static_cast<int>(static_cast<std::int64_t>(num_tasks) * thread / num_threads_);
  }

  /// Works off the own share, then those of the threads after it.
  void drain(int thread) {
    for (int t = 0; t < num_threads_; ++t) {
      Share& share = shares_[(thread + t) % num_threads_];
      for (int i; (i = share.next.fetch_add(1, std::memory_order_relaxed)) < share.end;) {
        try {
          invoke_(context_, i);
        } catch (...) {
          std::lock_guard lock(mutex_);
          if (!failure_) failure_ = std::current_exception();
          for (Share& every : shares_) every.next.store(every.end, std::memory_order_relaxed);
        }
      }
    }
  }

  /// Joins the run if it takes workers and is not the one that was `seen`.
  bool enter(std::uint64_t& seen) {
    std::uint64_t state = state_.load(std::memory_order_relaxed);
    while (state / kOpen % 2 != 0 && state / kNextRun != seen) {
      if (!state_.compare_exchange_weak(state, state + 1, std::memory_order_acquire)) continue;
      seen = state / kNextRun;
      return true;
    }
    return false;
  }
  void leave() {
    if (state_.fetch_sub(1, std::memory_order_release) % kNextRun != 1) return;  // not the last one of a closed run
    { std::lock_guard lock(mutex_); }  // the caller does not fall asleep between its last look and the call
    finished_.notify_one();
  }

  void work(int thread) {
    for (std::uint64_t seen = 0;;) {
      bool entered = false;
      wait_until(wake_, [&] { return (entered = enter(seen)) || stopping_.load(std::memory_order_relaxed); });
      if (!entered) return;
      drain(thread);
      leave();
    }
  }

  /// Tasks that nobody has begun, on a cache line of their own.
  struct alignas(64) Share {
    std::atomic<int> next{0};
    int end = 0;
  };

  int num_threads_;
  std::vector<Share> shares_;
  std::vector<std::thread> workers_;
  std::mutex mutex_;
  std::condition_variable wake_, finished_;
  void (*invoke_)(void*, int) = nullptr;
  void* context_ = nullptr;
  std::atomic<std::uint64_t> state_{0};
  std::atomic<bool> stopping_{false};
  std::exception_ptr failure_;
};

}  // namespace langgs
