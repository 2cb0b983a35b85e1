// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "langgs/core/config.hpp"

namespace langgs {

/// How many elements a list has. A device may know that long before the host does: then memory and launches are sized
/// by what there is room for, and kernels stop at the number itself.
struct ListSize {
  int most = 0;                         ///< the list has no more elements
  const std::int32_t* exact = nullptr;  ///< how many it has, in the backend's memory; null: `most`

  ListSize() = default;
  LANGGS_HD ListSize(int n) : most(n) {}
  LANGGS_HD ListSize(int room, const std::int32_t* size) : most(room), exact(size) {}
  /// For kernels.
  [[nodiscard]] LANGGS_HD int get() const { return exact != nullptr ? *exact : most; }
  friend bool operator==(const ListSize&, const ListSize&) = default;
};

}  // namespace langgs
