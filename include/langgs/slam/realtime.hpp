// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <exception>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

#include "langgs/device/launch.hpp"
#include "langgs/slam/front_end.hpp"

namespace langgs {

/// The real-time schedule: the calling thread tracks, a second thread maps with all the time that tracking leaves.
/// They meet in a mailbox of one keyframe. After a tracking keyframe, tracking waits for the renewed target; a mapping
/// keyframe it leaves behind. Reproducible only up to how the threads happen to run. The executor is the mapping
/// thread's while `run` runs.
template <class Mapper, class KeyframePolicy, class Policies, class Backend>
class RealtimeRunner {
 public:
  RealtimeRunner(FrontEnd& front_end, Mapper& mapper, KeyframePolicy& keyframe_policy, const Policies& policies,
                 const Executor<Backend>& executor)
      : front_end_(front_end),
        mapper_(mapper),
        keyframe_policy_(keyframe_policy),
        policies_(policies),
        executor_(executor) {}

  /// `fps` is the playback rate; 0: as fast as tracking goes.
  template <class Source, class Features, class Observer>
  void run(Source& source, Features& features, Observer& observer, double fps) {
    std::thread mapping([&] { map(features); });
    std::exception_ptr failure;
    try {
      track(source, observer, fps);
    } catch (...) {
      failure = std::current_exception();
    }
    {
      std::lock_guard lock(mutex_);
      finished_ = true;
    }
    changed_.notify_all();
    mapping.join();
    if (failure) std::rethrow_exception(failure);
    if (mapping_failure_) std::rethrow_exception(mapping_failure_);
  }

 private:
  struct Mail {
    TrackedFrame tracked;
    RgbdFrame frame;
  };

  template <class Source, class Observer>
  void track(Source& source, Observer& observer, double fps) {
    WorkerPool pool(1);
    const auto start = std::chrono::steady_clock::now();
    RgbdFrame frame, next;
    bool more = source.next(frame);
    for (int i = 0; more; ++i) {
      if (fps > 0) std::this_thread::sleep_until(start + std::chrono::duration<double>(i / fps));
      more = source.next(next);
      TrackedFrame tracked = front_end_.track(frame, {!more, false}, keyframe_policy_, pool);
      FrameReport report = tracked.report;
      if (report.keyframe != KeyframeKind::none && !post({std::move(tracked), std::move(frame)})) return;
      {
        std::lock_guard lock(mutex_);
        if (mapping_failure_) return;
        report.num_gaussians = num_gaussians_;
        report.loss = loss_;
      }
      if (!observer(report)) return;
      std::swap(frame, next);
    }
  }

  /// Hands a keyframe over; false if the mapping thread has failed.
  bool post(Mail mail) {
    const bool renews_target = mail.tracked.report.keyframe == KeyframeKind::tracking;
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return !mail_ || mapping_failure_; });
    if (mapping_failure_) return false;
    mail_ = std::move(mail);
    target_.reset();
    changed_.notify_all();
    if (!renews_target) return true;
    changed_.wait(lock, [&] { return target_ || mapping_failure_; });
    if (mapping_failure_) return false;
    front_end_.set_target(target_);
    return true;
  }

  template <class Features>
  void map(Features& features) {
    try {
      executor_.make_current();
      for (;;) {
        std::optional<Mail> mail;
        {
          std::unique_lock lock(mutex_);
          if (mapper_.keyframes().empty()) changed_.wait(lock, [&] { return mail_ || finished_; });
          if (finished_ && !mail_) break;
          mail.swap(mail_);
        }
        if (mail) {
          mapper_.add_keyframe(executor_, mail->tracked, mail->frame, features(mail->frame));
          const bool renews_target = mail->tracked.report.keyframe == KeyframeKind::tracking;
          auto target = renews_target ? mapper_.make_target(executor_) : nullptr;
          std::lock_guard lock(mutex_);
          target_ = std::move(target);
        }
        changed_.notify_all();
        mapper_.iterate(executor_, policies_);
        if (!mail) continue;  // looking at the loss makes a device wait
        const double loss = mapper_.last_loss();
        std::lock_guard lock(mutex_);
        num_gaussians_ = mapper_.map().size();
        loss_ = loss;
      }
      mapper_.finish(executor_);
    } catch (...) {
      std::lock_guard lock(mutex_);
      mapping_failure_ = std::current_exception();
    }
    changed_.notify_all();
  }

  FrontEnd& front_end_;
  Mapper& mapper_;
  KeyframePolicy& keyframe_policy_;
  Policies policies_;
  const Executor<Backend>& executor_;

  std::mutex mutex_;
  std::condition_variable changed_;
  std::optional<Mail> mail_;
  std::shared_ptr<const GridTarget> target_;
  std::exception_ptr mapping_failure_;
  bool finished_ = false;
  int num_gaussians_ = 0;
  double loss_ = 0;
};

}  // namespace langgs
