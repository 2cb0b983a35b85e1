// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

namespace langgs {

struct KeyValue {
  std::uint32_t key;
  std::int32_t value;
};

/// What `sort_by_key` needs besides its arguments; kept by the caller so that no memory is allocated per call.
struct SortScratch {
  std::vector<KeyValue> pairs;
  std::vector<std::int32_t> offsets, counts;
};

}  // namespace langgs
