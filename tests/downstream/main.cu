// SPDX-License-Identifier: Apache-2.0
// A user's kernel on langgs' executor. Built where there is nvcc; running it takes a GPU.
#include <cstdio>
#include <langgs/device/copy.hpp>
#include <langgs/device/launch.hpp>

struct Double {
  float* values;
  LANGGS_HD void operator()(int i) const { values[i] *= 2; }
};

int main() {
  using namespace langgs;
  const Executor<Cuda> executor{gpu::Stream()};
  Buffer<float, Cuda> values(executor, 100);
  values.fill(executor, 21.f);
  for_each_n(executor, 100, Double{values.data()});
  float last = 0;
  copy_to_host(executor, values.data() + 99, 1, &last);
  std::printf("%g\n", static_cast<double>(last));
  return last == 42.f ? 0 : 1;
}
