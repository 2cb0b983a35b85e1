// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cmath>
#include <cstring>
#include <vector>

#include "langgs/core/rng.hpp"
#include "langgs/device/launch.hpp"

using namespace langgs;
using host::kLanes;
using host::Mask;
using F = Varying<float>;
using I = Varying<std::int32_t>;

namespace {

struct Row {
  float values[kLanes];
  [[nodiscard]] F load() const { return F::load(values); }
};

Row random_row(std::uint64_t seed, double low = -3, double high = 3) {
  const CounterRng rng{seed};
  Row row;
  for (int i = 0; i < kLanes; ++i) row.values[i] = static_cast<float>(low + (high - low) * rng.uniform(i));
  row.values[5] = row.values[6] = 1;  // equal pairs for the comparisons
  return row;
}

/// Every lane of `got` has the bits of `expected(a, b)`.
template <class T, class Expected>
void check_lanes(const Varying<T>& got, const Row& a, const Row& b, Expected expected) {
  for (int i = 0; i < kLanes; ++i) {
    const T want = expected(a.values[i], b.values[i]), have = got.lane(i);
    CAPTURE(i);
    REQUIRE(std::memcmp(&want, &have, sizeof(T)) == 0);
  }
}

/// The tree of reductions, xor 16, 8, 4, 2, 1, written out.
template <class Op>
float scalar_tree(const Row& row, Op op) {
  float values[kLanes];
  std::memcpy(values, row.values, sizeof(values));
  for (int half = 16; half >= 1; half /= 2)
    for (int i = 0; i < half; ++i) values[i] = op(values[i], values[i + half]);
  return values[0];
}

}  // namespace

TEST_CASE("Varying: every operator equals the scalar operator in every lane") {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const Row a = random_row(2 * seed), b = random_row(2 * seed + 1);
    const F x = a.load(), y = b.load();
    check_lanes(x + y, a, b, [](float p, float q) { return p + q; });
    check_lanes(x - y, a, b, [](float p, float q) { return p - q; });
    check_lanes(x * y, a, b, [](float p, float q) { return p * q; });
    check_lanes(x / y, a, b, [](float p, float q) { return p / q; });
    check_lanes(-x, a, b, [](float p, float) { return -p; });
    check_lanes(2.5f - x, a, b, [](float p, float) { return 2.5f - p; });
    check_lanes(x / 3.f, a, b, [](float p, float) { return p / 3.f; });
    check_lanes(min(x, y), a, b, [](float p, float q) { return p < q ? p : q; });
    check_lanes(max(x, 0.5f), a, b, [](float p, float) { return p > 0.5f ? p : 0.5f; });
    check_lanes(abs(x), a, b, [](float p, float) { return std::abs(p); });
    check_lanes(sqrt(abs(x)), a, b, [](float p, float) { return std::sqrt(std::abs(p)); });
    const auto mask = [](bool m) { return static_cast<std::int32_t>(m ? -1 : 0); };
    check_lanes(x < y, a, b, [&](float p, float q) { return mask(p < q); });
    check_lanes(x <= y, a, b, [&](float p, float q) { return mask(p <= q); });
    check_lanes(x > y, a, b, [&](float p, float q) { return mask(p > q); });
    check_lanes(x >= y, a, b, [&](float p, float q) { return mask(p >= q); });
    check_lanes(x == y, a, b, [&](float p, float q) { return mask(p == q); });
    check_lanes(x != y, a, b, [&](float p, float q) { return mask(p != q); });
    check_lanes(!(x < y), a, b, [&](float p, float q) { return mask(!(p < q)); });
    check_lanes((x < y) & (x > 0.f), a, b, [&](float p, float q) { return mask(p < q && p > 0); });
    check_lanes((x < y) | (x > 0.f), a, b, [&](float p, float q) { return mask(p < q || p > 0); });
    check_lanes(select(x < y, x, y * 2.f), a, b, [](float p, float q) { return p < q ? p : q * 2; });
    check_lanes(host::convert<std::int32_t>(x), a, b, [](float p, float) { return static_cast<std::int32_t>(p); });
    F z = x;
    z += y;
    z *= x;
    z -= F(1.f);
    for (int i = 0; i < kLanes; ++i)  // may be fused
      CHECK(z.lane(i) == doctest::Approx((a.values[i] + b.values[i]) * a.values[i] - 1).epsilon(1e-5));
  }
}

TEST_CASE("Varying: select takes no value from the other side, not even NaN") {
  const Row a = random_row(1);
  const F nan(std::nanf(""));
  check_lanes(select(Mask(-1), a.load(), nan), a, a, [](float p, float) { return p; });
  check_lanes(select(Mask(0), nan, a.load()), a, a, [](float p, float) { return p; });
}

TEST_CASE("Varying: loads and stores need no alignment, gathers take any index") {
  std::vector<float> memory(100);
  for (int i = 0; i < 100; ++i) memory[i] = static_cast<float>(i);
  std::vector<float> out(100, -1.f);
  F::load(memory.data() + 7).store(out.data() + 3);
  for (int i = 0; i < 100; ++i) CHECK(out[i] == (i >= 3 && i < 3 + kLanes ? static_cast<float>(i + 4) : -1.f));
  const F gathered = host::gather(memory.data(), host::lane_index() * 3);
  for (int i = 0; i < kLanes; ++i) CHECK(gathered.lane(i) == static_cast<float>(3 * i));
}

TEST_CASE("Varying: reductions run the documented tree") {
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    const Row row = random_row(seed, -1e3, 1e3);
    CHECK(reduce_sum(row.load()) == scalar_tree(row, [](float a, float b) { return a + b; }));
    CHECK(reduce_max(row.load()) == scalar_tree(row, [](float a, float b) { return a > b ? a : b; }));
  }
  for (int i = 0; i < kLanes; ++i) {
    const Mask one = host::lane_index() == i;
    CHECK(any(one));
    CHECK(!all(one));
    CHECK(!all(!one));
    CHECK(any(!one));
  }
  CHECK(!any(Mask(0)));
  CHECK(all(Mask(-1)));
}

TEST_CASE("Varying: exp and log keep their promised accuracy") {
  double worst_exp = 0, worst_log = 0;
  for (int k = 0; k < 20000; ++k) {
    Row x;
    for (int i = 0; i < kLanes; ++i)
      x.values[i] = -87.f + 175.f * static_cast<float>(k * kLanes + i) / (20000.f * kLanes);
    const F e = exp(x.load()), back = log(e);
    for (int i = 0; i < kLanes; ++i) {
      const double exact = std::exp(static_cast<double>(x.values[i]));
      const double allowed = 2e-7 + 8e-8 * std::abs(static_cast<double>(x.values[i]));
      worst_exp = std::max(worst_exp, std::abs(e.lane(i) / exact - 1) / allowed);
      const double ln = std::log(static_cast<double>(e.lane(i)));
      worst_log = std::max(worst_log, std::abs(back.lane(i) - ln) / (1e-7 + 3e-7 * std::abs(ln)));
    }
  }
  CHECK(worst_exp <= 1);
  CHECK(worst_log <= 1);
  for (const float low : {-88.f, -1000.f, -INFINITY}) {
    CHECK(exp(F(low)).lane(31) > 0);
    CHECK(exp(F(low)).lane(0) < 1.7e-38f);
  }
}

TEST_CASE("Varying: uniform values keep their sign of zero") {
  CHECK(std::signbit(F(-0.f).lane(9)));
  CHECK(!std::signbit(F(0.f).lane(9)));
}
