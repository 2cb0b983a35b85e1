// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

namespace langgs {

struct KeyValue {
  std::uint32_t key;
  std::int32_t value;
};

/// What sorting and grouping on the host need besides their arguments; kept by the caller so that no memory is
/// allocated per call. Where an executor has a workspace of its own, this is empty.
template <class Backend>
struct SortScratch {
  std::vector<KeyValue> pairs;
  std::vector<std::int32_t> offsets, counts;
};

/// The counts that CountedLists turns into places.
struct CountsAndOffsets {
  const std::int32_t* counts;  ///< [n]
  std::int32_t* offsets;       ///< [n + 1]
};

}  // namespace langgs
