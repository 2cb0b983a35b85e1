// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "langgs/optimize/l1_loss.hpp"

namespace langgs {

/// Mean absolute difference of rendered and measured depth [m], last term of the paper's L_geo.
/// Pixels without a measurement count as equal; the divisor is height * width (A.11.4).
template <class Backend = Host>
class DepthLoss {
 public:
  /// `images` are [1, height, width] in metres; its mask is the target itself, whatever `images.depth` says.
  /// Returns the loss [m]; writes weight * d loss / d rendered to `gradient` [height, width].
  double evaluate(const Executor<Backend>& executor, MaskedImages images, float weight, float* gradient) {
    LANGGS_EXPECTS(images.planes == 1, "depth images have ", images.planes, " planes; they must have 1");
    images.depth = images.target;
    return l1_.evaluate(executor, images, weight, gradient);
  }

 private:
  L1Loss<Backend> l1_;
};

}  // namespace langgs
