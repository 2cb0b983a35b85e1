// SPDX-License-Identifier: Apache-2.0
// What the mapping loop does between rendering and the next rendering: the geometric loss with its gradient at 640x480,
// and Adam over 100k visible Gaussians, with 1 and 2 threads.
#include <benchmark/benchmark.h>

#include <cstddef>

#include "langgs/core/rng.hpp"
#include "langgs/optimize/adam.hpp"
#include "langgs/optimize/geometric_loss.hpp"
#include "langgs/render/topk_rasterizer.hpp"
#include "render/render_scene.hpp"

namespace {

using langgs::Buffer;
using langgs::Executor;
using langgs::Host;

/// `size` numbers in [low, low + 1); one in `gap` is zero if `gap` is positive.
Buffer<float, Host> random_numbers(std::size_t size, std::uint64_t stream, float low = 0, std::uint32_t gap = 0) {
  Buffer<float, Host> buffer(size);
  const langgs::CounterRng rng{1, stream};
  for (std::size_t i = 0; i < size; ++i)
    buffer.data()[i] =
        gap > 0 && rng.below(size + i, gap) == 0 ? 0.f : low + static_cast<float>(rng.uniform(static_cast<int>(i)));
  return buffer;
}

void geometric_loss(benchmark::State& state) {
  constexpr int kWidth = 640, kHeight = 480, kPixels = kWidth * kHeight;
  const auto rendered_colour = random_numbers(3 * kPixels, 1), target_colour = random_numbers(3 * kPixels, 2);
  const auto rendered_depth = random_numbers(kPixels, 3, 1), target_depth = random_numbers(kPixels, 4, 1, 8);
  Buffer<float, Host> colour_gradient(3 * kPixels), depth_gradient(kPixels);
  const Executor<Host> executor(static_cast<int>(state.range(0)));
  langgs::GeometricLoss<> loss;
  for (auto _ : state)
    benchmark::DoNotOptimize(loss.evaluate(executor, {rendered_colour.data(), rendered_depth.data(), kWidth, kHeight},
                                           {target_colour.data(), target_depth.data(), kWidth, kHeight},
                                           {colour_gradient.data(), depth_gradient.data()}));
}

/// The share of the map's Gaussians that is in sight, in percent, is range(1). The map has them in random order, which
/// no map of a sequence has: frames append rows that are seen together.
void selective_adam(benchmark::State& state) {
  constexpr int kVisible = 100'000;
  const double share = static_cast<double>(state.range(1)) / 100;
  langgs::test::SceneRanges ranges;
  ranges.near = 1, ranges.far = 2, ranges.thinnest = 1, ranges.thickest = 1.5;
  ranges.border = (1 / std::sqrt(share) - 1) / 2;
  const auto scene = langgs::test::random_scene(640, 480, static_cast<int>(kVisible / share), ranges, 1);
  langgs::GaussianMap<1> map = scene.map();
  const langgs::View view = scene.view();
  const Executor<Host> executor(static_cast<int>(state.range(0)));
  langgs::TopKRasterizer<3> rasterizer;
  langgs::MapGradient<Host> gradient;
  const auto upstream = random_numbers(4 * static_cast<std::size_t>(scene.camera.num_pixels()), 5, -0.5f);
  rasterizer.render(executor, map.geometry(), view);
  rasterizer.backward(executor, map.geometry(),
                      {upstream.data(), upstream.data() + 3 * static_cast<std::size_t>(scene.camera.num_pixels())},
                      gradient);
  const langgs::SelectiveAdam<Host> adam;
  for (auto _ : state) adam.step(executor, map, gradient);
  state.counters["rows"] = gradient.size();
}

}  // namespace

BENCHMARK(geometric_loss)->ArgName("threads")->Arg(1)->Arg(2)->UseRealTime()->Unit(benchmark::kMillisecond);
BENCHMARK(selective_adam)
    ->ArgNames({"threads", "visible_percent"})
    ->ArgsProduct({{1, 2}, {40, 100}})
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK_MAIN();
