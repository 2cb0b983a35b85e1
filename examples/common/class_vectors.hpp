// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "common/dataset.hpp"
#include "common/options.hpp"

namespace langgs::examples {

/// One unit vector for each label [labels, D], row 0 zeros: those of --class-features, else the data set's own; empty
/// where the run needs and has none. Settles options.feature_dim. Throws IoError or InvalidArgument.
[[nodiscard]] std::vector<float> load_class_vectors(RunOptions& options, const Dataset& dataset);

}  // namespace langgs::examples
