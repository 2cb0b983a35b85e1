// SPDX-License-Identifier: Apache-2.0
#include "langgs/core/half.hpp"

#include <doctest/doctest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <initializer_list>
#include <limits>

#include "langgs/core/rng.hpp"

namespace {

using langgs::Half;

Half from_bits(unsigned bits) {
  Half h;
  h.bits = static_cast<std::uint16_t>(bits);
  return h;
}

/// The value of a binary16 word by the definition of the format.
double value_of(unsigned bits) {
  const double sign = (bits & 0x8000u) ? -1 : 1;
  const int exponent = static_cast<int>((bits >> 10) & 31u);
  const int mantissa = static_cast<int>(bits & 1023u);
  if (exponent == 31) return mantissa ? std::numeric_limits<double>::quiet_NaN() : sign * HUGE_VAL;
  return exponent == 0 ? sign * std::ldexp(mantissa, -24) : sign * std::ldexp(1024 + mantissa, exponent - 25);
}

/// Nearest binary16 of a non-negative finite value, ties to even, found by bisection over the ordered words.
unsigned nearest_bits(double value) {
  unsigned low = 0, high = 0x7C00u;  // 0 and infinity; infinity takes part with the value 65536
  const auto value_or_limit = [](unsigned bits) { return bits == 0x7C00u ? 65536.0 : value_of(bits); };
  if (value >= 65536.0) return high;
  while (high - low > 1) {
    const unsigned middle = (low + high) / 2;
    (value_or_limit(middle) <= value ? low : high) = middle;
  }
  const double below = value - value_or_limit(low), above = value_or_limit(high) - value;
  if (below != above) return below < above ? low : high;
  return low % 2 == 0 ? low : high;
}

void check_rounding(float value) {
  const unsigned expected = nearest_bits(std::abs(static_cast<double>(value))) | (std::signbit(value) ? 0x8000u : 0u);
  if (Half(value).bits != expected) {  // a plain comparison: millions of assertions would dominate the run time
    CAPTURE(value);
    CHECK(Half(value).bits == expected);
  }
}

}  // namespace

TEST_CASE("every one of the 65536 half words converts to its defined value") {
  int wrong = 0, nans = 0;
  for (unsigned bits = 0; bits < 65536; ++bits) {
    const float converted = static_cast<float>(from_bits(bits));
    const double expected = value_of(bits);
    if (std::isnan(expected)) {
      nans += std::isnan(converted) ? 1 : -1;
    } else if (static_cast<double>(converted) != expected || std::signbit(converted) != std::signbit(expected)) {
      ++wrong;
    }
  }
  CHECK(wrong == 0);
  CHECK(nans == 2 * 1023);
}

TEST_CASE("every finite half word survives the round trip through float") {
  int wrong = 0;
  for (unsigned bits = 0; bits < 65536; ++bits) {
    if ((bits & 0x7C00u) == 0x7C00u && (bits & 1023u)) continue;
    wrong += Half(static_cast<float>(from_bits(bits))).bits != bits;
  }
  CHECK(wrong == 0);
}

TEST_CASE("floats round to the nearest half, ties to even, at and beside every boundary") {
  for (unsigned bits = 0; bits < 0x7C00u; ++bits) {
    const double next = bits + 1 == 0x7C00u ? 65536.0 : value_of(bits + 1);
    const float middle = static_cast<float>((value_of(bits) + next) / 2);  // exact: one bit more than a half has
    for (const float value : {middle, std::nextafter(middle, 0.f), std::nextafter(middle, 1e9f)}) {
      check_rounding(value);
      check_rounding(-value);
    }
  }
  const langgs::CounterRng rng{1, 2};
  for (std::uint64_t i = 0; i < 300000; ++i) {
    check_rounding(std::bit_cast<float>(static_cast<std::uint32_t>(rng.bits(2 * i)) & 0x7F7FFFFFu));  // any magnitude
    check_rounding(static_cast<float>(std::exp(24 * rng.uniform(2 * i + 1) - 18)));  // half's own range
  }
}

TEST_CASE("halves at the edges of the range") {
  CHECK(Half(65504.f).bits == 0x7BFFu);
  CHECK(Half(65519.996f).bits == 0x7BFFu);
  CHECK(Half(65520.f).bits == 0x7C00u);
  CHECK(Half(std::numeric_limits<float>::max()).bits == 0x7C00u);
  CHECK(Half(-std::numeric_limits<float>::infinity()).bits == 0xFC00u);
  CHECK(Half(-0.f).bits == 0x8000u);
  CHECK(Half(std::numeric_limits<float>::denorm_min()).bits == 0);
  CHECK(Half(0x1p-25f).bits == 0);  // a tie between 0 and the smallest half
  CHECK(Half(0x1.000002p-25f).bits == 1);
  CHECK(std::isnan(static_cast<float>(Half(std::numeric_limits<float>::quiet_NaN()))));
  CHECK(std::isnan(static_cast<float>(Half(std::bit_cast<float>(0x7F800001u)))));  // its payload is in the dropped bits
  CHECK(std::isnan(static_cast<float>(Half(-std::numeric_limits<float>::quiet_NaN()))));
}
