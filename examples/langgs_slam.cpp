// SPDX-License-Identifier: Apache-2.0
// Maps an RGB-D sequence and writes the map, the trajectory, the figures and pictures. `langgs_slam --help` explains.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <optional>
#include <string>

#include "common/class_vectors.hpp"
#include "common/dataset.hpp"
#include "common/evaluation.hpp"
#include "common/options.hpp"
#include "common/pictures.hpp"
#include "common/pipeline.hpp"
#include "common/progress.hpp"
#include "common/results.hpp"
#include "langgs/core/error.hpp"
#include "langgs/io/tum_trajectory.hpp"
#include "langgs/version.hpp"

namespace langgs::examples {
namespace {

namespace fs = std::filesystem;

double seconds() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

/// The frames of a run in their order: which of the data set, and whether they are held out.
struct Selection {
  std::vector<int> frames;
  int hold_out = 0;

  Selection(const RunOptions& options, int size) : hold_out(options.hold_out) {
    for (int i = 0; i < size && (options.max_frames == 0 || count() < options.max_frames);) {
      frames.push_back(i);
      if (i > size - 1 - options.stride) break;
      i += options.stride;
    }
  }
  [[nodiscard]] int count() const { return static_cast<int>(frames.size()); }
  /// The last of each `hold_out` frames, so that the first frame of all can begin the map.
  [[nodiscard]] bool is_held_out(int k) const { return hold_out > 0 && (k + 1) % hold_out == 0; }
};

/// One run of langgs_slam, stage by stage.
class Run {
 public:
  explicit Run(RunOptions options)
      : options_(std::move(options)),
        dataset_(open_dataset(options_.dataset)),
        selection_(options_, dataset_->size()),
        class_vectors_(load_class_vectors(options_, *dataset_)),
        pipeline_(make_pipeline(options_, *dataset_, class_vectors_)) {
    if (options_.tracking == "given") {
      reference_ = dataset_->reference();
      LANGGS_EXPECTS(!reference_.empty(), "--tracking given: the data set has no poses (groundtruth.txt or traj.txt); ",
                     "use --tracking gicp");
    }
    std::error_code error;
    fs::create_directories(options_.output / "renders", error);
    if (error)
      detail::raise<IoError>("cannot make --output ", options_.output.string(), ": ", error.message(),
                             "; choose another folder");
    std::cout << "data set: " << dataset_->description() << '\n';
  }

  /// Returns the exit code.
  int execute() {
    map_sequence();
    costs_.peak_rss_mb = peak_rss_mb();
    save();
    if (pipeline_->keyframes().empty()) {
      if (failure_.empty())
        failure_ = "no frame could be mapped: " + (reason_.empty() ? "the run was stopped" : reason_);
      write_text(options_.output / "metrics.json", metrics(Evaluation{}));
      detail::raise<IoError>(failure_);
    }
    const Evaluation evaluation = score();
    write_text(options_.output / "metrics.json", metrics(evaluation));
    draw(evaluation);
    summarise(evaluation);
    if (!failure_.empty()) detail::raise<IoError>(failure_, "; the map of the frames before it was saved");
    return 0;
  }

 private:
  /// Frame k of the run, with a pose only where poses are given.
  [[nodiscard]] RgbdFrame load(int k) const {
    RgbdFrame frame = dataset_->frame(selection_.frames[k]);
    if (options_.tracking == "given")
      frame.T_world_camera = pose_at(reference_, frame.timestamp, options_.dataset.max_gap);
    return frame;
  }

  void map_sequence() {
    catch_interrupts();
    Progress progress("frame");
    const auto observe = [&](const FrameReport& report) {
      if (report.keyframe != KeyframeKind::none) ++num_keyframes_;
      if (!report.reason.empty()) {
        if (reason_.empty()) reason_ = report.reason;
        progress.note(detail::concat("frame ", report.frame_index, ": ", report.reason));
      }
      char detail[96];
      std::snprintf(detail, sizeof(detail), "keyframes %d  Gaussians %d  loss %.4f", num_keyframes_,
                    report.num_gaussians, report.loss);
      progress.update(report.frame_index + 1, selection_.count(), detail);
    };
    const double start = seconds();
    try {
      if (options_.realtime())
        map_realtime(observe);
      else
        map_lockstep(observe);
    } catch (const Error& error) {
      // What was mapped so far is worth keeping.
      failure_ = error.what();
    }
    costs_.wall_s = seconds() - start;
    costs_.interrupted = interrupted();
  }

  template <class Observe>
  void map_lockstep(const Observe& observe) {
    for (int k = 0; k < selection_.count() && !interrupted(); ++k) {
      const double start = seconds();
      const RgbdFrame frame = load(k);
      costs_.input_s += seconds() - start;
      observe(pipeline_->process(frame, {k + 1 == selection_.count(), selection_.is_held_out(k)}));
    }
    if (!interrupted()) pipeline_->finish();
  }

  template <class Observe>
  void map_realtime(const Observe& observe) {
    int next = 0;
    pipeline_->run_realtime(
        [&](RgbdFrame& frame) {
          if (next >= selection_.count() || interrupted()) return false;
          frame = load(next++);
          return true;
        },
        [&](const FrameReport& report) {
          observe(report);
          return !interrupted();
        },
        options_.fps);
  }

  void save() {
    trajectory_ = pipeline_->trajectory();
    pipeline_->save_map(options_.output / "map.safetensors", map_metadata(options_, *dataset_));
    write_ply(options_.output / "map.ply", pipeline_->splats());
    std::vector<StampedPose> keyframes;
    for (const KeyframeView& k : pipeline_->keyframes()) keyframes.push_back({k.timestamp, k.T_world_camera});
    write_tum_trajectory(options_.output / "trajectory.txt", trajectory_);
    write_tum_trajectory(options_.output / "keyframes.txt", keyframes);
  }

  /// Keyframes, then held-out frames.
  [[nodiscard]] std::vector<EvaluatedView> views() const {
    std::vector<EvaluatedView> views;
    for (const KeyframeView& k : pipeline_->keyframes())
      views.push_back({selection_.frames[k.frame_index], false, k.T_world_camera});
    const std::vector<StampedPose> refined = pipeline_->refined_trajectory();
    for (int k = 0; k < static_cast<int>(refined.size()); ++k)
      if (selection_.is_held_out(k)) views.push_back({selection_.frames[k], true, refined[k].T_world_camera});
    return views;
  }

  [[nodiscard]] int num_labels() const {
    return class_vectors_.empty() ? 0 : static_cast<int>(class_vectors_.size()) / options_.feature_dim;
  }

  Evaluation score() {
    Progress progress("scoring view");
    const bool interrupted_before = interrupted();
    return evaluate(*pipeline_,
                    {*dataset_, views(), trajectory_, class_vectors_, num_labels(), options_.tracking == "gicp"},
                    [&](int done, int total) {
                      progress.update(done, total);
                      return interrupted_before || !interrupted();
                    });
  }

  [[nodiscard]] std::string metrics(const Evaluation& evaluation) const {
    return metrics_json(options_, *dataset_, *pipeline_, evaluation, costs_).dump(2) + "\n";
  }

  void draw(const Evaluation& evaluation) {
    if (options_.no_pictures) return;
    const SlamStatistics s = pipeline_->statistics();
    PictureInput input{*dataset_,
                       views_to_show(views()),
                       trajectory_,
                       class_vectors_,
                       options_.has_features() ? options_.feature_dim : 0,
                       {},
                       {}};
    const std::string what = options_.dataset.kind == "synthetic"
                                 ? "synthetic room"
                                 : fs::weakly_canonical(options_.dataset.input).filename().string();
    input.title = detail::concat("langgs: ", what);
    input.subtitle = detail::concat(s.frames, " frames, ", s.keyframes, " keyframes, ", s.gaussians, " Gaussians",
                                    figures(evaluation, ", "));
    pictures_ = write_pictures(*pipeline_, input, options_.output / "renders");
  }

  /// The main figures, each after `separator`.
  [[nodiscard]] static std::string figures(const Evaluation& e, const std::string& separator) {
    std::string text;
    const auto add = [&](const char* format, double value) {
      char words[96];
      std::snprintf(words, sizeof(words), format, value);
      text += separator + words;
    };
    if (e.ate) add("ATE RMSE %.2f cm", 100 * e.ate->rmse_m);
    if (e.keyframes.psnr_valid_depth) add("PSNR %.2f dB", *e.keyframes.psnr_valid_depth);
    if (e.keyframes.ssim) add("SSIM %.3f", *e.keyframes.ssim);
    if (e.keyframes.depth_l1_m) add("depth L1 %.2f cm", 100 * *e.keyframes.depth_l1_m);
    if (e.held_out.psnr_valid_depth) add("held-out PSNR %.2f dB", *e.held_out.psnr_valid_depth);
    if (e.semantic_keyframes) add("mIoU %.3f", e.semantic_keyframes->mean_iou);
    if (e.semantic_keyframes) add("pixel accuracy %.3f", e.semantic_keyframes->accuracy);
    return text;
  }

  void summarise(const Evaluation& evaluation) const {
    const SlamStatistics s = pipeline_->statistics();
    char speed[64];
    std::snprintf(speed, sizeof(speed), "%.1f s, %.2f frames/s", costs_.wall_s,
                  s.frames / std::max(1e-9, costs_.wall_s - costs_.input_s));
    std::cout << (costs_.interrupted ? "stopped after " : "mapped ") << s.frames << " frames: " << s.keyframes
              << " keyframes, " << s.gaussians << " Gaussians, " << speed << figures(evaluation, "\n  ") << '\n';
    if (s.lost_frames + s.skipped_frames > 0)
      std::cout << "  " << s.lost_frames << " frames lost (found again " << s.relocalizations << " times), "
                << s.skipped_frames << " skipped (first: " << reason_ << ")\n";
    const std::string out = options_.output.string();
    if (!pictures_.empty()) std::cout << "look at " << pictures_.front().string() << '\n';
    std::cout << "figures: " << out << "/metrics.json, map: " << out << "/map.ply (any splat viewer) and " << out
              << "/map.safetensors, poses: " << out << "/trajectory.txt\n";
  }

  RunOptions options_;
  std::unique_ptr<Dataset> dataset_;
  Selection selection_;
  std::vector<float> class_vectors_;
  std::unique_ptr<Pipeline> pipeline_;
  std::vector<StampedPose> reference_;  ///< only where poses are given
  std::vector<StampedPose> trajectory_;
  std::vector<fs::path> pictures_;
  RunCosts costs_;
  std::string failure_, reason_;
  int num_keyframes_ = 0;
};

}  // namespace
}  // namespace langgs::examples

int main(int argc, char** argv) {
  try {
    return langgs::examples::Run(langgs::examples::parse_options(argc, argv)).execute();
  } catch (const langgs::examples::HelpRequested& help) {
    std::cout << help.text;
    return 0;
  } catch (const std::bad_alloc&) {
    std::cerr << "langgs_slam: out of memory; use fewer or smaller frames, or a smaller --feature-dim\n";
  } catch (const std::exception& error) {
    std::cerr << "langgs_slam: " << error.what() << '\n';
  }
  return 2;
}
