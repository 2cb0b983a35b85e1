// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <condition_variable>
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
class WorkerPool {
 public:
  explicit WorkerPool(int num_threads) : num_threads_(num_threads) {
    LANGGS_EXPECTS(num_threads >= 1 && num_threads <= 1024, "number of threads is ", num_threads,
                   "; it must be in [1, 1024]");
    for (int i = 1; i < num_threads; ++i) workers_.emplace_back([this] { work(); });
  }
  ~WorkerPool() {
    {
      std::lock_guard lock(mutex_);
      stopping_ = true;
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
    {
      std::lock_guard lock(mutex_);
      // A plain function pointer and a context: no allocation per run.
      invoke_ = [](void* context, int i) { (*static_cast<std::remove_reference_t<Task>*>(context))(i); };
      context_ = const_cast<void*>(static_cast<const void*>(&task));
      num_tasks_ = num_tasks;
      next_task_.store(0, std::memory_order_relaxed);
      busy_workers_ = static_cast<int>(workers_.size());
      ++generation_;
    }
    wake_.notify_all();
    drain();
    std::unique_lock lock(mutex_);
    finished_.wait(lock, [this] { return busy_workers_ == 0; });
    if (failure_) std::rethrow_exception(std::exchange(failure_, nullptr));
  }

 private:
  void drain() {
    for (int i; (i = next_task_.fetch_add(1, std::memory_order_relaxed)) < num_tasks_;) {
      try {
        invoke_(context_, i);
      } catch (...) {
        std::lock_guard lock(mutex_);
        if (!failure_) failure_ = std::current_exception();
        next_task_.store(num_tasks_, std::memory_order_relaxed);
      }
    }
  }

  void work() {
    unsigned seen = 0;
    for (;;) {
      {
        std::unique_lock lock(mutex_);
        wake_.wait(lock, [&] { return stopping_ || generation_ != seen; });
        if (stopping_) return;
        seen = generation_;
      }
      drain();
      std::lock_guard lock(mutex_);
      if (--busy_workers_ == 0) finished_.notify_one();
    }
  }

  int num_threads_;
  std::vector<std::thread> workers_;
  std::mutex mutex_;
  std::condition_variable wake_, finished_;
  void (*invoke_)(void*, int) = nullptr;
  void* context_ = nullptr;
  int num_tasks_ = 0;
  std::atomic<int> next_task_{0};
  int busy_workers_ = 0;
  unsigned generation_ = 0;
  bool stopping_ = false;
  std::exception_ptr failure_;
};

}  // namespace langgs
