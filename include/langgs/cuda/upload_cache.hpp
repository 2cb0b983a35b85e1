// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <iterator>
#include <list>
#include <optional>
#include <span>
#include <utility>

#include "langgs/cuda/buffer.hpp"
#include "langgs/cuda/memory.hpp"
#include "langgs/cuda/stream.hpp"

/// @file The CUDA twin of device/upload_cache.hpp.

namespace langgs {

template <class Backend>
class UploadCache;

/// Copies go by way of page-locked memory and on a stream of their own, beside the executor's kernels; events order the
/// two. Neither stream is waited for: the host only waits when both of its page-locked pieces are still being copied.
template <>
class UploadCache<Cuda> {
 public:
  explicit UploadCache(std::size_t byte_budget) : byte_budget_(byte_budget) {}
  UploadCache(const UploadCache&) = delete;
  UploadCache& operator=(const UploadCache&) = delete;
  ~UploadCache() {
    if (!copies_) return;
    if (handed_out_ != nullptr) (void)cudaEventRecord(handed_out_->used.get(), reader_->stream());
    for (const Entry& entry : entries_) (void)cudaStreamWaitEvent(copies_->stream(), entry.used.get(), 0);
  }

  template <class First, class Second>
  std::pair<const First*, const Second*> operator()(const Executor<Cuda>& executor, std::int64_t key,
                                                    std::span<const First> first, std::span<const Second> second) {
    prefetch(executor, key, first, second);
    Entry& entry = entries_.front();  // where prefetch has put it
    order(executor, entry.copied);
    handed_out_ = &entry;
    reader_ = executor;
    const std::byte* const values = entry.values.data();
    return {reinterpret_cast<const First*>(values), reinterpret_cast<const Second*>(values + aligned(first))};
  }

  template <class First, class Second>
  void prefetch(const Executor<Cuda>& executor, std::int64_t key, std::span<const First> first,
                std::span<const Second> second) {
    // What was handed out last has been read by the work that is on the executor now.
    if (handed_out_ != nullptr) std::exchange(handed_out_, nullptr)->used.record(executor.stream());
    const auto found = std::find_if(entries_.begin(), entries_.end(), [&](const Entry& e) { return e.key == key; });
    if (found != entries_.end()) return entries_.splice(entries_.begin(), entries_, found);
    if (!copies_) copies_.emplace(gpu::Stream(), executor.memory());

    const std::size_t bytes = aligned(first) + second.size_bytes();
    Staging& staging = staging_[num_uploads_++ % 2];  // one is written while the other is copied
    if (staging.values.size() > 0) copies_->wait(staging.copied);
    staging.values.resize_discard(bytes);
    if (!first.empty()) std::memcpy(staging.values.data(), first.data(), first.size_bytes());
    if (!second.empty()) std::memcpy(staging.values.data() + aligned(first), second.data(), second.size_bytes());

    Entry& entry = make_entry(bytes);
    entry.key = key;
    detail::check_cuda(
        cudaMemcpyAsync(entry.values.data(), staging.values.data(), bytes, cudaMemcpyHostToDevice, copies_->stream()),
        "uploading ", bytes, " bytes");
    staging.copied.record(copies_->stream());
    entry.copied.record(copies_->stream());
  }
  [[nodiscard]] std::size_t bytes() const {
    std::size_t sum = 0;
    for (const Entry& entry : entries_) sum += entry.values.bytes();
    return sum;
  }
  /// Copies so far.
  [[nodiscard]] int num_uploads() const { return num_uploads_; }

 private:
  struct Entry {
    std::int64_t key = 0;
    Buffer<std::byte, Cuda> values;
    gpu::Event copied, used;
  };
  struct Staging {
    gpu::PinnedBuffer<std::byte> values;
    gpu::Event copied;
  };

  /// Bytes of an array, up to where the next may begin in device memory.
  template <class T>
  [[nodiscard]] static std::size_t aligned(std::span<const T> values) {
    return (values.size_bytes() + 255) / 256 * 256;
  }
  static void order(const Executor<Cuda>& later, const gpu::Event& earlier) {
    detail::check_cuda(cudaStreamWaitEvent(later.stream(), earlier.get(), 0), "ordering uploads and their readers");
  }
  /// A new entry at the front. What was not asked for for longest goes, once it has been read, and may leave its
  /// memory.
  Entry& make_entry(std::size_t bytes) {
    std::list<Entry> gone;
    for (std::size_t held = this->bytes(); !entries_.empty() && held + bytes > byte_budget_;) {
      gone.splice(gone.begin(), entries_, std::prev(entries_.end()));
      held -= gone.front().values.bytes();
      order(*copies_, gone.front().used);
    }
    auto entry = std::find_if(gone.begin(), gone.end(), [&](const Entry& e) { return e.values.bytes() >= bytes; });
    if (entry == gone.end()) entry = gone.emplace(gone.begin());
    entries_.splice(entries_.begin(), gone, entry);
    entries_.front().values.resize_discard(*copies_, bytes);
    return entries_.front();
  }

  // In this order: page-locked memory outlives the stream that copies from it, which the entries share.
  std::size_t byte_budget_;
  int num_uploads_ = 0;
  Staging staging_[2];
  std::optional<Executor<Cuda>> copies_, reader_;
  std::list<Entry> entries_;     ///< asked for last first
  Entry* handed_out_ = nullptr;  ///< to the work that is being put on the reader
};

}  // namespace langgs
