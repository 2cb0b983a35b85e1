// SPDX-License-Identifier: Apache-2.0
#include "common/pipeline_dims.hpp"
#include "common/pipeline_of.hpp"

namespace langgs::examples {

std::unique_ptr<Pipeline> make_pipeline_d512(const RunOptions& options, const Dataset& dataset,
                                             const std::vector<float>& class_vectors) {
  return pipeline_with_k<512, FeatureAverage<>, Host, 1, 3, 5, 10>(options, dataset, class_vectors);
}

}  // namespace langgs::examples
