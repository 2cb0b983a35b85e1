// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

namespace langgs {

/// What to allocate for `size` elements that are kept: an eighth more. A map is the largest thing there is, and grows
/// by a keyframe's part at a time.
[[nodiscard]] constexpr std::size_t grown_capacity(std::size_t size) { return size + size / 8; }

}  // namespace langgs
