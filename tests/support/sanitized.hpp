// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace langgs::test {

/// Under AddressSanitizer tracking is some thirty times as slow, and needs fewer runs there than statistics do.
#if defined(__SANITIZE_ADDRESS__)
inline constexpr bool kSanitized = true;
#else
inline constexpr bool kSanitized = false;
#endif

}  // namespace langgs::test
