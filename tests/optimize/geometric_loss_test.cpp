// SPDX-License-Identifier: Apache-2.0
#include "optimize/geometric_loss_test.inc"

#include <cstring>

TEST_CASE("geometric loss: the same bits for any number of threads and any order") {
  const LossScene scene(160, 97, 9);
  double expected_value = 0;
  const std::vector<float> expected = evaluate(Executor<Host>(1), scene, expected_value);
  const auto same = [&](const std::vector<float>& gradient) {
    return std::memcmp(gradient.data(), expected.data(), expected.size() * sizeof(float)) == 0;
  };
  for (const int threads : {2, 5}) {
    double value = 0;
    CHECK(same(evaluate(Executor<Host>(threads), scene, value)));
    CHECK(value == expected_value);
  }
  for (const ExecutionOrder order : {ExecutionOrder::descending, ExecutionOrder::shuffled}) {
    Executor<CheckedHost> executor(1);
    executor.order = order;
    double value = 0;
    CHECK(same(evaluate(executor, scene, value)));
    CHECK(value == expected_value);
  }
}
