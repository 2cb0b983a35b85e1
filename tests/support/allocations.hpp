// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace langgs::test {

/// How often the program has asked `new` for memory, on all threads. Link allocations.cpp for it.
[[nodiscard]] long num_allocations();

}  // namespace langgs::test
