// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <doctest/doctest.h>

#include <cmath>
#include <limits>

#include "langgs/frame/rgbd_frame.hpp"

/// @file What LangGsSlam relies on in a source of frames. For a type of your own, in one source file, with a
/// default-constructible type whose `make()` gives a source of at least one frame:
///
///   #include "conformance/frame_source.hpp"
///   struct MyMaker { MySource make() const { return MySource("some/folder"); } };
///   TEST_CASE_TEMPLATE_INVOKE(langgs_frame_source_conformance, MyMaker);
///
/// At most 20 frames are read, so a live camera conforms too.

TEST_CASE_TEMPLATE_DEFINE("frame source conformance", Maker, langgs_frame_source_conformance) {
  using namespace langgs;
  auto source = Maker{}.make();
  static_assert(FrameSource<decltype(source)>, "see the concept FrameSource: camera() and bool next(RgbdFrame&)");
  const Camera camera = source.camera();
  CHECK_NOTHROW(validate(camera));

  RgbdFrame frame;  // reused, as LangGsSlam::run_realtime does
  double last = -std::numeric_limits<double>::infinity();
  int frames = 0, measured = 0;
  bool more = true;
  while (frames < 20 && (more = source.next(frame))) {
    ++frames;
    CAPTURE(frames);
    REQUIRE(frame.colour.width() == camera.width);
    REQUIRE(frame.colour.height() == camera.height);
    REQUIRE(frame.colour.channels() == 3);
    REQUIRE(frame.depth.width() == camera.width);
    REQUIRE(frame.depth.height() == camera.height);
    REQUIRE(frame.depth.channels() == 1);
    CHECK(std::isfinite(frame.timestamp));
    CHECK(frame.timestamp >= last);
    last = frame.timestamp;
    if (frame.T_world_camera) {
      const Eigen::Matrix3d r = frame.T_world_camera->linear();
      CHECK(is_finite(*frame.T_world_camera));
      CHECK((r * r.transpose()).isApprox(Eigen::Matrix3d::Identity(), 1e-6));
      CHECK(r.determinant() > 0);
    }
    for (std::size_t i = 0; i < frame.depth.size(); ++i) {
      REQUIRE_FALSE(frame.depth.data()[i] < 0);
      REQUIRE_FALSE(frame.depth.data()[i] > 1e4f);  // millimetres, or the sensor's code for "nothing"?
      measured += frame.depth.data()[i] > 0;
    }
    CHECK(source.camera() == camera);
  }
  CHECK(frames >= 1);
  CHECK(measured > 0);
  if (!more) CHECK_FALSE(source.next(frame));  // an end stays an end
}
