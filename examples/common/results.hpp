// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <string>

#include "common/evaluation.hpp"
#include "common/options.hpp"
#include "common/pipeline.hpp"

namespace langgs::examples {

/// What the clock and the system said about a run.
struct RunCosts {
  double wall_s = 0;   ///< from the first frame to the last mapping iteration
  double input_s = 0;  ///< the part of it that went into reading or drawing frames, in lockstep
  double peak_rss_mb = 0;
  bool interrupted = false;
};

/// Largest memory of this process so far [MiB].
[[nodiscard]] double peak_rss_mb();

/// metrics.json. What was not measured is absent.
[[nodiscard]] nlohmann::ordered_json metrics_json(const RunOptions& options, const Dataset& dataset,
                                                  const Pipeline& pipeline, const Evaluation& evaluation,
                                                  const RunCosts& costs);

/// What map.safetensors says about itself: format version, camera, settings. Nothing that differs between equal runs.
[[nodiscard]] std::map<std::string, std::string> map_metadata(const RunOptions& options, const Dataset& dataset);

/// Writes text as a file that appears complete or not at all.
void write_text(const std::filesystem::path& path, const std::string& text);

}  // namespace langgs::examples
