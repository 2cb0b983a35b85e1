// SPDX-License-Identifier: Apache-2.0
#include "common/pipeline_dims.hpp"
#include "common/pipeline_of.hpp"

namespace langgs::examples {

std::unique_ptr<Pipeline> make_pipeline_cuda(const RunOptions& options, const Dataset& dataset,
                                             const std::vector<float>& class_vectors) {
  std::unique_ptr<Pipeline> pipeline = pipeline_with_k<1, FeatureAverage<>, Cuda, 3>(options, dataset, class_vectors);
  if (!pipeline) pipeline = pipeline_with_k<16, FeatureAverage<>, Cuda, 3>(options, dataset, class_vectors);
  if (!pipeline) pipeline = pipeline_with_k<512, FeatureAverage<>, Cuda, 3>(options, dataset, class_vectors);
  return pipeline;
}

}  // namespace langgs::examples
