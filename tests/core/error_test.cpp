// SPDX-License-Identifier: Apache-2.0
#include "langgs/core/error.hpp"

#include <doctest/doctest.h>

namespace {

int side_effects = 0;
int counted() { return ++side_effects; }

void demand(int value) { LANGGS_EXPECTS(value > 0, "value is ", value, "; it must be positive: ", counted()); }

}  // namespace

TEST_CASE("a broken contract throws InvalidArgument with the value in its message") {
  CHECK_THROWS_WITH_AS(demand(-7), doctest::Contains("value is -7; it must be positive"), langgs::InvalidArgument);
}

TEST_CASE("a kept contract costs nothing: the parts of the message are not evaluated") {
  side_effects = 0;
  demand(1);
  CHECK(side_effects == 0);
}

TEST_CASE("one catch clause takes everything that langgs throws") {
  CHECK_THROWS_AS(langgs::detail::raise<langgs::InvalidArgument>("x"), langgs::Error);
  CHECK_THROWS_AS(langgs::detail::raise<langgs::IoError>("file ", "a.ply", " is missing"), langgs::Error);
  CHECK_THROWS_WITH(langgs::detail::raise<langgs::IoError>("file ", "a.ply", ": line ", 3), "file a.ply: line 3");
  CHECK_THROWS_AS(langgs::detail::raise<langgs::IoError>("x"), std::runtime_error);
}

TEST_CASE("the contract is one statement") {
  bool reached_else = false;
  if (side_effects < 0)
    LANGGS_EXPECTS(false, "never evaluated");
  else
    reached_else = true;
  CHECK(reached_else);
}
