// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "langgs/core/config.hpp"

namespace langgs {

/// Inserts (value, tag) into K values in descending order with their tags, where it is larger than the last of them.
/// Of equal values the one that came first stays first. One float and one int, or a SIMD vector of each.
template <int K, class Value, class Tag>
LANGGS_INLINE void ordered_insert(Value (&values)[K], Tag (&tags)[K], const Value& value, const Tag& tag) {
  // From the smallest place up: a place takes its upper neighbour where `value` is larger than the neighbour too.
  auto larger = value > values[K - 1];
  LANGGS_UNROLL
  for (int k = K - 1; k >= 1; --k) {
    const auto larger_than_upper = value > values[k - 1];
    tags[k] = larger_than_upper ? tags[k - 1] : (larger ? tag : tags[k]);
    values[k] = larger_than_upper ? values[k - 1] : (larger ? value : values[k]);
    larger = larger_than_upper;
  }
  tags[0] = larger ? tag : tags[0];
  values[0] = larger ? value : values[0];
}

}  // namespace langgs
