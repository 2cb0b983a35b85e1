// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "langgs/optimize/masked_images.hpp"

namespace langgs {
namespace detail {

/// The L1 loss of one plane: writes scale * sign(rendered - target), and the sum of |rendered - target| over the block.
struct DepthL1 {
  static constexpr int kThreads = 256, kPixels = 4096;  ///< of a block
  template <class Block>
  using Shared = BlockSum<Block>;
  const float* rendered;
  const float* target;
  int num_pixels;
  float scale;
  float* gradient;
  float* sums;

  template <class Block>
  LANGGS_HD void operator()(Block& block, Shared<Block>& shared) const {
    using V = typename Block::template Varying<float>;
    const int begin = block.index() * kPixels, end = num_pixels - begin < kPixels ? num_pixels : begin + kPixels;
    block.warps([&](const auto& warp) {
      V sum(0.f);
      for (int first = begin + warp.index() * 32; first < end; first += kThreads) {
        const V measured = warp.load(target + first);
        V difference = select(is_measured(measured), warp.load(rendered + first) - measured, V(0.f));
        if (end - first < 32) difference = select(warp.lane_index() < end - first, difference, V(0.f));
        const V pull = l1_gradient(difference, scale);
        if (end - first < 32)
          warp.template store_rect<32>(gradient + first, 0, end - first, 1, pull);
        else
          warp.store(gradient + first, pull);
        sum += abs(difference);
      }
      shared.parts.set(warp.index(), warp.sum(sum));
    });
    shared.write(block, sums + block.index());
  }
};

}  // namespace detail

/// Mean absolute difference of rendered and measured depth [m], last term of the paper's L_geo.
/// Pixels without a measurement count as equal; the divisor is height * width (A.11.4).
template <class Backend = Host>
class DepthLoss {
 public:
  /// `images` are [1, height, width] in metres; its mask is the target itself, whatever `images.depth` says.
  /// Writes weight * d loss / d rendered to `gradient` [height, width]; the `value` is known later.
  void start(const Executor<Backend>& executor, const MaskedImages& images, float weight, float* gradient) {
    validate(images);
    LANGGS_EXPECTS(images.planes == 1, "depth images have ", images.planes, " planes; they must have 1");
    num_pixels_ = images.num_pixels();
    const int num_blocks = (num_pixels_ + detail::DepthL1::kPixels - 1) / detail::DepthL1::kPixels;
    sums_.resize_discard(executor, num_blocks);
    launch(executor, num_blocks,
           detail::DepthL1{images.rendered, images.target, num_pixels_, weight / static_cast<float>(num_pixels_),
                           gradient, sums_.data()});
    read_sums_.start(executor, sums_.data(), num_blocks);
  }
  /// The loss of the last `start` [m]; waits for it.
  [[nodiscard]] double value() const {
    const float* const sums = read_sums_.values();
    double sum = 0;
    for (std::size_t i = 0; i < read_sums_.size(); ++i) sum += static_cast<double>(sums[i]);
    return sum / num_pixels_;
  }

 private:
  int num_pixels_ = 0;
  Buffer<float, Backend> sums_;
  Readback<float, Backend> read_sums_;
};

}  // namespace langgs
