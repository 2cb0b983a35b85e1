// SPDX-License-Identifier: Apache-2.0
// EXPECT: FeatDim must be in
#include "langgs/frame/feature_map.hpp"

langgs::FeatureMap<0> map;
