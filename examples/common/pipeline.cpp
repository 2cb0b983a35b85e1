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

std::unique_ptr<Pipeline> make_pipeline(const RunOptions& options, const Dataset& dataset,
                                        const std::vector<float>& class_vectors) {
  const int dim = options.has_features() ? options.feature_dim : 1;
#if defined(LANGGS_EXAMPLES_CUDA)
  if (options.device == "cuda") {
    const bool averages = !options.has_features() || options.feature_optimizer == "average";
    std::unique_ptr<Pipeline> on_cuda = averages ? make_pipeline_cuda(options, dataset, class_vectors) : nullptr;
    LANGGS_EXPECTS(on_cuda, "--device cuda with --feature-dim ", dim, ", --top-k ", options.top_k,
                   " and --feature-optimizer ", options.feature_optimizer,
                   " is not compiled in; use --feature-dim 16 or 512, --top-k 3 and average, or add it in "
                   "examples/common/pipeline_cuda.cu");
    return on_cuda;
  }
#endif
  if (options.has_features() && options.feature_optimizer == "adam") {
    LANGGS_EXPECTS(dim == 512 && options.top_k == 3,
                   "--feature-optimizer adam is compiled in for --feature-dim 512 and ", "--top-k 3 alone, not for ",
                   dim, " and ", options.top_k,
                   "; choose average, or add a file like examples/common/pipeline_d512_adam.cpp");
    return make_pipeline_d512_adam(options, dataset, class_vectors);
  }
  std::unique_ptr<Pipeline> pipeline = dim == 1     ? make_pipeline_d1(options, dataset, class_vectors)
                                       : dim == 16  ? make_pipeline_d16(options, dataset, class_vectors)
                                       : dim == 64  ? make_pipeline_d64(options, dataset, class_vectors)
                                       : dim == 512 ? make_pipeline_d512(options, dataset, class_vectors)
                                                    : nullptr;
  const bool known_dim = dim == 1 || dim == 16 || dim == 64 || dim == 512;
  LANGGS_EXPECTS(pipeline || !known_dim, "--top-k ", options.top_k, " is not compiled in for ", dim,
                 "-dimensional features; choose ", supported_k_text(), ", or add it in examples/common/pipeline_d", dim,
                 ".cpp");
  LANGGS_EXPECTS(pipeline, "feature dimension ", dim, " is not compiled in; choose one of ", supported_dims_text(),
                 ", or add a file like examples/common/pipeline_d512.cpp");
  return pipeline;
}

}  // namespace langgs::examples
