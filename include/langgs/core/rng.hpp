// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>

#include "langgs/core/config.hpp"

/// @file Counter-based random numbers: a value depends on (seed, stream, counter) alone, never on call order.

namespace langgs {

/// The finaliser of SplitMix64 (Steele, Lea & Flood 2014): a bijection of 64-bit words with full avalanche.
[[nodiscard]] LANGGS_HD constexpr std::uint64_t mix64(std::uint64_t x) {
  x += 0x9E3779B97F4A7C15ull;
  x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9ull;
  x = (x ^ (x >> 27)) * 0x94D049BB133111EBull;
  return x ^ (x >> 31);
}

/// A stream of reproducible random values that threads may evaluate in any order.
struct CounterRng {
  std::uint64_t seed = 0;
  std::uint64_t stream = 0;

  [[nodiscard]] LANGGS_HD constexpr std::uint64_t bits(std::uint64_t counter) const {
    return mix64(counter ^ mix64(stream ^ mix64(seed)));
  }
  /// Uniform in the open interval (0, 1); never 0, so its logarithm is finite.
  [[nodiscard]] LANGGS_HD constexpr double uniform(std::uint64_t counter) const {
    return (static_cast<double>(bits(counter) >> 11) + 0.5) * 0x1p-53;
  }
  /// Uniform integer in [0, n).
  [[nodiscard]] LANGGS_HD constexpr std::uint32_t below(std::uint64_t counter, std::uint32_t n) const {
    return static_cast<std::uint32_t>(((bits(counter) >> 32) * n) >> 32);
  }
  /// Standard normal (Box-Muller on counters 2c and 2c + 1).
  [[nodiscard]] double normal(std::uint64_t counter) const {
    return std::sqrt(-2 * std::log(uniform(2 * counter))) * std::cos(2 * std::numbers::pi * uniform(2 * counter + 1));
  }
};

}  // namespace langgs
