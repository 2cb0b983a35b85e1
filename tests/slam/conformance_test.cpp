// SPDX-License-Identifier: Apache-2.0
#include "conformance/feature_optimizer.hpp"
#include "conformance/feature_source.hpp"
#include "conformance/frame_source.hpp"
#include "conformance/pruning_policy.hpp"
#include "conformance/schedule.hpp"
#include "langgs/frame/label_features.hpp"
#include "langgs/frame/synthetic_room.hpp"
#include "langgs/frame/texture_features.hpp"
#include "langgs/optimize/feature_adam.hpp"
#include "langgs/optimize/feature_average.hpp"

using namespace langgs;

namespace {

SyntheticRoom room(bool noisy) {
  SyntheticRoomSettings settings;
  settings.width = 40;
  settings.height = 30;
  settings.frames = 4;
  settings.depth_noise = noisy;
  return SyntheticRoom(settings);
}

struct CleanRoom {
  [[nodiscard]] SyntheticRoom make() const { return room(false); }
};
struct NoisyRoom {
  [[nodiscard]] SyntheticRoom make() const { return room(true); }
};

struct Labels {
  static constexpr int kDim = 33;
  [[nodiscard]] LabelFeatures<kDim> make() const {
    LabelFeatureSettings settings;
    settings.noise = 0.3;
    return {[](const RgbdFrame& frame) { return room(false).labels(frame); }, SyntheticRoom::class_vectors<kDim>(),
            settings};
  }
  [[nodiscard]] RgbdFrame frame(int i) const { return room(false).frame(i); }
};
struct Texture {
  static constexpr int kDim = 20;
  [[nodiscard]] TextureFeatures<kDim> make() const { return TextureFeatures<kDim>(); }
  [[nodiscard]] RgbdFrame frame(int i) const { return room(false).frame(i); }
};
struct Nothing {
  static constexpr int kDim = 1;
  [[nodiscard]] NoFeatures make() const { return {}; }
  [[nodiscard]] RgbdFrame frame(int i) const { return room(false).frame(i); }
};

}  // namespace

TEST_CASE_TEMPLATE_INVOKE(langgs_pruning_policy_conformance, PruningPolicy, NoPruning);
TEST_CASE_TEMPLATE_INVOKE(langgs_schedule_conformance, HybridSchedule, JointSchedule, GeometrySchedule);
TEST_CASE_TEMPLATE_INVOKE(langgs_frame_source_conformance, CleanRoom, NoisyRoom);
TEST_CASE_TEMPLATE_INVOKE(langgs_feature_source_conformance, Labels, Texture, Nothing);
TEST_CASE_TEMPLATE_INVOKE(langgs_feature_optimizer_conformance, FeatureAverage<>, FeatureAverage<float>, FeatureAdam<>,
                          FeatureAdam<Half>);
