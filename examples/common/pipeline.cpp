// SPDX-License-Identifier: Apache-2.0
#include "common/pipeline.hpp"

#include "common/options.hpp"
#include "common/pipeline_dims.hpp"
#include "langgs/core/error.hpp"
#include "langgs/slam/settings.hpp"

namespace langgs::examples {

SlamSettings slam_settings(const RunOptions& o) {
  SlamSettings s;
  s.tracking.poses = o.tracking == "given" ? PoseSource::given : PoseSource::gicp;
  if (o.depth_sensor == "time-of-flight") s.tracking.source = time_of_flight(s.tracking.source);
  s.mapping.refine_poses = !o.no_pose_refinement;
  if (o.no_redundancy) s.mapping.redundancy.squared_distance = 0;
  s.mapping.feature_rendering = o.feature_render == "blend" ? FeatureRendering::blend : FeatureRendering::topk;
  s.mapping.keyframe_bytes = static_cast<std::size_t>(o.keyframe_memory) << 20;
  s.iterations_per_frame = o.iterations;
  s.final_iterations = o.final_iterations;
  s.num_threads = o.threads;
  s.seed = o.seed;
  return s;
}

bool has_cuda() {
#if defined(LANGGS_EXAMPLES_CUDA)
  return true;
#else
  return false;
#endif
}
std::string supported_dims_text() { return "16, 64, 512"; }
std::string supported_k_text() { return "3, or with --feature-dim 512 also 1, 5, 10"; }

namespace {

std::string supported_text(const RunOptions& options) {
  if (options.device == "cuda") return "--feature-dim 16 or 512, --top-k 3 and --feature-optimizer average";
  if (options.feature_optimizer == "adam") return "--feature-dim 512 and --top-k 3, or --feature-optimizer average";
  return "--feature-dim " + supported_dims_text() + " and --top-k " + supported_k_text();
}

}  // namespace

std::unique_ptr<Pipeline> make_pipeline(const RunOptions& options, const Dataset& dataset,
                                        const std::vector<float>& class_vectors) {
  std::unique_ptr<Pipeline> pipeline;
  for (PipelineFactory* const make : {LANGGS_EXAMPLE_FACTORIES})
    if (!pipeline) pipeline = make(options, dataset, class_vectors);
  LANGGS_EXPECTS(pipeline, "--feature-dim ", options.has_features() ? options.feature_dim : 1, ", --top-k ",
                 options.top_k, ", --feature-optimizer ", options.feature_optimizer, " and --device ", options.device,
                 " are not compiled in together; choose ", supported_text(options),
                 ", or add a file like examples/common/pipeline_d512.cpp and name it in LANGGS_EXAMPLE_PIPELINES");
  return pipeline;
}

}  // namespace langgs::examples
