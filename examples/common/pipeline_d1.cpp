// SPDX-License-Identifier: Apache-2.0
#include "common/pipeline_dims.hpp"
#include "common/pipeline_of.hpp"

namespace langgs::examples {

// Without features nobody looks at K.
std::unique_ptr<Pipeline> make_pipeline_d1(const RunOptions& options, const Dataset& dataset,
                                           const std::vector<float>& class_vectors) {
  return pipeline_with_k<1, FeatureAverage<>, Host, 3>(options, dataset, class_vectors);
}

}  // namespace langgs::examples
