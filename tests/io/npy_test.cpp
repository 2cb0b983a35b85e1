// SPDX-License-Identifier: Apache-2.0
#include "langgs/io/npy.hpp"

#include <limits>

#include "io_test_support.hpp"

using namespace langgs;
using namespace langgs::test;

namespace {

/// A version 1.0 file as NumPy would lay it out, built by hand.
std::string npy_bytes(std::string dictionary, const std::string& data) {
  while ((10 + dictionary.size() + 1) % 64 != 0) dictionary += ' ';
  dictionary += '\n';
  std::string file("\x93NUMPY\x01\x00", 8);
  file += static_cast<char>(dictionary.size() & 0xFF);
  file += static_cast<char>(dictionary.size() >> 8);
  return file + dictionary + data;
}

template <class T>
std::string raw(std::initializer_list<T> values) {
  std::string bytes;
  for (const T value : values) {
    bytes.append(sizeof(T), '\0');
    std::memcpy(bytes.data() + bytes.size() - sizeof(T), &value, sizeof(T));
  }
  return bytes;
}

NpyArray read_npy_bytes(const std::string& bytes) {
  const ScratchFolder folder;
  put(folder / "in.npy", bytes);
  return read_npy(folder / "in.npy");
}

template <class T>
std::vector<float> as_floats(const std::string& descr, std::initializer_list<T> values) {
  return to_float(read_npy_bytes(npy_bytes(
      "{'descr': '" + descr + "', 'fortran_order': False, 'shape': (" + std::to_string(values.size()) + ",), }",
      raw(values))));
}

}  // namespace

TEST_CASE("write_npy: byte for byte what numpy.save writes") {
  const ScratchFolder folder;
  const std::vector<float> values = {1.5f, -2.f, 3.f, 4.f, 5.f, 6.f};
  write_npy(folder / "a.npy", {2, 3}, values.data());
  // numpy.save(f, numpy.array([[1.5, -2, 3], [4, 5, 6]], 'f4')): 128 bytes of header.
  std::string expected("\x93NUMPY\x01\x00\x76\x00", 10);
  expected += "{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3), }";
  expected.append(127 - expected.size(), ' ');
  expected += '\n';
  expected += raw({1.5f, -2.f, 3.f, 4.f, 5.f, 6.f});
  CHECK(get(folder / "a.npy") == expected);
}

TEST_CASE("write_npy: shapes and types round trip") {
  const ScratchFolder folder;
  const std::vector<Half> halves = {Half(0.5f), Half(-65504.f), Half(1e-7f)};
  write_npy(folder / "h.npy", {3}, halves.data());
  const NpyArray h = read_npy(folder / "h.npy");
  CHECK(h.dtype == NpyType::f2);
  CHECK(h.shape == std::vector<std::size_t>{3});
  CHECK(to_float(h) == std::vector<float>{0.5f, -65504.f, float(halves[2])});

  const std::int32_t ids[] = {-1, 7};
  write_npy(folder / "i.npy", {1, 2, 1}, ids);
  CHECK(read_npy(folder / "i.npy").shape == std::vector<std::size_t>{1, 2, 1});
  CHECK(to_float(read_npy(folder / "i.npy")) == std::vector<float>{-1, 7});

  const std::uint8_t byte = 255;
  write_npy(folder / "u.npy", {}, &byte);
  CHECK(get(folder / "u.npy").find("'|u1', 'fortran_order': False, 'shape': (), }") != std::string::npos);
  CHECK(to_float(read_npy(folder / "u.npy")) == std::vector<float>{255});

  write_npy<float>(folder / "e.npy", {0, 5}, nullptr);
  CHECK(to_float(read_npy(folder / "e.npy")).empty());
  CHECK_THROWS_AS(write_npy<float>(folder / "o.npy", {std::size_t{1} << 62, 2}, nullptr), IoError);
}

TEST_CASE("read_npy: every type becomes floats") {
  CHECK(as_floats<double>("<f8", {0.25, -3}) == std::vector<float>{0.25f, -3});
  CHECK(as_floats<std::int8_t>("|i1", {-128, 127}) == std::vector<float>{-128, 127});
  CHECK(as_floats<std::int16_t>("<i2", {-32768, 5}) == std::vector<float>{-32768, 5});
  CHECK(as_floats<std::uint16_t>("<u2", {65535, 5}) == std::vector<float>{65535, 5});
  CHECK(as_floats<std::uint32_t>("<u4", {4294967295u}) == std::vector<float>{4294967296.f});
  CHECK(as_floats<std::int64_t>("<i8", {-5, 1ll << 40}) == std::vector<float>{-5, 1099511627776.f});
  CHECK(as_floats<std::uint64_t>("=u8", {9}) == std::vector<float>{9});
  CHECK(as_floats<std::uint8_t>("|b1", {1, 0}) == std::vector<float>{1, 0});
}

TEST_CASE("read_npy: Fortran order comes out in C order") {
  // a[i][j][k] = 100 i + 10 j + k with shape (2, 3, 4), first axis fastest in the file.
  std::string data;
  for (int k = 0; k < 4; ++k)
    for (int j = 0; j < 3; ++j)
      for (int i = 0; i < 2; ++i) data += raw({static_cast<float>(100 * i + 10 * j + k)});
  const auto values =
      to_float(read_npy_bytes(npy_bytes("{'descr': '<f4', 'fortran_order': True, 'shape': (2, 3, 4), }", data)));
  std::vector<float> expected;
  for (int i = 0; i < 2; ++i)
    for (int j = 0; j < 3; ++j)
      for (int k = 0; k < 4; ++k) expected.push_back(static_cast<float>(100 * i + 10 * j + k));
  CHECK(values == expected);
}

TEST_CASE("read_npy: the header may be version 2, in any key order and spacing") {
  const std::string dictionary = "{\"shape\":(2L,),  'fortran_order' :True,'descr':'<f4'}  \n";
  std::string file("\x93NUMPY\x02\x00", 8);
  const std::uint32_t length = static_cast<std::uint32_t>(dictionary.size());
  file.append(reinterpret_cast<const char*>(&length), 4);
  file += dictionary + raw({1.f, 2.f});
  CHECK(to_float(read_npy_bytes(file)) == std::vector<float>{1, 2});
}

TEST_CASE("read_npy: bad files are refused with a reason") {
  const auto error = [](const std::string& dictionary, const std::string& data) {
    return io_error([&] { (void)to_float(read_npy_bytes(npy_bytes(dictionary, data))); });
  };
  const auto contains = [](const std::string& text, const char* part) { return text.find(part) != std::string::npos; };
  const std::string four(4, '\0');
  CHECK(error("{'descr': '<f4', 'fortran_order': False, 'shape': (1,), }", four).empty());
  CHECK(contains(error("{'descr': '<f4', 'fortran_order': False, 'shape': (2,), }", four), "needs 8 bytes"));
  CHECK(contains(error("{'descr': '<f4', 'fortran_order': False, 'shape': (1,), }", four + "x"), "needs 4 bytes"));
  CHECK(contains(error("{'descr': '>f4', 'fortran_order': False, 'shape': (1,), }", four), "astype('<f4')"));
  CHECK(contains(error("{'descr': '<c8', 'fortran_order': False, 'shape': (1,), }", four), "<c8"));
  CHECK(contains(error("{'descr': '|O', 'fortran_order': False, 'shape': (1,), }", four), "|O"));
  CHECK(contains(error("{'descr': [('a', '<f4')], 'fortran_order': False, 'shape': (1,), }", four), "quoted"));
  CHECK(contains(error("{'descr': '<f4', 'shape': (1,), }", four), "missing"));
  CHECK(contains(error("{'descr': '<f4', 'descr': '<f4', 'shape': (1,), }", four), "repeated"));
  CHECK(contains(error("{'descr': '<f4', 'fortran_order': False, 'shape': (-1,), }", four), "expected a dimension"));
  // 2^32 x 2^32 x 4 wraps to 0 bytes in 64 bits, as does the second one on the way.
  CHECK(
      contains(error("{'descr': '<f4', 'fortran_order': False, 'shape': (4294967296, 4294967296), }", ""), "overflow"));
  CHECK(
      contains(error("{'descr': '<f4', 'fortran_order': False, 'shape': (99999999999999999999,), }", ""), "overflow"));
  CHECK(contains(io_error([&] { (void)read_npy_bytes("not numpy at all"); }), "not a .npy"));
  CHECK(contains(io_error([&] { (void)read_npy_bytes(std::string("\x93NUMPY\x01\x00\xFF\xFF{", 11)); }),
                 "inside its header"));
  CHECK(contains(io_error([&] { (void)read_npy_bytes(std::string("\x93NUMPY\x09\x00\x01\x00{", 11)); }), "9.0"));
  NpyArray wrong;
  wrong.shape = {3};
  CHECK_THROWS_AS((void)to_float(wrong), InvalidArgument);
}

TEST_CASE("read_npy: damaged files never do worse than IoError") {
  const std::string seed =
      npy_bytes("{'descr': '<f4', 'fortran_order': True, 'shape': (2, 3), }", raw({1.f, 2.f, 3.f, 4.f, 5.f, 6.f}));
  const int refused = mutation_fuzz(seed, 3000, [](const auto& path) { (void)to_float(read_npy(path)); });
  CHECK(refused > 1000);
  CHECK(refused < 3000 + static_cast<int>(seed.size()));
}
