// SPDX-License-Identifier: Apache-2.0
#include "common/options.hpp"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <thread>

#include "common/pipeline.hpp"
#include "langgs/core/error.hpp"
#include "langgs/version.hpp"

namespace langgs::examples {

namespace {

constexpr int kMany = 100'000'000;

void add_dataset_options(CLI::App& app, RunOptions& o) {
  const std::string group = "Data set";
  app.add_option("--dataset", o.dataset.kind, "synthetic: a built-in room; tum, replica: a folder of either layout")
      ->check(CLI::IsMember({"synthetic", "tum", "replica"}))
      ->capture_default_str()
      ->group(group);
  app.add_option("--input", o.dataset.input, "folder of the sequence (tum, replica)")->group(group);
  app.add_option("--distortion", o.dataset.distortion,
                 "auto: coefficients of calibration.txt, else those of fr1/fr2 by the folder's name; none; or five "
                 "numbers \"k1 k2 p1 p2 k3\". Colour and depth are undistorted on load")
      ->capture_default_str()
      ->group(group);
  app.add_option(
         "--depth-delay", o.dataset.depth_delay,
         "tum: seconds by which depth images are stamped too late, or auto: 0.02 for fr1 and fr2 by the folder's "
         "name, else 0. Depth is moved to where the camera was when colour was taken")
      ->capture_default_str()
      ->group(group);
  app.add_option("--max-gap", o.dataset.max_gap, "largest time between a colour image and its depth image [s]")
      ->check(CLI::Range(0.0, 1e3))
      ->capture_default_str()
      ->group(group);
  app.add_option("--max-frames", o.max_frames, "stop after so many frames; 0: all")
      ->check(CLI::Range(0, kMany))
      ->capture_default_str()
      ->group(group);
  app.add_option("--stride", o.stride, "take every Nth frame")
      ->check(CLI::Range(1, kMany))
      ->capture_default_str()
      ->group(group);
  app.add_option("--hold-out", o.hold_out,
                 "keep every Nth frame out of mapping, to score novel views; it is still tracked; 0: none")
      ->check(CLI::Range(0, kMany))
      ->capture_default_str()
      ->group(group);
  SyntheticRoomSettings& room = o.dataset.room;
  app.add_option("--width", room.width, "synthetic: image width [px]")
      ->check(CLI::Range(8, 4096))
      ->capture_default_str()
      ->group(group);
  app.add_option("--height", room.height, "synthetic: image height [px]")
      ->check(CLI::Range(8, 4096))
      ->capture_default_str()
      ->group(group);
  app.add_option("--frames", room.frames, "synthetic: length of the path; longer ones see more of the room")
      ->check(CLI::Range(1, 100000))
      ->capture_default_str()
      ->group(group);
  app.add_option("--room-seed", room.seed, "synthetic: seed of the room and its noise")
      ->capture_default_str()
      ->group(group);
  app.add_option("--motion", room.motion, "synthetic: speed of the camera; 1 is about 1.5 cm and 0.9 degrees a frame")
      ->check(CLI::Range(0.05, 10.0))
      ->capture_default_str()
      ->group(group);
  app.add_flag("--depth-noise", room.depth_noise, "synthetic: depth errors like those of a Kinect")->group(group);
  app.add_option("--colour-noise", room.colour_noise, "synthetic: standard deviation of colour noise [8-bit levels]")
      ->check(CLI::Range(0.0, 64.0))
      ->capture_default_str()
      ->group(group);
}

void add_method_options(CLI::App& app, RunOptions& o) {
  const std::string group = "Method";
  app.add_option("--tracking", o.tracking, "gicp: track the camera; given: map with the data set's own poses")
      ->check(CLI::IsMember({"gicp", "given"}))
      ->capture_default_str()
      ->group(group);
  app.add_option("--depth-sensor", o.depth_sensor,
                 "how depth noise grows, by which tracking weighs points: structured-light (with the square of the "
                 "distance) or time-of-flight (with the distance)")
      ->check(CLI::IsMember({"structured-light", "time-of-flight"}))
      ->capture_default_str()
      ->group(group);
  app.add_option("--features", o.features,
                 "none; labels: the vector of each pixel's class; texture: computed from the image; npy:DIR: a file "
                 "NAME.npy for each keyframe; auto: labels on the built-in data set, else none")
      ->check([](const std::string& value) {
        const bool known = value == "auto" || value == "none" || value == "labels" || value == "texture" ||
                           (value.starts_with("npy:") && value.size() > 4);
        return known ? std::string{} : "'" + value + "' is none of none, labels, texture, npy:DIR";
      })
      ->capture_default_str()
      ->group(group);
  app.add_option("--class-features", o.class_features,
                 "labels: .npy [classes + 1, D] with one row for each label from 0 on, or [classes, D] from 1 on")
      ->group(group);
  app.add_option("--npy-layout", o.npy_layout, "npy:DIR: hwd for [H, W, D], dhw for [D, H, W]")
      ->check(CLI::IsMember({"hwd", "dhw"}))
      ->capture_default_str()
      ->group(group);
  app.add_option("--feature-dim", o.feature_dim,
                 "D, one of " + supported_dims_text() + "; without it that of --class-features, else 512")
      ->check(CLI::Range(1, 4096))
      ->group(group);
  app.add_option("--feature-stride", o.feature_stride, "labels, texture: image pixels per feature pixel")
      ->check(CLI::Range(1, 256))
      ->capture_default_str()
      ->group(group);
  app.add_option("--top-k", o.top_k, "K, the Gaussians that make up a pixel's feature: " + supported_k_text())
      ->check(CLI::Range(1, 16))
      ->capture_default_str()
      ->group(group);
  app.add_option("--feature-render", o.feature_render, "topk, or blend: all Gaussians, the baseline without Top-K")
      ->check(CLI::IsMember({"topk", "blend"}))
      ->capture_default_str()
      ->group(group);
  app.add_option(
         "--feature-optimizer", o.feature_optimizer,
         "average: each Gaussian keeps the mean of its teachers, features in half precision; adam: the paper's, "
         "features and moments in full precision")
      ->check(CLI::IsMember({"average", "adam"}))
      ->capture_default_str()
      ->group(group);
  app.add_option("--schedule", o.schedule, "hybrid: features less often than geometry; joint: both always")
      ->check(CLI::IsMember({"hybrid", "joint"}))
      ->capture_default_str()
      ->group(group);
  app.add_option("--feature-every", o.feature_every, "hybrid: a feature step in every Nth mapping iteration")
      ->check(CLI::Range(1, kMany))
      ->capture_default_str()
      ->group(group);
  app.add_flag("--no-pruning", o.no_pruning, "never remove Gaussians")->group(group);
  app.add_flag("--no-redundancy", o.no_redundancy, "insert Gaussians also where the map has them already")
      ->group(group);
  app.add_flag("--no-pose-refinement", o.no_pose_refinement, "leave keyframe poses as tracked")->group(group);
}

void add_run_options(CLI::App& app, RunOptions& o) {
  const std::string group = "Run";
  app.add_option("--output", o.output, "folder for the results; made if needed")->required()->group(group);
  app.add_option("--mode", o.mode,
                 "lockstep: a fixed number of mapping iterations per frame, reproducible bit for bit; realtime: "
                 "tracking and mapping in threads of their own")
      ->check(CLI::IsMember({"lockstep", "realtime"}))
      ->capture_default_str()
      ->group(group);
  app.add_option("--iterations", o.iterations, "lockstep: mapping iterations per frame")
      ->check(CLI::Range(0, 100000))
      ->capture_default_str()
      ->group(group);
  app.add_option("--final-iterations", o.final_iterations, "lockstep: mapping iterations after the last frame")
      ->check(CLI::Range(0, kMany))
      ->capture_default_str()
      ->group(group);
  app.add_option("--fps", o.fps, "realtime: playback rate; 0: as fast as possible")
      ->check(CLI::Range(0.0, 1e6))
      ->capture_default_str()
      ->group(group);
  app.add_option("--device", o.device,
                 std::string("where mapping and rendering run: host or cuda") +
                     (has_cuda() ? "" : " (not in this build, which was made without CUDA)"))
      ->check(CLI::IsMember({"host", "cuda"}))
      ->capture_default_str()
      ->group(group);
  app.add_option("--threads", o.threads, "worker threads; results do not depend on it")
      ->check(CLI::Range(1, 1024))
      ->capture_default_str()
      ->group(group);
  app.add_option("--keyframe-memory", o.keyframe_memory,
                 "most that keyframes may hold [MiB]; beyond it feature maps go first, then images, those of the most "
                 "visited keyframes first")
      ->check(CLI::Range(1, 1 << 20))
      ->capture_default_str()
      ->group(group);
  app.add_option("--seed", o.seed, "seed of keyframe choice and pruning")->capture_default_str()->group(group);
  app.add_flag("--no-pictures", o.no_pictures, "write no pictures under renders/")->group(group);
}

/// What no single option can check.
void check_together(const CLI::App& app, const RunOptions& o, const std::string& resume) {
  const auto given = [&](const char* name) { return app.count(name) > 0; };
  LANGGS_EXPECTS(o.device == "host" || has_cuda(), "--device ", o.device,
                 ": this program was built without CUDA; configure with -DLANGGS_ENABLE_CUDA=ON, or use --device host");
  LANGGS_EXPECTS(resume.empty(), "--resume: going on from a saved map is not available yet; run the sequence again");
  for (const double value : {o.fps, o.dataset.max_gap, o.dataset.room.motion, o.dataset.room.colour_noise})
    LANGGS_EXPECTS(std::isfinite(value), "an option is ", value, "; give finite numbers");
  LANGGS_EXPECTS(!given("--fps") || o.realtime(), "--fps needs --mode realtime");
  LANGGS_EXPECTS(!o.realtime() || (!given("--iterations") && !given("--final-iterations")),
                 "--iterations and --final-iterations need --mode lockstep; in real time mapping never stops");
  LANGGS_EXPECTS(!o.realtime() || o.hold_out == 0, "--hold-out needs --mode lockstep");
  LANGGS_EXPECTS(o.hold_out != 1, "--hold-out 1 would leave no frame for mapping; give 2 or more, or 0 for none");
  LANGGS_EXPECTS(o.dataset.kind != "synthetic" || !given("--input"),
                 "--dataset synthetic reads no --input; choose tum or replica to read a folder");
  for (const char* name :
       {"--width", "--height", "--frames", "--room-seed", "--motion", "--depth-noise", "--colour-noise"})
    LANGGS_EXPECTS(o.dataset.kind == "synthetic" || !given(name), name, " needs --dataset synthetic");
  LANGGS_EXPECTS(!given("--class-features") || o.features == "labels" || o.features.starts_with("npy:"),
                 "--class-features needs --features labels or npy:DIR");
  LANGGS_EXPECTS(o.has_features() || !given("--top-k"), "--top-k needs --features labels, texture or npy:DIR");
  LANGGS_EXPECTS(o.has_features() || !given("--feature-dim"),
                 "--feature-dim needs --features labels, texture or npy:DIR");
  LANGGS_EXPECTS(o.has_features() || !given("--feature-optimizer"),
                 "--feature-optimizer needs --features labels, texture or npy:DIR");
  LANGGS_EXPECTS(o.schedule == "hybrid" || !given("--feature-every"), "--feature-every needs --schedule hybrid");
}

}  // namespace

RunOptions parse_options(int argc, const char* const* argv) {
  RunOptions o;
  o.threads = std::clamp(static_cast<int>(std::thread::hardware_concurrency()), 1, 1024);
  std::string resume;
  CLI::App app{"langgs_slam: maps an RGB-D sequence with 3D Gaussians that carry language features"};
  app.set_version_flag("--version", std::string("langgs ") + kVersion);
  app.option_defaults()->multi_option_policy(CLI::MultiOptionPolicy::TakeLast);
  add_run_options(app, o);
  add_dataset_options(app, o);
  add_method_options(app, o);
  app.add_option("--resume", resume, "a saved map to go on from (not available yet)")->group("Run");
  try {
    app.parse(argc, argv);
  } catch (const CLI::CallForHelp&) {
    throw HelpRequested{app.help()};
  } catch (const CLI::CallForVersion& version) {
    throw HelpRequested{std::string(version.what()) + "\n"};
  } catch (const CLI::ParseError& error) {
    std::string what = error.what();
    std::replace(what.begin(), what.end(), '\n', ' ');
    detail::raise<InvalidArgument>(what, "; see langgs_slam --help");
  }
  if (o.features == "auto") o.features = o.dataset.kind == "synthetic" ? "labels" : "none";
  check_together(app, o, resume);
  o.dataset.num_threads = o.threads;
  return o;
}

nlohmann::ordered_json to_json(const RunOptions& o) {
  nlohmann::ordered_json j;
  j["dataset"] = o.dataset.kind;
  if (o.dataset.kind == "synthetic") {
    const SyntheticRoomSettings& room = o.dataset.room;
    j["width"] = room.width;
    j["height"] = room.height;
    j["frames"] = room.frames;
    j["room-seed"] = room.seed;
    j["motion"] = room.motion;
    j["depth-noise"] = room.depth_noise;
    j["colour-noise"] = room.colour_noise;
  } else {
    j["input"] = o.dataset.input.string();
    j["distortion"] = o.dataset.distortion;
    j["depth-delay"] = o.dataset.depth_delay;
    j["max-gap"] = o.dataset.max_gap;
  }
  j["max-frames"] = o.max_frames;
  j["stride"] = o.stride;
  j["hold-out"] = o.hold_out;
  j["tracking"] = o.tracking;
  if (o.tracking == "gicp") j["depth-sensor"] = o.depth_sensor;
  j["features"] = o.features;
  if (o.has_features()) {
    if (!o.class_features.empty()) j["class-features"] = o.class_features.string();
    if (o.features.starts_with("npy:")) j["npy-layout"] = o.npy_layout;
    j["feature-dim"] = o.feature_dim;
    j["feature-stride"] = o.feature_stride;
    j["feature-render"] = o.feature_render;
    j["feature-optimizer"] = o.feature_optimizer;
    j["schedule"] = o.schedule;
    if (o.schedule == "hybrid") j["feature-every"] = o.feature_every;
  }
  j["top-k"] = o.top_k;
  j["mode"] = o.mode;
  if (o.realtime()) {
    j["fps"] = o.fps;
  } else {
    j["iterations"] = o.iterations;
    j["final-iterations"] = o.final_iterations;
  }
  j["no-pruning"] = o.no_pruning;
  j["no-redundancy"] = o.no_redundancy;
  j["no-pose-refinement"] = o.no_pose_refinement;
  j["keyframe-memory"] = o.keyframe_memory;
  j["device"] = o.device;
  j["threads"] = o.threads;
  j["seed"] = o.seed;
  return j;
}

}  // namespace langgs::examples
