// SPDX-License-Identifier: Apache-2.0
#include "common/pipeline_dims.hpp"
#include "common/pipeline_of.hpp"

namespace langgs::examples {

std::unique_ptr<Pipeline> make_pipeline_d512_adam(const RunOptions& options, const Dataset& dataset,
                                                  const std::vector<float>& class_vectors) {
  return pipeline_with_k<512, FeatureAdam<>, Host, 3>(options, dataset, class_vectors);
}

}  // namespace langgs::examples
