// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

#include "langgs/optimize/masked_images.hpp"

namespace langgs {
namespace detail {

/// One plane of the L1 loss: adds |r - t| to the pixel's value and writes scale * sign(r - t), 0 where they are equal.
struct L1Plane {
  const float* rendered;
  const float* target;
  const float* depth;
  float scale;
  float* value;
  float* gradient;
  bool first;  ///< the first plane begins the pixel's value, later planes add to it

  template <class Lanes>
  LANGGS_HD void operator()(const Lanes& lanes) const {
    using V = typename Lanes::template Varying<float>;
    V difference = lanes.load(rendered) - lanes.load(target);
    if (depth) difference = select(is_measured(lanes.load(depth)), difference, V(0.f));
    const V sign = select(difference > 0.f, V(scale), select(difference < 0.f, V(-scale), V(0.f)));
    lanes.store(gradient, sign);
    const V magnitude = abs(difference);
    lanes.store(value, first ? magnitude : lanes.load(value) + magnitude);
  }
};

}  // namespace detail

/// Mean absolute difference, first term of the paper's L_geo.
/// Masked pixels count as equal: the divisor is planes * height * width, as in the backbone (A.11.2). Dividing by the
/// number of measured pixels instead would give those of a frame with little depth more weight than others'.
template <class Backend = Host>
class L1Loss {
 public:
  /// Returns the loss; writes weight * d loss / d rendered to `gradient` [planes, height, width].
  double evaluate(const Executor<Backend>& executor, const MaskedImages& images, float weight, float* gradient) {
    validate(images);
    const int n = images.num_pixels();
    const double count = static_cast<double>(n) * images.planes;
    sum_.resize(n);
    for (int p = 0; p < images.planes; ++p) {
      const std::ptrdiff_t offset = static_cast<std::ptrdiff_t>(p) * n;
      for_each_lanes(executor, n,
                     detail::L1Plane{images.rendered + offset, images.target + offset, images.depth,
                                     static_cast<float>(weight / count), sum_.values(), gradient + offset, p == 0});
    }
    return sum_.total(executor) / count;
  }

 private:
  detail::ImageSum<Backend> sum_;
};

}  // namespace langgs
