// SPDX-License-Identifier: Apache-2.0
// A pipeline of one's own: K = 5, 96-dimensional features, another pruning rule, another source of frames.
#include <cstdio>

#include "langgs/frame/synthetic_room.hpp"
#include "langgs/frame/texture_features.hpp"
#include "langgs/slam/slam.hpp"

struct FadedPruning {  // every 100 iterations, what is almost transparent goes
  bool due(std::int64_t iteration) const { return iteration > 0 && iteration % 100 == 0; }
  langgs::PruningReport select(std::int64_t, const langgs::PruningStatistics& s,
                               std::vector<std::int32_t>& keep) const {
    keep.assign(s.size, 1);
    langgs::PruningReport report;
    for (int i = 0; i < s.size; ++i)
      if (s.geometry.plane(langgs::kOpacityLogit)[i] < -3) keep[i] = 0, ++report.num_transparent;
    return report;
  }
};

struct EverySecondFrame {  // stands for a camera; anything with camera() and next() will do
  langgs::SyntheticRoom room{{.width = 160, .height = 120, .frames = 24}};
  langgs::Camera camera() const { return room.camera(); }
  bool next(langgs::RgbdFrame& frame) { return room.next(frame) && room.next(frame); }
};

int main() {
  EverySecondFrame source;
  langgs::TextureFeatures<96> features;
  langgs::LangGsSlam<96, 5, FadedPruning> slam(source.camera(), langgs::SlamSettings{});
  for (langgs::RgbdFrame frame; source.next(frame);) slam.process(frame, features);
  slam.finish();
  std::printf("%d Gaussians with 96-dimensional features, %zu poses\n", slam.map().size(), slam.trajectory().size());
  return slam.map().size() > 0 ? 0 : 1;
}
