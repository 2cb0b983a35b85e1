// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "common/dataset.hpp"

namespace langgs::examples {

/// Everything that the command line of langgs_slam says.
struct RunOptions {
  DatasetOptions dataset;
  std::filesystem::path output;
  int max_frames = 0;  ///< 0: all
  int stride = 1;
  int hold_out = 0;  ///< every Nth frame is kept out of mapping; 0: none

  std::string tracking = "gicp";
  std::string depth_sensor = "structured-light";
  std::string features = "auto";  ///< auto: labels on the built-in data set, none elsewhere
  std::filesystem::path class_features;
  std::string npy_layout = "hwd";
  int feature_dim = 0;  ///< 0: that of --class-features, else 512
  int feature_stride = 4;
  int top_k = 3;
  std::string feature_render = "topk";
  std::string feature_optimizer = "average";

  std::string mode = "lockstep";
  int iterations = 10;
  int final_iterations = 0;
  double fps = 0;
  int keyframe_memory = 4096;  ///< [MiB]
  std::string schedule = "hybrid";
  int feature_every = 4;
  bool no_pruning = false, no_redundancy = false, no_pose_refinement = false;

  std::string device = "host";
  int threads = 1;
  std::uint64_t seed = 0;
  bool no_pictures = false;

  [[nodiscard]] bool realtime() const { return mode == "realtime"; }
  [[nodiscard]] bool has_features() const { return features != "none"; }
};

/// Raised for --help and --version: the text goes to standard output, the exit code is 0.
struct HelpRequested {
  std::string text;
};

/// Reads the command line. Throws InvalidArgument with one line, or HelpRequested.
[[nodiscard]] RunOptions parse_options(int argc, const char* const* argv);

/// The options that change the result, by their names on the command line.
[[nodiscard]] nlohmann::ordered_json to_json(const RunOptions& options);

}  // namespace langgs::examples
