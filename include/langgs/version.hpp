// SPDX-License-Identifier: Apache-2.0
#pragma once

/// @file The only place where the version is written; CMake parses these lines.

#define LANGGS_VERSION_MAJOR 0
#define LANGGS_VERSION_MINOR 1
#define LANGGS_VERSION_PATCH 0

namespace langgs {
inline constexpr const char* kVersion = "0.1.0";
}  // namespace langgs
