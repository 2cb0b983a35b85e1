// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "langgs/optimize/colour_loss.hpp"
#include "langgs/optimize/depth_loss.hpp"

namespace langgs {

/// A planar RGB-D image. Rendered: colour and depth as blended. Target: colour in [0, 1], depth 0 where not measured.
/// Both arrays are read up to 32 elements past their end, which a Buffer allows.
struct ImageView {
  const float* colour = nullptr;  ///< [3, height, width]
  const float* depth = nullptr;   ///< [height, width], metres
  int width = 0, height = 0;
};

/// Where a loss leaves its gradient.
struct ImageGradientView {
  float* colour = nullptr;  ///< [3, height, width]
  float* depth = nullptr;   ///< [height, width], 1/m
};

/// L_geo = (1 - ssim) L1 + ssim (1 - SSIM) + depth * L1(depth). The paper gives no numbers. lambda_1 is its backbone's;
/// lambda_2 is ten times the backbone's, because dark surfaces turn transparent before the black background otherwise.
struct GeometricLossWeights {
  float ssim = 0.2f;   ///< lambda_1, in [0, 1]
  float depth = 0.1f;  ///< lambda_2 [1/m]
  /// Leave pixels without measured depth out of the colour terms too, as the backbone does. With false, colour is
  /// trained wherever the camera saw something.
  bool mask_colour_by_depth = true;
};

inline void validate(const GeometricLossWeights& w) {
  LANGGS_EXPECTS(w.ssim >= 0 && w.ssim <= 1, "SSIM weight is ", w.ssim, "; it must be in [0, 1]");
  LANGGS_EXPECTS(w.depth >= 0 && w.depth < 1e6f, "depth weight is ", w.depth, " per metre; it must not be negative");
}

/// The terms of one evaluation, before their weights.
struct GeometricLossTerms {
  double l1 = 0;     ///< mean |C - C*|
  double dssim = 0;  ///< 1 - SSIM
  double depth = 0;  ///< mean |D - D*| [m]
  double total = 0;
};

/// The geometric reconstruction loss with its gradient (paper section 3.4, Eq. L_geo).
/// Owns its scratch memory: no allocation after the first image of a size.
template <class Backend = Host>
class GeometricLoss {
 public:
  explicit GeometricLoss(GeometricLossWeights weights = {}) : weights_(weights) { validate(weights_); }

  [[nodiscard]] const GeometricLossWeights& weights() const { return weights_; }
  /// Of the last evaluation; waits for it.
  [[nodiscard]] GeometricLossTerms terms() const {
    GeometricLossTerms terms;
    if (!started_) return terms;
    const auto colour_terms = colour_.terms();
    terms.l1 = colour_terms.l1;
    terms.dssim = colour_terms.dssim;
    terms.depth = depth_.value();
    terms.total = (1 - static_cast<double>(weights_.ssim)) * terms.l1 +
                  static_cast<double>(weights_.ssim) * terms.dssim + static_cast<double>(weights_.depth) * terms.depth;
    return terms;
  }

  /// Returns L_geo, and waits for it; otherwise `start`.
  double evaluate(const Executor<Backend>& executor, const ImageView& rendered, const ImageView& target,
                  const ImageGradientView& gradient) {
    start(executor, rendered, target, gradient);
    return terms().total;
  }

  /// Overwrites `gradient` with the derivatives of L_geo by rendered colour and depth. Same bits for any number of
  /// threads. Throws InvalidArgument if sizes differ or an array is missing.
  void start(const Executor<Backend>& executor, const ImageView& rendered, const ImageView& target,
             const ImageGradientView& gradient) {
    LANGGS_EXPECTS(rendered.width == target.width && rendered.height == target.height, "rendered image is ",
                   rendered.width, "x", rendered.height, ", the target ", target.width, "x", target.height,
                   "; render at the target's size");
    LANGGS_EXPECTS(gradient.colour && gradient.depth, "a gradient image is null; pass [3, H, W] and [H, W] to write");
    const float* mask = weights_.mask_colour_by_depth ? target.depth : nullptr;
    const MaskedImages colour{rendered.colour, target.colour, mask, rendered.width, rendered.height, 3};
    const MaskedImages depth{rendered.depth, target.depth, target.depth, rendered.width, rendered.height, 1};
    validate(depth);
    colour_.start(executor, colour, weights_.ssim, gradient.colour);
    depth_.start(executor, depth, weights_.depth, gradient.depth);
    started_ = true;
  }

 private:
  GeometricLossWeights weights_;
  ColourLoss<Backend> colour_;
  DepthLoss<Backend> depth_;
  bool started_ = false;
};

}  // namespace langgs
