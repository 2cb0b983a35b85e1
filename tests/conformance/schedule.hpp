// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <doctest/doctest.h>

#include <cstdint>

#include "langgs/optimize/hybrid_schedule.hpp"

/// @file What LangGsSlam relies on in an optimisation schedule. For a type of your own, in one source file:
///
///   #include "conformance/schedule.hpp"
///   TEST_CASE_TEMPLATE_INVOKE(langgs_schedule_conformance, MySchedule);

TEST_CASE_TEMPLATE_DEFINE("optimisation schedule conformance", Schedule, langgs_schedule_conformance) {
  using namespace langgs;
  static_assert(require_optimization_schedule<Schedule>());
  const Schedule schedule{};

  SUBCASE("pure: in any order, again, and by a copy") {
    const Schedule copy = schedule;
    for (int i = 0; i < 200; ++i) {
      const std::int64_t forward = i, backward = 199 - i;
      const MappingVisit visit{forward, forward % 3 == 0}, other{backward, backward % 3 == 0};
      const OptimizationStep step = schedule(visit);
      static_cast<void>(schedule(other));
      CHECK(schedule(visit) == step);
      CHECK(copy(visit) == step);
    }
  }
  SUBCASE("iterations of a long run are in its range") {
    for (const std::int64_t i :
         {std::int64_t{0}, std::int64_t{1} << 31, (std::int64_t{1} << 31) + 1, std::int64_t{1} << 40}) {
      static_cast<void>(schedule({i, true}));
      static_cast<void>(schedule({i, false}));
    }
  }
  SUBCASE("something is stepped now and then") {
    bool any = false;
    for (int i = 0; i < 1000; ++i) {
      const OptimizationStep step = schedule({i, i == 0});
      any = any || step.geometry || step.features;
    }
    CHECK(any);
  }
}
