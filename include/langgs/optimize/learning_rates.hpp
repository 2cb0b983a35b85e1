// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "langgs/core/error.hpp"

namespace langgs {

/// Adam step sizes of the geometry by parameter group, and Adam's constants. No bias correction: see SelectiveAdam.
struct LearningRates {
  float mean = 6e-5f;  ///< [m]; tracking registers to surfaces as measured and does not feel it (docs/benchmarks.md)
  float log_scale = 5e-3f;
  float rotation = 1e-3f;  ///< on the stored quaternion
  float opacity_logit = 0.05f;
  float colour = 2.5e-3f;
  float beta1 = 0.9f, beta2 = 0.999f;
  float epsilon = 1e-15f;
};

inline void validate(const LearningRates& r) {
  for (const float rate : {r.mean, r.log_scale, r.rotation, r.opacity_logit, r.colour})
    LANGGS_EXPECTS(rate >= 0 && rate <= 1e3f, "a learning rate is ", rate, "; it must be in [0, 1000]");
  LANGGS_EXPECTS(r.beta1 >= 0 && r.beta1 < 1 && r.beta2 >= 0 && r.beta2 < 1 && r.epsilon > 0, "Adam settings are ",
                 r.beta1, ", ", r.beta2, ", ", r.epsilon, "; betas must be in [0, 1), epsilon positive");
}

}  // namespace langgs
