// SPDX-License-Identifier: Apache-2.0
#include "langgs/io/tum_trajectory.hpp"

#include <clocale>
#include <limits>

#include "io_test_support.hpp"
#include "langgs/io/association.hpp"

using namespace langgs;
using namespace langgs::test;

namespace {

std::vector<StampedPose> read_text(const std::string& text) {
  const ScratchFolder folder;
  put(folder / "t.txt", text);
  return read_tum_trajectory(folder / "t.txt");
}

}  // namespace

TEST_CASE("write_tum_trajectory: exact text") {
  const ScratchFolder folder;
  std::vector<StampedPose> poses(2);
  poses[0].timestamp = 1305031102.1753041;
  poses[0].T_world_camera.translation() = Eigen::Vector3d(1.25, -0.0, 1.0 / 3);
  // A turn by pi about y, whose quaternion Eigen may give either sign.
  poses[1].timestamp = -0.5;
  poses[1].T_world_camera.linear() = so3_exp(Eigen::Vector3d(0, -std::acos(-0.28), 0));
  write_tum_trajectory(folder / "t.txt", poses);
  CHECK(get(folder / "t.txt") ==
        "1305031102.175304 1.25 0 0.333333333 0 0 0 1\n"
        "-0.500000 0 0 0 0 -0.8 0 0.6\n");
  poses[1].T_world_camera.translation().x() = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_AS(write_tum_trajectory(folder / "t.txt", poses), InvalidArgument);
  CHECK(get(folder / "t.txt").starts_with("1305031102.175304"));
}

TEST_CASE("TUM trajectory: round trip") {
  const ScratchFolder folder;
  std::vector<StampedPose> poses;
  for (int i = 0; i < 50; ++i) {
    Twist xi;
    xi << 3.0 * std::sin(i), i * 0.1, -std::cos(2 * i), std::sin(3 * i), 1.5 * std::cos(i), 0.03 * i;
    poses.push_back({1e9 + i / 30.0, se3_exp(xi)});
  }
  write_tum_trajectory(folder / "t.txt", poses);
  const auto back = read_tum_trajectory(folder / "t.txt");
  REQUIRE(back.size() == poses.size());
  for (std::size_t i = 0; i < poses.size(); ++i) {
    CHECK(std::abs(back[i].timestamp - poses[i].timestamp) < 1e-6);
    CHECK(back[i].T_world_camera.matrix().isApprox(poses[i].T_world_camera.matrix(), 1e-8));
  }
  write_tum_trajectory(folder / "u.txt", back);
  CHECK(get(folder / "u.txt").size() == get(folder / "t.txt").size());
}

TEST_CASE("read_tum_trajectory: comments, blanks, line ends, order and scale of quaternions") {
  const auto poses = read_text(
      "\xEF\xBB\xBF# time tx ty tz qx qy qz qw\r\n"
      "\r\n"
      "2.5\t1 +2 3e0   0 0 0 -2 \r\n"
      "   # more\n"
      "1.0 0 0 0 0 0 3 0");
  REQUIRE(poses.size() == 2);
  CHECK(poses[0].timestamp == 2.5);
  CHECK(poses[0].T_world_camera.translation() == Eigen::Vector3d(1, 2, 3));
  CHECK(poses[0].T_world_camera.linear().isIdentity());
  CHECK(poses[1].timestamp == 1.0);
  CHECK(poses[1].T_world_camera.linear().isApprox(Eigen::Vector3d(-1, -1, 1).asDiagonal().toDenseMatrix()));
}

TEST_CASE("read_tum_trajectory: bad lines are named") {
  const auto error = [](const std::string& text) { return io_error([&] { (void)read_text(text); }); };
  const std::string good = "0 0 0 0 0 0 0 1\n";
  for (const char* bad :
       {"1 0 0 0 0 0 0", "1 0 0 0 0 0 0 x", "1 0 0 0 0 0 nan 1", "1 0 inf 0 0 0 0 1", "1 0 0 0 0 0 0 1 9",
        "1 0 0 0 0 0 0 0", "1 0 0 1e16 0 0 0 1", "1 0 0 1,5 0 0 0 1", "1 0 0 1e999 0 0 0 1", "0x1 0 0 0 0 0 0 1"}) {
    const std::string message = error(good + "# fine\n" + bad + "\n" + good);
    CAPTURE(bad);
    CHECK(message.find("t.txt:3:") != std::string::npos);
    CHECK(message.find("qx qy qz qw") != std::string::npos);
  }
  CHECK(error("").find("no poses") != std::string::npos);
  CHECK(error("# only a comment\n").find("no poses") != std::string::npos);
}

TEST_CASE("read_tum_trajectory: damaged files never do worse than IoError") {
  const std::string seed = "# header\n1305031102.175304 1.25 0 0.333333333 0 0 0 1\n2.5 -1e-3 2 3 0.5 0.5 0.5 0.5\n";
  const int refused = mutation_fuzz(seed, 3000, [](const auto& path) {
    for (const StampedPose& pose : read_tum_trajectory(path)) REQUIRE(is_finite(pose.T_world_camera));
  });
  CHECK(refused > 500);
  CHECK(refused < 3000);
}

TEST_CASE("read_tum_list: entries in order, names with blanks kept") {
  const ScratchFolder folder;
  put(folder / "rgb.txt", "# color images\n\n2.0 rgb/b c.png \r\n1.5   rgb/a.png");
  const auto entries = read_tum_list(folder / "rgb.txt");
  REQUIRE(entries.size() == 2);
  CHECK(entries[0].timestamp == 2.0);
  CHECK(entries[0].filename == "rgb/b c.png");
  CHECK(entries[1].timestamp == 1.5);
  CHECK(entries[1].filename == "rgb/a.png");
}

TEST_CASE("read_tum_list: bad lists are refused") {
  const ScratchFolder folder;
  const auto error = [&](const std::string& text) {
    put(folder / "rgb.txt", text);
    return io_error([&] { (void)read_tum_list(folder / "rgb.txt"); });
  };
  CHECK(error("1.0 a.png\n2.0\n").find("rgb.txt:2:") != std::string::npos);
  CHECK(error("rgb/a.png 1.0\n").find("rgb.txt:1:") != std::string::npos);
  CHECK(error("nan a.png\n").find("rgb.txt:1:") != std::string::npos);
  CHECK(error(std::string("1.0 a\0b.png\n", 12)).find("rgb.txt:1:") != std::string::npos);
  CHECK(error("").find("lists no files") != std::string::npos);
  CHECK(error("# nothing\n").find("lists no files") != std::string::npos);
  const int refused =
      mutation_fuzz("# c\n1.5 rgb/a.png\n2.5 rgb/b.png\n", 1000, [](const auto& path) { (void)read_tum_list(path); });
  CHECK(refused > 100);
}
