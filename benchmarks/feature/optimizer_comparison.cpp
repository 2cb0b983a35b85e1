// SPDX-License-Identifier: Apache-2.0
// Which feature optimiser learns faster in the same time? Builds a map of the built-in room from given poses, fixes its
// geometry, and lets each optimiser learn from the same initial features, those of insertion, and the same random
// sequence of keyframes. Prints what each has reached after so much processor time of its own feature steps, one
// thread, recording excluded: the mean cosine to the teachers, and the fraction of pixels whose label is right in views
// of the whole path, most of which are not keyframes.
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <string>
#include <utility>
#include <vector>

#include "langgs/frame/label_features.hpp"
#include "langgs/frame/synthetic_room.hpp"
#include "langgs/optimize/feature_adam.hpp"
#include "langgs/slam/slam.hpp"

namespace langgs::benchmarks {
namespace {

constexpr int kDim = 512, kTopK = 3, kViews = 7;

struct Settings {
  int frames = 120;
  double noise = 0;
  float adam_rate = FeatureAdam<>().rate;
};

/// What all optimisers share.
struct Scene {
  explicit Scene(const Settings& settings) : room({.frames = settings.frames}) {
    LabelFeatures<kDim> features{[this](const RgbdFrame& frame) { return room.labels(frame); }, class_vectors, {}};
    features.settings.noise = settings.noise;
    SlamSettings slam_settings;
    slam_settings.tracking.poses = PoseSource::given;
    LangGsSlam<kDim, kTopK, PruningPolicy, GeometrySchedule> slam(room.camera(), slam_settings);
    for (int i = 0; i < room.size(); ++i) slam.process(room.frame(i), features, {.is_last = i + 1 == room.size()});
    for (int i = 0; i < slam.map().size(); ++i) gaussians.push_back(slam.map()[i]);
    keyframes = slam.keyframes();

    TopKRasterizer<kTopK> rasterizer;
    for (const Keyframe<kDim>& k : keyframes) {
      rasterizer.render(executor, slam.map().geometry(), View(room.camera(), k.T_world_camera));
      contributions.emplace_back().from_topk(
          executor, rasterizer, {k.features.width(), k.features.height(), room.camera()}, k.features.present());
    }
    for (int v = 0; v < kViews; ++v) {
      const int frame = (2 * v + 1) * room.size() / (2 * kViews);
      views.emplace_back(room.camera(), room.ground_truth(frame));
      labels.push_back(room.labels(frame));
    }
  }

  const Executor<Host> executor;
  SyntheticRoom room;
  const std::vector<float> class_vectors = SyntheticRoom::class_vectors<kDim>();
  std::vector<Gaussian<kDim>> gaussians;
  std::vector<Keyframe<kDim>> keyframes;
  std::vector<Contributions<Host>> contributions;  ///< of the teachers' pixels, by keyframe
  std::vector<View> views;
  std::vector<Image<std::uint16_t>> labels;  ///< the true ones of the views
};

template <class Optimizer>
class Learner {
 public:
  Learner(std::string name, const Scene& scene, const Optimizer& optimizer)
      : name_(std::move(name)), scene_(&scene), optimizer_(optimizer) {
    map_.append(scene.gaussians, 0, 0);
  }

  [[nodiscard]] const std::string& name() const { return name_; }

  /// Steps until all steps together have taken so long.
  void learn(double milliseconds) {
    const CounterRng rng{1, 0};
    const auto count = static_cast<std::uint32_t>(scene_->keyframes.size());
    while (1e3 * static_cast<double>(ticks_) / CLOCKS_PER_SEC < milliseconds) {
      const std::uint32_t k = rng.below(static_cast<std::uint64_t>(steps_++), count);
      const std::clock_t start = std::clock();
      step_.step(scene_->executor, optimizer_, map_, scene_->contributions[k].view(), scene_->keyframes[k].features);
      ticks_ += std::clock() - start;
    }
  }

  void print() {
    TeacherCosine cosine;
    for (std::size_t k = 0; k < scene_->keyframes.size(); ++k)
      cosine.add<kDim>(scene_->executor, scene_->contributions[k].view(), map_.features().data(),
                       scene_->keyframes[k].features.pixel(0, 0));
    std::size_t right = 0, all = 0;
    for (std::size_t v = 0; v < scene_->views.size(); ++v) {
      const Image<std::uint16_t> labels =
          renderer_.labels(scene_->executor, map_, scene_->views[v], scene_->class_vectors);
      for (std::size_t p = 0; p < labels.size(); ++p) right += labels.data()[p] == scene_->labels[v].data()[p];
      all += labels.size();
    }
    std::printf(" | %5d %.4f %5.2f%%", steps_, cosine.mean(),
                100. * static_cast<double>(right) / static_cast<double>(all));
  }

 private:
  std::string name_;
  const Scene* scene_;
  Optimizer optimizer_;
  GaussianMap<kDim, Host, Optimizer> map_;
  FeatureStep<kDim, Optimizer> step_;
  ViewRenderer<kDim, kTopK> renderer_;
  std::clock_t ticks_ = 0;
  int steps_ = 0;
};

template <class... Learners>
void compare(Learners&&... learners) {
  std::printf("%7s", "ms");
  (std::printf(" | %-20s", learners.name().c_str()), ...);
  std::printf("\n%7s", "");
  for (std::size_t i = 0; i < sizeof...(learners); ++i) std::printf(" | %5s %6s %6s", "steps", "cosine", "labels");
  for (const int ms : {0, 10, 20, 50, 100, 200, 500, 1000, 2000}) {
    std::printf("\n%7d", ms);
    (learners.learn(ms), ...);
    (learners.print(), ...);
    std::fflush(stdout);
  }
  std::printf("\n");
}

void run(const Settings& settings) {
  const Scene scene(settings);
  std::printf("%zu Gaussians, D = %d, %zu keyframes, teachers %dx%d, noise %g, Adam's rate %g\n",
              scene.gaussians.size(), kDim, scene.keyframes.size(), scene.keyframes[0].features.width(),
              scene.keyframes[0].features.height(), settings.noise, static_cast<double>(settings.adam_rate));
  const auto adam = [&](auto optimizer) {
    optimizer.rate = settings.adam_rate;
    return optimizer;
  };
  compare(Learner("average, half", scene, FeatureAverage<Half>()),
          Learner("average, float", scene, FeatureAverage<float>()),
          Learner("Adam, float", scene, adam(FeatureAdam<float>())),
          Learner("Adam, half", scene, adam(FeatureAdam<Half>())));
}

}  // namespace
}  // namespace langgs::benchmarks

int main(int argc, char** argv) {
  if (argc > 4 || (argc > 1 && std::atoi(argv[1]) < 1)) {
    std::fprintf(stderr, "Usage: optimizer_comparison [FRAMES [NOISE [ADAM_RATE]]]  (default: 120 0 0.001)\n");
    return 2;
  }
  langgs::benchmarks::Settings settings;
  if (argc > 1) settings.frames = std::atoi(argv[1]);
  if (argc > 2) settings.noise = std::atof(argv[2]);
  if (argc > 3) settings.adam_rate = static_cast<float>(std::atof(argv[3]));
  langgs::benchmarks::run(settings);
  return 0;
}
