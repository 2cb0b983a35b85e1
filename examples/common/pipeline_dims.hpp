// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "common/pipeline.hpp"

/// @file One factory and one source file for each feature dimension, so that they compile side by side, and one for
/// CUDA. Each gives null for options that it has no pipeline for. LANGGS_EXAMPLE_PIPELINES says to CMake which there
/// are.

namespace langgs::examples {

using PipelineFactory = std::unique_ptr<Pipeline>(const RunOptions&, const Dataset&, const std::vector<float>&);

PipelineFactory make_pipeline_d1, make_pipeline_d16, make_pipeline_d64, make_pipeline_d512, make_pipeline_d512_adam,
    make_pipeline_cuda;

}  // namespace langgs::examples
