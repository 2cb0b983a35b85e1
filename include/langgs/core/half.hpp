// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <bit>
#include <cstdint>

#include "langgs/core/config.hpp"

namespace langgs {

/// IEEE binary16 as a storage type; arithmetic is done in float. Conversions are branch-free so that loops vectorise.
struct Half {
  std::uint16_t bits = 0;

  Half() = default;
  /// Rounds to nearest, ties to even; values beyond 65504 become infinity, NaN stays NaN.
  LANGGS_HD explicit Half(float value) {
    const std::uint32_t word = std::bit_cast<std::uint32_t>(value);
    const std::uint32_t sign = (word >> 16) & 0x8000u;
    const std::uint32_t magnitude = word & 0x7FFFFFFFu;
    // Normal range: rebias the exponent and round the 13 dropped bits; a carry into the exponent is correct rounding.
    const std::uint32_t normal = (magnitude - 0x38000000u + 0x0FFFu + ((magnitude >> 13) & 1u)) >> 13;
    // Subnormal range: adding 0.5 lets the float adder do the shift and the rounding.
    const std::uint32_t subnormal = std::bit_cast<std::uint32_t>(std::bit_cast<float>(magnitude) + 0.5f) - 0x3F000000u;
    std::uint32_t result = magnitude < 0x38800000u ? subnormal : normal;
    result = magnitude >= 0x477FF000u ? 0x7C00u : result;
    result = magnitude > 0x7F800000u ? 0x7E00u : result;
    bits = static_cast<std::uint16_t>(sign | result);
  }
  LANGGS_HD explicit operator float() const {
    const std::uint32_t sign = static_cast<std::uint32_t>(bits & 0x8000u) << 16;
    const std::uint32_t shifted = static_cast<std::uint32_t>(bits & 0x7FFFu) << 13;
    // 2^112 rebiases the exponent exactly, subnormals included.
    const std::uint32_t finite = std::bit_cast<std::uint32_t>(std::bit_cast<float>(shifted) * 0x1p112f);
    const std::uint32_t special = shifted | 0x7F800000u;
    return std::bit_cast<float>(sign | ((bits & 0x7C00u) == 0x7C00u ? special : finite));
  }
  friend bool operator==(const Half&, const Half&) = default;
};
static_assert(sizeof(Half) == 2);

}  // namespace langgs
