// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

#include "langgs/render/tiles.hpp"

/// @file Losses on the blending weights themselves, as policies of the backward pass. With w_i = alpha_i T_i, a
/// gradient g_i = dL/dw_i of one (pixel, Gaussian) adds T_i g_i - sum over j behind i of w_j g_j / (1 - alpha_i) to
/// dL/dalpha_i: it joins what dL/dC . c_i + dL/dD z_i says about the splat.

namespace langgs {

/// The weights matter through colour and depth alone. Costs nothing.
struct NoWeightGradient {
  template <class Block, int kBatch>
  class Reader {
   public:
    using Warp = typename Block::Warp;
    using F = VaryingOf<float, Block>;
    struct Shared {};
    LANGGS_INLINE Reader(const NoWeightGradient&, const InstanceView&) {}
    LANGGS_INLINE void load(const Warp&, const WarpPixels<Block>&, std::ptrdiff_t, F&) {}
    LANGGS_INLINE void begin_batch(Block&, Shared&, int, int) const {}
    [[nodiscard]] LANGGS_INLINE int gaussian(const Shared&, int) const { return 0; }
    LANGGS_INLINE void add(const Warp&, int, F&) const {}
  };
};

/// dL/dw of the K recorded weights of every pixel; hits that are not recorded have none. Planes as TopKPlanes has them.
template <int K>
struct TopKWeightGradient {
  static_assert(K >= 1 && K <= 16, "TopKWeightGradient<K>: K must be in [1, 16], as in TopKRasterizer<K>");

  const std::int32_t* id = nullptr;  ///< [K, H, W] Gaussian index, -1 where empty; a Gaussian once a pixel at most
  const float* weight = nullptr;     ///< [K, H, W] the recorded weights, 0 where empty
  const float* gradient = nullptr;   ///< [K, H, W] dL/dw, finite; not used where empty

  /// What the pixels of a tile hold of the planes.
  template <class Block, int kBatch>
  class Reader {
   public:
    using Warp = typename Block::Warp;
    using F = VaryingOf<float, Block>;
    struct Shared {
      typename Block::template SharedArray<std::int32_t, kBatch> gaussian;
    };

    LANGGS_INLINE Reader(const TopKWeightGradient& planes, const InstanceView& instances)
        : planes_(planes), instances_(instances) {}

    /// Reads the pixels of a warp from planes of `plane` pixels, and adds sum_k w_k g_k to `behind`.
    LANGGS_INLINE void load(const Warp& warp, const WarpPixels<Block>& pixels, std::ptrdiff_t plane, F& behind) {
      LANGGS_UNROLL
      for (int k = 0; k < K; ++k) {
        const F g = pixels.load(warp, planes_.gradient + k * plane, 0.f);
        id_[k].store(warp, pixels.load(warp, planes_.id + k * plane, -1));
        gradient_[k].store(warp, g);
        behind += g * pixels.load(warp, planes_.weight + k * plane, 0.f);
      }
    }
    /// Before the n instances of the sorted list from `first` on; `sync` before the first use.
    LANGGS_INLINE void begin_batch(Block& block, Shared& shared, int first, int n) const {
      block.threads(n, [&](auto thread) LANGGS_INLINE_LAMBDA {
        shared.gaussian.set(thread.index, instances_.splat_gaussian[instances_.sorted(first + thread.index).splat]);
      });
    }
    [[nodiscard]] LANGGS_INLINE std::int32_t gaussian(const Shared& shared, int j) const { return shared.gaussian[j]; }
    /// Adds dL/dw of a Gaussian to `value`.
    LANGGS_INLINE void add(const Warp& warp, std::int32_t gaussian, F& value) const {
      LANGGS_UNROLL
      for (int k = 0; k < K; ++k) value += select(id_[k].load(warp) == gaussian, gradient_[k].load(warp), F(0.f));
    }

   private:
    const TopKWeightGradient& planes_;
    const InstanceView& instances_;
    typename Block::template PerThread<std::int32_t> id_[K];
    typename Block::template PerThread<float> gradient_[K];
  };
};

}  // namespace langgs
