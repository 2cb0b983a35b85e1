// SPDX-License-Identifier: Apache-2.0
#include "common/results.hpp"

#include <sys/resource.h>

#include <algorithm>
#include <cmath>

#include "langgs/io/atomic_file.hpp"
#include "langgs/version.hpp"

namespace langgs::examples {

namespace {

using Json = nlohmann::ordered_json;

/// Five significant digits: more is noise.
double rounded(double value) {
  if (value == 0 || !std::isfinite(value)) return value;
  const double scale = std::pow(10.0, 4 - std::floor(std::log10(std::abs(value))));
  return std::round(value * scale) / scale;
}

/// The value below which a share of the samples lies (nearest rank). `values` must not be empty.
double quantile(std::vector<float> values, double share) {
  const auto rank = static_cast<std::size_t>(std::ceil(share * static_cast<double>(values.size())));
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(rank > 0 ? rank - 1 : 0);
  std::nth_element(values.begin(), at, values.end());
  return rounded(*at);
}

Json to_json(const ImageScore& score) {
  Json j;
  j["views"] = score.views;
  if (score.psnr_valid_depth) j["psnr_db"] = rounded(*score.psnr_valid_depth);
  if (score.psnr_all) j["psnr_all_db"] = rounded(*score.psnr_all);
  if (score.ssim) j["ssim"] = rounded(*score.ssim);
  if (score.depth_l1_m) j["depth_l1_cm"] = rounded(100 * *score.depth_l1_m);
  return j;
}

Json to_json(const SemanticScore& score) {
  Json j;
  j["accuracy"] = rounded(score.accuracy);
  j["miou"] = rounded(score.mean_iou);
  return j;
}

Json timing_json(const SlamStatistics& s, const RunCosts& costs) {
  Json j;
  j["wall_s"] = rounded(costs.wall_s);
  if (costs.input_s > 0) j["input_s"] = rounded(costs.input_s);
  const double busy = costs.wall_s - costs.input_s;
  if (s.frames > 0 && busy > 0) j["system_fps"] = rounded(s.frames / busy);
  if (!s.track_ms.empty()) j["track_ms"] = {{"median", quantile(s.track_ms, 0.5)}, {"p95", quantile(s.track_ms, 0.95)}};
  if (!s.geometry_ms.empty()) j["map_iteration_ms"]["geometry"] = quantile(s.geometry_ms, 0.5);
  if (!s.feature_ms.empty()) j["map_iteration_ms"]["feature"] = quantile(s.feature_ms, 0.5);
  if (!s.geometry_ms.empty()) j["map_iteration_p95_ms"]["geometry"] = quantile(s.geometry_ms, 0.95);
  if (!s.feature_ms.empty()) j["map_iteration_p95_ms"]["feature"] = quantile(s.feature_ms, 0.95);
  return j;
}

Json memory_json(const Pipeline& pipeline, int num_gaussians, const RunCosts& costs) {
  Json j;
  j["peak_rss_mb"] = rounded(costs.peak_rss_mb);
  std::size_t map_bytes = 0;
  for (const auto& [part, bytes] : pipeline.map_memory_report()) map_bytes += bytes;
  if (num_gaussians > 0) j["map_bytes_per_gaussian"] = rounded(static_cast<double>(map_bytes) / num_gaussians);
  for (const auto& [part, bytes] : pipeline.memory_report()) j["bytes_by_part"][part] = bytes;
  return j;
}

Json camera_json(const Camera& c) {
  return {{"fx", c.fx}, {"fy", c.fy}, {"cx", c.cx}, {"cy", c.cy}, {"width", c.width}, {"height", c.height}};
}

}  // namespace

double peak_rss_mb() {
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024;  // Linux counts in KiB
}

nlohmann::ordered_json metrics_json(const RunOptions& options, const Dataset& dataset, const Pipeline& pipeline,
                                    const Evaluation& evaluation, const RunCosts& costs) {
  const SlamStatistics s = pipeline.statistics();
  Json j;
  j["frames"] = s.frames;
  j["keyframes"] = s.keyframes;
  j["gaussians"] = s.gaussians;
  j["iterations"] = {{"geometry", s.geometry_iterations}, {"feature", s.feature_iterations}};
  j["lost_frames"] = s.lost_frames;
  j["relocalizations"] = s.relocalizations;
  j["skipped_frames"] = s.skipped_frames;
  j["inserted"] = s.inserted;
  j["suppressed"] = s.suppressed;
  j["pruned"] = s.pruned;
  if (costs.interrupted) j["interrupted"] = true;
  if (evaluation.ate)
    j["ate"] = {{"protocol", "ate_umeyama_se3"},
                {"rmse_cm", rounded(100 * evaluation.ate->rmse_m)},
                {"mean_cm", rounded(100 * evaluation.ate->mean_m)},
                {"max_cm", rounded(100 * evaluation.ate->max_m)},
                {"matched", evaluation.ate->matched}};
  if (evaluation.keyframes.views + evaluation.held_out.views > 0) {
    Json& image = j["image"];
    image["protocols"] = {{"psnr_db", "psnr_valid_depth"},
                          {"psnr_all_db", "psnr_all"},
                          {"ssim", "ssim_11_gauss"},
                          {"depth_l1_cm", "depth_l1"}};
    if (evaluation.keyframes.views > 0) image["keyframes"] = to_json(evaluation.keyframes);
    if (evaluation.held_out.views > 0) image["held_out"] = to_json(evaluation.held_out);
  }
  if (evaluation.semantic_keyframes) {
    Json& semantic = j["semantic"];
    semantic["protocol"] = "labels_full";
    semantic.update(to_json(*evaluation.semantic_keyframes));
    if (evaluation.semantic_held_out) semantic["held_out"] = to_json(*evaluation.semantic_held_out);
  }
  if (evaluation.teacher_cosine) j["semantic"]["teacher_cosine"] = rounded(*evaluation.teacher_cosine);
  j["timing"] = timing_json(s, costs);
  j["memory"] = memory_json(pipeline, s.gaussians, costs);
  j["config"] = examples::to_json(options);
  j["camera"] = camera_json(dataset.camera());
  j["dataset"] = dataset.description();
  j["version"] = kVersion;
  return j;
}

std::map<std::string, std::string> map_metadata(const RunOptions& options, const Dataset& dataset) {
  Json settings = examples::to_json(options);
  settings.erase("threads");  // the map does not depend on it
  std::map<std::string, std::string> metadata = {{"format", "langgs_map"},
                                                 {"format_version", "1"},
                                                 {"langgs_version", kVersion},
                                                 {"camera", camera_json(dataset.camera()).dump()},
                                                 {"settings", settings.dump()}};
  if (options.has_features()) {
    metadata["feature_model"] = options.class_features.empty()
                                    ? options.features
                                    : options.features + ":" + options.class_features.filename().string();
    metadata["feature_dim"] = std::to_string(options.feature_dim);
  }
  return metadata;
}

void write_text(const std::filesystem::path& path, const std::string& text) {
  AtomicFile file(path);
  file.write(text);
  file.commit();
}

}  // namespace langgs::examples
