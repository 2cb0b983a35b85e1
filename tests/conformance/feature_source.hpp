// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <doctest/doctest.h>

#include <cmath>

#include "langgs/frame/feature_map.hpp"

/// @file What LangGsSlam relies on in a source of feature maps. For a type of your own, in one source file, with a
/// default-constructible type that says the dimension and makes a source and frames to ask it about:
///
///   #include "conformance/feature_source.hpp"
///   struct MyMaker {
///     static constexpr int kDim = 512;
///     MyEncoder make() const { return MyEncoder("weights"); }
///     langgs::RgbdFrame frame(int i) const;
///   };
///   TEST_CASE_TEMPLATE_INVOKE(langgs_feature_source_conformance, MyMaker);

TEST_CASE_TEMPLATE_DEFINE("feature source conformance", Maker, langgs_feature_source_conformance) {
  using namespace langgs;
  const Maker maker{};
  auto source = maker.make();
  static_assert(FeatureSource<decltype(source), Maker::kDim>,
                "see the concept FeatureSource: FeatureMap<FeatDim> operator()(const RgbdFrame&)");

  SUBCASE("every pixel is a unit vector or zeros") {
    for (int i = 0; i < 2; ++i) {
      const RgbdFrame frame = maker.frame(i);
      const FeatureMap<Maker::kDim> map = source(frame);
      if (map.empty()) continue;
      for (int y = 0; y < map.height(); ++y)
        for (int x = 0; x < map.width(); ++x) {
          double norm2 = 0;
          for (int c = 0; c < Maker::kDim; ++c) norm2 += std::pow(static_cast<double>(float(map.pixel(x, y)[c])), 2);
          CAPTURE(x);
          CAPTURE(y);
          const bool unit_or_zero = norm2 == 0 || std::abs(norm2 - 1) < 0.01;
          REQUIRE(unit_or_zero);
        }
    }
  }
  SUBCASE("the same frame gives the same map") {
    const RgbdFrame frame = maker.frame(0);
    const FeatureMap<Maker::kDim> first = source(frame);
    static_cast<void>(source(maker.frame(1)));
    const FeatureMap<Maker::kDim> again = source(frame);
    REQUIRE(again.width() == first.width());
    REQUIRE(again.height() == first.height());
    bool same = true;
    for (int y = 0; y < first.height(); ++y)
      for (int x = 0; x < first.width(); ++x)
        for (int c = 0; c < Maker::kDim; ++c) same = same && float(first.pixel(x, y)[c]) == float(again.pixel(x, y)[c]);
    CHECK(same);
  }
}
