// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "langgs/core/config.hpp"
#include "langgs/device/block.hpp"

namespace langgs {

/// The K largest weights of a ray and whose they are, largest first (paper Eq. 2). Per lane.
/// Of equal weights the front-most is kept and comes first. Empty places have weight 0 and id -1.
template <int K, class Block>
struct TopK {
  static_assert(K >= 1 && K <= 16, "K must be in [1, 16]; the paper uses 3");
  VaryingOf<float, Block> weight[K];
  VaryingOf<std::int32_t, Block> id[K];

  LANGGS_INLINE void clear() {
    for (int k = 0; k < K; ++k) {
      weight[k] = 0.f;
      id[k] = -1;
    }
  }

  /// Offers a hit. A weight of 0 changes nothing.
  LANGGS_INLINE void insert(const VaryingOf<float, Block>& w, std::int32_t who) {
    using Int = VaryingOf<std::int32_t, Block>;
    // From the smallest place up: a place takes its upper neighbour's value where w beats the neighbour too.
    for (int k = K - 1; k >= 1; --k) {
      const auto beats_upper = w > weight[k - 1];
      const auto beats_own = w > weight[k];
      id[k] = select(beats_upper, id[k - 1], select(beats_own, Int(who), id[k]));
      weight[k] = select(beats_upper, weight[k - 1], select(beats_own, w, weight[k]));
    }
    const auto first = w > weight[0];
    id[0] = select(first, Int(who), id[0]);
    weight[0] = select(first, w, weight[0]);
  }
};

}  // namespace langgs
