// SPDX-License-Identifier: Apache-2.0
#include "common/feature_sources.hpp"

#include <doctest/doctest.h>

#include <vector>

#include "temporary_folder.hpp"

using namespace langgs;
using namespace langgs::examples;

TEST_CASE("Feature maps of files in either layout") {
  const TemporaryFolder folder;
  // [2, 3, 4]: the value of channel c at (x, y) is 1 where c == x + y, else 0.
  std::vector<float> hwd(24, 0.f), dhw(24, 0.f);
  for (int y = 0; y < 2; ++y)
    for (int x = 0; x < 3; ++x) {
      hwd[(y * 3 + x) * 4 + x + y] = 5;
      dhw[((x + y) * 2 + y) * 3 + x] = 5;
    }
  write_npy(folder.path / "hwd.npy", {2, 3, 4}, hwd.data());
  write_npy(folder.path / "dhw.npy", {4, 2, 3}, dhw.data());
  for (const bool channels_first : {false, true}) {
    const FeatureMap<4> map =
        read_feature_map<4>(folder.path / (channels_first ? "dhw.npy" : "hwd.npy"), channels_first);
    REQUIRE(map.width() == 3);
    REQUIRE(map.height() == 2);
    for (int y = 0; y < 2; ++y)
      for (int x = 0; x < 3; ++x)
        for (int c = 0; c < 4; ++c) CHECK(float(map.pixel(x, y)[c]) == (c == x + y ? 1.f : 0.f));
  }
  CHECK_THROWS_AS((void)read_feature_map<4>(folder.path / "dhw.npy", false), IoError);
  CHECK_THROWS_AS((void)read_feature_map<5>(folder.path / "hwd.npy", false), IoError);
  CHECK_THROWS_AS((void)read_feature_map<4>(folder.path / "missing.npy", false), IoError);
  write_npy(folder.path / "flat.npy", {6, 4}, hwd.data());
  CHECK_THROWS_AS((void)read_feature_map<4>(folder.path / "flat.npy", false), IoError);
  write_npy(folder.path / "empty.npy", {0, 3, 4}, hwd.data());
  CHECK_THROWS_AS((void)read_feature_map<4>(folder.path / "empty.npy", false), IoError);
}

TEST_CASE("A run with files of features finds them by the frame's name") {
  const TemporaryFolder folder;
  RunOptions options;
  options.dataset.room.width = options.dataset.room.height = 16;
  options.dataset.room.frames = 3;
  options.features = "npy:" + folder.path.string();
  const auto dataset = open_dataset(options.dataset);
  const auto features = make_features<2>(options, *dataset, {});
  const std::vector<float> value = {3, 4};
  write_npy(folder.path / "000002.npy", {1, 1, 2}, value.data());
  CHECK(float(features(dataset->frame(2)).pixel(0, 0)[0]) == doctest::Approx(0.6).epsilon(1e-3));
  CHECK_THROWS_AS((void)features(dataset->frame(1)), IoError);
  options.features = "none";
  CHECK(make_features<2>(options, *dataset, {})(dataset->frame(0)).empty());
}
