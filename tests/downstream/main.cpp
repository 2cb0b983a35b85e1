// SPDX-License-Identifier: Apache-2.0
// A user with a feature dimension of their own.
#include <cstdio>
#include <vector>

#include "langgs/frame/feature_map.hpp"
#include "langgs/host/worker_pool.hpp"
#include "langgs/version.hpp"

int main() {
  constexpr int kDim = 48;
  langgs::FeatureMap<kDim> map(8, 6);
  std::vector<float> feature(kDim, 0.5f);
  map.set_pixel(3, 2, feature.data());

  const langgs::Camera camera{100, 100, 3.5f, 2.5f, 8, 6};
  langgs::validate(camera);
  std::vector<float> sampled(kDim);
  langgs::WorkerPool pool(2);
  pool.run(1, [&](int) { map.sample(3, 2, camera, sampled.data()); });

  std::printf("langgs %s: feature of norm^2 %.3f\n", langgs::kVersion, kDim * sampled[0] * sampled[0]);
  return sampled[0] > 0.14f && sampled[0] < 0.15f ? 0 : 1;
}
