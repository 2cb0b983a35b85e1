// SPDX-License-Identifier: Apache-2.0
#include "langgs/io/ply.hpp"

#include <cstring>
#include <limits>

#include "io_test_support.hpp"

using namespace langgs;
using namespace langgs::test;

namespace {

SplatCloud small_cloud() {
  SplatCloud cloud;
  cloud.mean = {{1, 2, 3}, {-4, 5.5f, 1e-3f}};
  cloud.colour = {{0.5f, 0, 1}, {0.25f, 0.75f, 1.5f}};
  cloud.log_scale = {{-3, -4, -5}, {0.5f, 0, -10}};
  cloud.opacity_logit = {2.5f, -1};
  cloud.rotation = {{1, 0, 0, 0}, {0.5f, -0.5f, 0.5f, -0.5f}};
  return cloud;
}

const std::string kAsciiHeader =
    "ply\nformat ascii 1.0\ncomment made by hand\nelement vertex 1\n"
    "property double rot_3\nproperty float rot_2\nproperty float rot_1\nproperty float rot_0\n"
    "property list uchar int neighbours\nproperty uchar flag\n"
    "property float f_dc_2\nproperty float f_dc_1\nproperty float f_dc_0\nproperty float f_rest_0\n"
    "property float opacity\nproperty float scale_2\nproperty float scale_1\nproperty float scale_0\n"
    "property float z\nproperty float y\nproperty float x\n";

SplatCloud read_ply_bytes(const std::string& bytes) {
  const ScratchFolder folder;
  put(folder / "in.ply", bytes);
  return read_ply(folder / "in.ply");
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  REQUIRE(at != std::string::npos);
  return text.replace(at, from.size(), to);
}

template <class T>
void append(std::string& out, T value) {
  out.append(reinterpret_cast<const char*>(&value), sizeof(value));
}

}  // namespace

TEST_CASE("write_ply: byte for byte the layout of 3D Gaussian Splatting") {
  const ScratchFolder folder;
  write_ply(folder / "m.ply", small_cloud());
  std::string expected = "ply\nformat binary_little_endian 1.0\nelement vertex 2\n";
  for (const char* name : {"x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0",
                           "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"})
    expected += std::string("property float ") + name + "\n";
  expected += "end_header\n";
  const float half = 1.7724538509055159f;  // 0.5 / 0.28209479177387814
  for (const float value : {1.f, 2.f, 3.f, 0.f, 0.f, 0.f, 0.f, -half, half, 2.5f, -3.f, -4.f, -5.f, 1.f, 0.f, 0.f, 0.f})
    append(expected, value);
  for (const float value : {-4.f, 5.5f, 1e-3f, 0.f, 0.f, 0.f, -half / 2, half / 2, 2 * half, -1.f, 0.5f, 0.f, -10.f,
                            0.5f, -0.5f, 0.5f, -0.5f})
    append(expected, value);
  CHECK(get(folder / "m.ply") == expected);
}

TEST_CASE("PLY: round trip, also of many and of no splats") {
  const ScratchFolder folder;
  for (const std::size_t n : {std::size_t{0}, std::size_t{2}, std::size_t{40000}}) {
    SplatCloud cloud;
    cloud.resize(n);
    const SplatCloud two = small_cloud();
    for (std::size_t i = 0; i < n; ++i) {
      cloud.mean[i] = {static_cast<float>(i), 0.1f, -1};
      cloud.colour[i] = two.colour[i % 2];
      cloud.log_scale[i] = two.log_scale[i % 2];
      cloud.opacity_logit[i] = static_cast<float>(i) * 0.5f;
      cloud.rotation[i] = two.rotation[i % 2];
    }
    write_ply(folder / "m.ply", cloud);
    const SplatCloud back = read_ply(folder / "m.ply");
    REQUIRE(back.size() == n);
    CHECK(back.mean == cloud.mean);
    CHECK(back.log_scale == cloud.log_scale);
    CHECK(back.opacity_logit == cloud.opacity_logit);
    CHECK(back.rotation == cloud.rotation);
    float worst = 0;
    for (std::size_t i = 0; i < n; ++i)
      for (int c = 0; c < 3; ++c) worst = std::max(worst, std::abs(back.colour[i][c] - cloud.colour[i][c]));
    CHECK(worst < 1e-6f);
  }
  SplatCloud uneven = small_cloud();
  uneven.rotation.pop_back();
  CHECK_THROWS_AS(write_ply(folder / "m.ply", uneven), InvalidArgument);
}

TEST_CASE("read_ply: ascii, any order and type, lists and other elements skipped") {
  const std::string text = kAsciiHeader +
                           "element face 2\nproperty list uchar int vertex_indices\nend_header\n"
                           "0 0 0 -2   2 7 8   255   1.7724538509 0 -1.7724538509  0.125\r\n2.5 -5 -4 -3 3 2 1\n"
                           "3 0 0 0\n3 0 0 0\n";
  const SplatCloud cloud = read_ply_bytes(text);
  REQUIRE(cloud.size() == 1);
  CHECK(cloud.mean[0] == std::array<float, 3>{1, 2, 3});
  CHECK(cloud.log_scale[0] == std::array<float, 3>{-3, -4, -5});
  CHECK(cloud.opacity_logit[0] == 2.5f);
  CHECK(cloud.rotation[0] == std::array<float, 4>{-1, 0, 0, 0});  // normalised
  CHECK(cloud.colour[0][0] == doctest::Approx(0).epsilon(1e-6));
  CHECK(cloud.colour[0][1] == 0.5f);
  CHECK(cloud.colour[0][2] == doctest::Approx(1).epsilon(1e-6));
}

TEST_CASE("read_ply: binary with an element of lists before the splats") {
  std::string bytes = replaced(kAsciiHeader, "ascii", "binary_little_endian");
  bytes = replaced(bytes, "element vertex",
                   "element camera 2\nproperty list short double k\nproperty int8 id\nelement vertex");
  bytes += "end_header\n";
  append<std::int16_t>(bytes, 2), append(bytes, 1.0), append(bytes, 2.0), append<std::int8_t>(bytes, 1);
  append<std::int16_t>(bytes, 0), append<std::int8_t>(bytes, 2);
  append(bytes, 0.0), append(bytes, 0.f), append(bytes, 0.f), append(bytes, 1.f);
  append<std::uint8_t>(bytes, 1), append<std::int32_t>(bytes, 5), append<std::uint8_t>(bytes, 9);
  for (const float value : {0.f, 0.f, 0.f, 0.f, 2.5f, -5.f, -4.f, -3.f, 3.f, 2.f, 1.f}) append(bytes, value);
  const SplatCloud cloud = read_ply_bytes(bytes);
  REQUIRE(cloud.size() == 1);
  CHECK(cloud.mean[0] == std::array<float, 3>{1, 2, 3});
  CHECK(cloud.rotation[0] == std::array<float, 4>{1, 0, 0, 0});
  CHECK_THROWS_AS((void)read_ply_bytes(bytes.substr(0, bytes.size() - 1)), IoError);
}

TEST_CASE("read_ply: bad files are refused with a reason") {
  const std::string good = kAsciiHeader + "end_header\n0 0 0 1  0  0  0 0 0 0  1 1 1 1 3 2 1\n";
  CHECK(read_ply_bytes(good).size() == 1);
  const auto error = [&](const std::string& from, const std::string& to) {
    return io_error([&] { (void)read_ply_bytes(replaced(good, from, to)); });
  };
  const auto contains = [](const std::string& text, const char* part) { return text.find(part) != std::string::npos; };
  CHECK(contains(error("ply", "plx"), "not a PLY"));
  CHECK(contains(error("ascii", "binary_big_endian"), "binary_little_endian are supported"));
  CHECK(contains(error("ascii 1.0", "ascii 2.0"), "version"));
  CHECK(contains(error("property float x", "property float xx"), "'x' is missing"));
  CHECK(contains(error("property uchar flag", "property float y"), "declared twice"));
  CHECK(contains(error("property float x", "property list uchar float x"), "'x' is missing"));
  CHECK(contains(error("vertex 1", "vertex 18446744073709551615"), "promises"));
  CHECK(contains(error("vertex 1", "vertex 18446744073709551616"), "bad element"));
  CHECK(contains(error("vertex 1", "vertex -1"), "bad element"));
  CHECK(contains(error("vertex 1", "vertex 2"), "promises"));
  CHECK(contains(error("vertex 1", "points 1"), "no element 'vertex'"));
  CHECK(contains(error("list uchar int", "list float int"), "length type"));
  CHECK(contains(error("end_header\n", "end\n"), "unknown keyword"));
  CHECK(contains(error("0 0 0 1  0", "0 0 0 0  0"), "zero quaternion"));
  CHECK(contains(error("3 2 1", "3 2 nan"), "nan"));
  CHECK(contains(error("3 2 1", "3 2 1e39"), "not finite"));
  CHECK(contains(error("0 0 0 1  0 ", "0 0 0 1  -1 "), "length -1"));
  CHECK(contains(error("0 0 0 1  0 ", "0 0 0 1  1e15 "), "length 1e+15"));
  CHECK(contains(io_error([] { (void)read_ply_bytes("ply\nformat ascii 1.0\nelement vertex 1\n"); }), "end_header"));
  CHECK(contains(io_error([] { (void)read_ply_bytes("ply\nelement vertex 0\nend_header\n"); }), "format"));
  CHECK(contains(io_error([] { (void)read_ply_bytes("ply\nformat ascii 1.0\nproperty float x\n"); }),
                 "before any element"));

  const ScratchFolder folder;
  SplatCloud cloud = small_cloud();
  cloud.mean[1][2] = std::numeric_limits<float>::quiet_NaN();
  write_ply(folder / "nan.ply", cloud);
  CHECK(contains(io_error([&] { (void)read_ply(folder / "nan.ply"); }), "'z' of splat 1"));
}

TEST_CASE("read_ply: an element without properties costs nothing, whatever its count") {
  const std::string text =
      replaced(kAsciiHeader, "element vertex", "element nothing 18446744073709551615\nelement vertex") +
      "end_header\n0 0 0 1  0  0  0 0 0 0  1 1 1 1 3 2 1\n";
  CHECK(read_ply_bytes(text).size() == 1);
}

TEST_CASE("read_ply: damaged files never do worse than IoError") {
  const ScratchFolder folder;
  write_ply(folder / "m.ply", small_cloud());
  const auto read = [](const auto& path) { (void)read_ply(path); };
  const std::string binary = get(folder / "m.ply");
  CHECK(mutation_fuzz(binary, 3000, read) > 1000);
  const std::string ascii = kAsciiHeader + "element face 1\nproperty list uchar int i\nend_header\n" +
                            "0 0 0 1  2 3 4  0  0 0 0 0  1 1 1 1 3 2 1\n3 0 0 0\n";
  CHECK(mutation_fuzz(ascii, 3000, read) > 1000);
}
