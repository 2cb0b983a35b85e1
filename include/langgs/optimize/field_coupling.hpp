// SPDX-License-Identifier: Apache-2.0
#pragma once

/// @file Whether the feature loss moves geometry.

namespace langgs {

/// Features follow geometry and do not move it: the paper's decoupled fields (section 3.4). Costs nothing.
struct DecoupledFields {
  static constexpr bool kCoupled = false;
};

/// In iterations with a feature step, the gradient of L_feat also reaches geometry and pose through the Top-K weights.
struct CoupledFields {
  static constexpr bool kCoupled = true;
  float weight = 1;  ///< lambda_feat beside the geometric loss
};

}  // namespace langgs
