// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "langgs/device/ordered_insert.hpp"
#include "langgs/host/warp.hpp"

namespace langgs::host {

/// For each thread of a block the K largest of the values that its warp was offered, with their tags.
///
/// An offer only sets the values aside, if any lane may need them; `settle` then inserts all of them in one loop that
/// keeps the K values and tags of its lanes in registers. At most kOffers between two settlements.
template <int K, int kOffers, class Warp, int kWarps>
class KLargest {
 public:
  LANGGS_INLINE void clear(const Warp& warp) {
    State& state = warps_[warp.index()];
    state.num_offers = 0;
    for (int k = 0; k < K; ++k) {
      Varying<float>(0.f).store(state.value[k]);
      Varying<std::int32_t>(0).store(state.tag[k]);
    }
  }
  LANGGS_INLINE void offer(const Warp& warp, const Varying<float>& value, std::int32_t tag) {
    State& state = warps_[warp.index()];
    value.store(state.offer[state.num_offers]);
    state.offer_tag[state.num_offers] = tag;
    // No branch: values that are not wanted are overwritten by the next.
    state.num_offers += any(value > Varying<float>::load(state.value[K - 1])) ? 1 : 0;
  }
  LANGGS_INLINE void settle(const Warp& warp) {
    State& state = warps_[warp.index()];
    for (int lane = 0; lane < kLanes; lane += Varying<float>::kNativeLanes) {
      Values values[K];
      Tags tags[K];
      for (int k = 0; k < K; ++k) {
        values[k] = *reinterpret_cast<const Values*>(state.value[k] + lane);
        tags[k] = *reinterpret_cast<const Tags*>(state.tag[k] + lane);
      }
      for (int i = 0; i < state.num_offers; ++i)
        ordered_insert(values, tags, *reinterpret_cast<const Values*>(state.offer[i] + lane),
                       state.offer_tag[i] - Tags{});
      for (int k = 0; k < K; ++k) {
        *reinterpret_cast<Values*>(state.value[k] + lane) = values[k];
        *reinterpret_cast<Tags*>(state.tag[k] + lane) = tags[k];
      }
    }
    state.num_offers = 0;
  }
  [[nodiscard]] LANGGS_INLINE Varying<float> value(const Warp& warp, int k) const {
    return Varying<float>::load(warps_[warp.index()].value[k]);
  }
  [[nodiscard]] LANGGS_INLINE Varying<std::int32_t> tag(const Warp& warp, int k) const {
    return Varying<std::int32_t>::load(warps_[warp.index()].tag[k]);
  }

 private:
  typedef Varying<float>::Native Values __attribute__((may_alias));
  typedef Varying<std::int32_t>::Native Tags __attribute__((may_alias));
  struct State {
    alignas(64) float value[K][kLanes];
    alignas(64) std::int32_t tag[K][kLanes];
    alignas(64) float offer[kOffers][kLanes];
    std::int32_t offer_tag[kOffers];
    int num_offers;
  };
  State warps_[kWarps];
};

}  // namespace langgs::host
