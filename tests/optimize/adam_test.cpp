// SPDX-License-Identifier: Apache-2.0
#include "optimize/adam_test.inc"

TEST_CASE("Adam gives the same bits for any number of threads") {
  AdamBench one(1), three(3);
  for (int i = 0; i < 5; ++i) {
    one.step();
    three.step();
  }
  for (int p = 0; p < kNumPlanes; ++p)
    CHECK(std::equal(one.map.geometry().plane(p), one.map.geometry().plane(p) + one.map.size(),
                     three.map.geometry().plane(p)));
}
