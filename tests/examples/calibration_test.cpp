// SPDX-License-Identifier: Apache-2.0
#include "common/calibration.hpp"

#include <doctest/doctest.h>

#include "langgs/core/error.hpp"
#include "temporary_folder.hpp"

using namespace langgs;
using namespace langgs::examples;

TEST_CASE("One line of seven or twelve numbers; comments are not read") {
  const TemporaryFolder folder;
  folder.write("c.txt", "# header\n517.3 516.5 318.6 255.3 640 480 5000\n# 0.2624 -0.9531 -0.0054 0.0026 1.1633\n");
  const Calibration plain = read_calibration(folder.path / "c.txt");
  CHECK(plain.camera == Camera{517.3f, 516.5f, 318.6f, 255.3f, 640, 480});
  CHECK(plain.depth_scale == 5000);
  CHECK_FALSE(plain.distortion);
  folder.write("c.txt", "1 2 3 4 5 6 7 0.1 0.2 0.3 0.4 0.5\r\n");
  CHECK(read_calibration(folder.path / "c.txt").distortion == Distortion{0.1, 0.2, 0.3, 0.4, 0.5});
}

TEST_CASE("Every other text is refused") {
  const TemporaryFolder folder;
  for (const char* text :
       {"", "# only a comment\n", "1 2 3\n", "1 2 3 4 5 6 x\n", "1 2 3 4 5 6 7 8\n", "1 1 1 1 4 4 1\n1 1 1 1 4 4 1\n",
        "0 1 1 1 4 4 1\n", "1 1 1 1 4.5 4 1\n", "1 1 1 1 0 4 1\n", "1 1 1 1 -4 4 1\n", "1 1 1 1 4 4 0\n",
        "1 1 1 1 4 4 -5\n", "nan 1 1 1 4 4 1\n", "1 1 1 1 1e300 4 1\n", "1 1 1 1 99999 4 1\n"}) {
    folder.write("c.txt", text);
    CAPTURE(text);
    CHECK_THROWS_AS((void)read_calibration(folder.path / "c.txt"), IoError);
  }
  CHECK_THROWS_AS((void)read_calibration(folder.path / "missing.txt"), IoError);
}

TEST_CASE("Known cameras by a word of the folder's name") {
  CHECK(known_calibration("a/rgbd_dataset_freiburg1_xyz")->camera.fx == doctest::Approx(517.3));
  CHECK(known_calibration("tum_fr2_desk/")->camera.fx == doctest::Approx(520.9));
  CHECK(known_calibration("FR3-office")->distortion->is_zero());
  CHECK_FALSE(known_calibration("fr1_desk/other"));
  CHECK_FALSE(known_calibration("fr12_desk"));
  CHECK_FALSE(known_calibration("afr1"));
  CHECK_FALSE(known_calibration(""));
}

TEST_CASE("Which distortion is in force") {
  Calibration line;
  line.camera = {517.3f, 516.5f, 318.6f, 255.3f, 640, 480};
  const Distortion fr1{0.2624, -0.9531, -0.0054, 0.0026, 1.1633};
  CHECK(choose_distortion("auto", line, "tum_fr1_xyz") == fr1);
  CHECK(choose_distortion("auto", line, "elsewhere").is_zero());
  CHECK(choose_distortion("none", line, "tum_fr1_xyz").is_zero());
  CHECK(choose_distortion("1 2 3 4 5", line, "tum_fr1_xyz") == Distortion{1, 2, 3, 4, 5});
  line.camera.fx = 525;  // another calibration of the same name: perhaps already undistorted
  CHECK(choose_distortion("auto", line, "tum_fr1_xyz").is_zero());
  line.distortion = Distortion{9, 0, 0, 0, 0};
  CHECK(choose_distortion("auto", line, "tum_fr1_xyz").k1 == 9);
  for (const char* text : {"", "fr1", "1 2 3 4", "1 2 3 4 5 6", "1 2 3 4 nan"})
    CHECK_THROWS_AS((void)choose_distortion(text, line, "x"), InvalidArgument);
}
