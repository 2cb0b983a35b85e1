// SPDX-License-Identifier: Apache-2.0
// Counts what the kernels of a mapping iteration and of a feature step work on: splats, instances, warps that blend,
// hits, rows. docs/roofline.md puts the counts into formulae. The folder LANGGS_WORKLOAD has gs.ply and cameras.txt;
// without it, 200 000 Gaussians of the built-in room are seen at 1200x680. Means over the views.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <vector>

#include "langgs/optimize/feature_hits.hpp"
#include "langgs/render/topk_rasterizer.hpp"
#include "workload.hpp"

namespace langgs::benchmarks {
namespace {

constexpr int kK = 3;

/// Blends every instance of a tile as TileForward does, and counts instead of writing.
struct BlendingWork {
  std::int64_t reached = 0;  ///< (warp, instance) pairs that are blended: the ellipse reaches a warp that goes on
  std::int64_t hits = 0;     ///< (pixel, instance) pairs with a weight
  std::int64_t read = 0;     ///< instances that a block loads before all of its pixels have stopped
  std::int64_t batches = 0;  ///< of 64

  void add(const SplatList<Host>& list, int tile) {
    constexpr int kBatch = 64, kWarps = TileGrid::kThreads / 32;
    const TileGrid& grid = list.grid();
    const InstanceView instances = list.instances();
    std::vector<float> transmittance(TileGrid::kThreads, -1.f);
    const int left = tile % grid.columns * TileGrid::kSize, top = tile / grid.columns * TileGrid::kSize;
    for (int t = 0; t < TileGrid::kThreads; ++t)
      if (left + t % TileGrid::kSize < grid.width && top + t / TileGrid::kSize < grid.height) transmittance[t] = 1.f;
    const auto goes_on = [&](int warp) {
      for (int t = 32 * warp; t < 32 * warp + 32; ++t)
        if (transmittance[t] > 0.f) return true;
      return false;
    };
    for (int first = instances.tile_begin[tile]; first < instances.tile_begin[tile + 1]; first += kBatch) {
      bool live[kWarps], any = false;
      for (int w = 0; w < kWarps; ++w) any = (live[w] = goes_on(w)) || any;
      if (!any) break;
      ++batches;
      for (int i = first; i < std::min(first + kBatch, instances.tile_begin[tile + 1]); ++i) {
        ++read;
        const Instance& instance = instances.sorted(i);
        const Splat& s = instances.splats[instance.splat];
        for (int w = instance.first_warp; w <= instance.last_warp; ++w) {
          if (!live[w]) continue;
          ++reached;
          for (int t = 32 * w; t < 32 * w + 32; ++t) {
            const SplatColumn<float> column(s, static_cast<float>(left + t % TileGrid::kSize));
            const BlendStep<float> step(Footprint<float>(s, column, static_cast<float>(top + t / TileGrid::kSize)),
                                        transmittance[t]);
            hits += step.weight > 0.f ? 1 : 0;
            transmittance[t] = step.next_transmittance;
          }
        }
      }
    }
  }
};

/// Gaussians in groups of eight, a sector of memory, that have a visible one: what a gather over a plane reads.
std::int64_t num_in_sectors(const SplatList<Host>& list) {
  std::int64_t sectors = 0;
  for (int c = 0; c < list.num_splats(); ++c)
    sectors += c == 0 || list.gaussian()[c] / 8 != list.gaussian()[c - 1] / 8 ? 1 : 0;
  return 8 * sectors;
}

struct FeatureWork {
  std::int64_t contributions = 0, touched = 0;
  void add(const Executor<Host>& executor, const TopKRasterizer<kK>& rasterizer, const Camera& camera, int divisor,
           int num_gaussians) {
    Contributions<Host> samples;
    samples.from_topk(executor, rasterizer, {camera.width / divisor, camera.height / divisor, camera});
    FeatureHits<Host> hits;
    hits.build(executor, samples.view(), num_gaussians);
    contributions += samples.view().size.most;
    touched += hits.view().num_touched.most;
  }
};

void count(const Workload& work) {
  const Executor<Host> executor;
  TopKRasterizer<kK> rasterizer;
  BlendingWork blending;
  FeatureWork full, quarter;
  std::int64_t splats = 0, sectors = 0, instances = 0, tiles = 0, pixels = 0;
  const int n = work.map.size(), views = static_cast<int>(work.views.size());
  for (const View& view : work.views) {
    rasterizer.render(executor, work.map.geometry(), view);
    const SplatList<Host>& list = rasterizer.splats();
    splats += list.num_splats();
    sectors += num_in_sectors(list);
    instances += list.num_instances();
    tiles += list.grid().count();
    pixels += view.camera.num_pixels();
    for (int tile = 0; tile < list.grid().count(); ++tile) blending.add(list, tile);
    full.add(executor, rasterizer, view.camera, 1, n);
    quarter.add(executor, rasterizer, view.camera, 2, n);
  }
  const auto line = [&](const char* what, std::int64_t sum) {
    std::printf("%-44s %12.0f\n", what, static_cast<double>(sum) / views);
  };
  line("N    Gaussians", static_cast<std::int64_t>(n) * views);
  line("P    pixels", pixels);
  line("T    tiles", tiles);
  line("V    visible splats", splats);
  line("X    Gaussians in sectors with a visible one", sectors);
  line("I    instances", instances);
  line("J    instances that are read", blending.read);
  line("B    batches of 64", blending.batches);
  line("W    blends of a warp", blending.reached);
  line("H    hits of a pixel", blending.hits);
  line("C    Top-3 contributions, every pixel", full.contributions);
  line("G    Gaussians that they touch", full.touched);
  line("C/4  Top-3 contributions, every other pixel", quarter.contributions);
  line("G/4  Gaussians that they touch", quarter.touched);
}

}  // namespace
}  // namespace langgs::benchmarks

int main() {
  using namespace langgs::benchmarks;
  const char* const folder = std::getenv("LANGGS_WORKLOAD");
  count(folder != nullptr ? read_workload(folder) : room_workload(200'000, 1200, 680));
}
