// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <concepts>

#include "langgs/core/half.hpp"
#include "langgs/host/backend.hpp"

namespace langgs {

namespace detail {

/// Stands for what is called with each array of a State. nvcc takes no lambda in a concept.
struct AnyArray {
  template <class Array>
  void operator()(Array&) const {}
};

}  // namespace detail

/// How a map keeps its features: as which numbers, and what a feature optimiser keeps beside each Gaussian.
/// `State` has `for_each_array(f)`, which calls f with each of its `Rows`; they grow and shrink with the map, and new
/// rows are zero.
template <class S>
concept FeatureStorage = (std::same_as<typename S::Scalar, float> ||
                          std::same_as<typename S::Scalar, Half>)&&requires(typename S::template State<8, Host> state) {
  state.for_each_array(detail::AnyArray{});
};

/// Features and nothing beside them, for maps that are looked at and not learnt.
template <class T = Half>
struct PlainFeatures {
  using Scalar = T;
  template <int FeatDim, class Backend>
  struct State {
    template <class F>
    void for_each_array(F&&) {}
  };
};

}  // namespace langgs
