// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace langgs {

/// Adam step sizes by parameter group, and Adam's constants. No bias correction: see SelectiveAdam.
struct LearningRates {
  float mean = 2e-4f;  ///< [m]
  float log_scale = 5e-3f;
  float rotation = 1e-3f;  ///< on the stored quaternion
  float opacity_logit = 0.05f;
  float colour = 2.5e-3f;
  float feature = 1e-3f;
  float beta1 = 0.9f, beta2 = 0.999f;
  float epsilon = 1e-15f;
};

}  // namespace langgs
