// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>

namespace langgs {

/// One 3D Gaussian of the map with its language feature (paper section 3.1), as a plain value.
template <int FeatDim>
struct Gaussian {
  static_assert(FeatDim >= 1 && FeatDim <= 4096, "FeatDim must be in [1, 4096]; LSeg and CLIP ViT-B/32 use 512");
  static constexpr int kFeatDim = FeatDim;

  Eigen::Vector3f mean = Eigen::Vector3f::Zero();             ///< world coordinates [m]
  Eigen::Vector3f log_scale = Eigen::Vector3f::Constant(-4);  ///< ln of the standard deviations along the axes [ln m]
  Eigen::Vector4f rotation = Eigen::Vector4f(1, 0, 0, 0);     ///< quaternion w, x, y, z; normalised when used
  float opacity_logit = 0;                                    ///< opacity = 1 / (1 + exp(-logit))
  Eigen::Vector3f colour = Eigen::Vector3f::Constant(0.5f);   ///< RGB in [0, 1]; no spherical harmonics
  std::array<float, FeatDim> feature{};                       ///< language feature; its direction is what counts
};

}  // namespace langgs
