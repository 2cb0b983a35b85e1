// SPDX-License-Identifier: Apache-2.0
#include "langgs/io/safetensors.hpp"

#include "io_test_support.hpp"

using namespace langgs;
using namespace langgs::test;

namespace {

/// A file with the given header text and data.
std::string file_bytes(const std::string& header, const std::string& data) {
  const std::uint64_t length = header.size();
  return std::string(reinterpret_cast<const char*>(&length), 8) + header + data;
}

SafetensorsFile read_safetensors_bytes(const std::string& bytes) {
  const ScratchFolder folder;
  put(folder / "in.safetensors", bytes);
  return SafetensorsFile(folder / "in.safetensors");
}

std::string error_of(const std::string& header, const std::string& data) {
  return io_error([&] { (void)read_safetensors_bytes(file_bytes(header, data)); });
}

bool contains(const std::string& text, const char* part) { return text.find(part) != std::string::npos; }

}  // namespace

TEST_CASE("SafetensorsWriter: exact bytes, header padded, data aligned by element size") {
  const ScratchFolder folder;
  const std::uint8_t small[] = {1, 2, 3};
  const float big[] = {1.5f, -2.f};
  SafetensorsWriter writer;
  writer.metadata["format"] = "1";
  writer.add("small", {3}, small);
  writer.add("big", {1, 2}, big);
  writer.save(folder / "a.safetensors");
  std::string header = R"({"__metadata__":{"format":"1"},"small":{"dtype":"U8","shape":[3],"data_offsets":[8,11]},)"
                       R"("big":{"dtype":"F32","shape":[1,2],"data_offsets":[0,8]}})";
  while (header.size() % 8 != 0) header += ' ';
  const std::string data = std::string(reinterpret_cast<const char*>(big), 8) + "\x01\x02\x03";
  CHECK(get(folder / "a.safetensors") == file_bytes(header, data));
}

TEST_CASE("safetensors: round trip of types, shapes, names and metadata") {
  const ScratchFolder folder;
  const std::vector<Half> halves = {Half(0.5f), Half(-2.f), Half(3.f)};
  const std::vector<double> doubles = {1.0 / 3};
  const std::vector<std::int64_t> longs = {-1, 1ll << 60};
  const std::vector<std::uint16_t> shorts = {65535};
  const std::string odd_name = "quote\" back\\ tab\t \xC3\xA9 \xF0\x9F\x98\x80";
  SafetensorsWriter writer;
  writer.metadata["model"] = "line\nbreak \x01 \xE2\x82\xAC";
  writer.metadata[""] = "";
  writer.add("h", {3}, halves.data());
  writer.add("d", {}, doubles.data());
  writer.add(odd_name, {2, 1}, longs.data());
  writer.add("s", {1}, shorts.data());
  writer.add<float>("none", {0, 7}, nullptr);
  writer.add("bf", TensorType::BF16, {1, 1}, shorts.data());
  writer.save(folder / "a.safetensors");
  const SafetensorsFile file(folder / "a.safetensors");
  CHECK(file.metadata() == writer.metadata);
  REQUIRE(file.tensors().size() == 6);
  CHECK(file.tensors()[0].name == "h");
  CHECK(file.tensors()[2].name == odd_name);
  CHECK(file.at(odd_name).shape == std::vector<std::size_t>{2, 1});
  CHECK(file.values<Half>("h") == halves);
  CHECK(file.values<double>("d") == doubles);
  CHECK(file.at("d").shape.empty());
  CHECK(file.values<std::int64_t>(odd_name) == longs);
  CHECK(file.values<std::uint16_t>("s") == shorts);
  CHECK(file.values<float>("none").empty());
  CHECK(file.at("bf").dtype == TensorType::BF16);
  for (const TensorInfo& info : file.tensors()) CHECK(info.begin % tensor_type_size(info.dtype) == 0);
  CHECK(file.find("absent") == nullptr);
  CHECK(contains(io_error([&] { (void)file.at("absent"); }), "absent"));
  CHECK(contains(io_error([&] { (void)file.values<float>("h"); }), "expected F32"));

  const std::string first = get(folder / "a.safetensors");
  writer.save(folder / "b.safetensors");
  CHECK(get(folder / "b.safetensors") == first);
}

TEST_CASE("SafetensorsWriter: bad tensors are refused, an empty file is fine") {
  const ScratchFolder folder;
  const float value = 1;
  SafetensorsWriter writer;
  writer.save(folder / "empty.safetensors");
  CHECK(SafetensorsFile(folder / "empty.safetensors").tensors().empty());
  writer.add("a", {1}, &value);
  CHECK_THROWS_AS(writer.add("a", {1}, &value), InvalidArgument);
  CHECK_THROWS_AS(writer.add("", {1}, &value), InvalidArgument);
  CHECK_THROWS_AS(writer.add("__metadata__", {1}, &value), InvalidArgument);
  CHECK_THROWS_AS(writer.add<float>("b", {1}, nullptr), InvalidArgument);
  CHECK_THROWS_AS(writer.add("c", {std::size_t{1} << 32, std::size_t{1} << 32}, &value), InvalidArgument);
  writer.metadata["bad"] = "\xFF";
  CHECK_THROWS_AS(writer.save(folder / "x.safetensors"), InvalidArgument);
  CHECK(folder.num_files() == 1);
}

TEST_CASE("SafetensorsFile: other writers' spacing, key order, escapes and odd alignment") {
  const SafetensorsFile file = read_safetensors_bytes(
      file_bytes("{\"\\u00e9\\ud83d\\ude00\\n\\/\" : { \"shape\" : [ 1 ] , \"data_offsets\":[1,5],\"dtype\":\"F32\"},"
                 "\n\"b\":{\"dtype\":\"BOOL\",\"shape\":[],\"data_offsets\":[0,1]}}  ",
                 std::string("\x01\x00\x00\x80\x3F", 5)));
  CHECK(file.tensors()[0].name == "\xC3\xA9\xF0\x9F\x98\x80\n/");
  CHECK(file.values<float>(file.tensors()[0].name) == std::vector<float>{1});
  CHECK(file.bytes(file.at("b")).size() == 1);
}

TEST_CASE("SafetensorsFile: bad layouts are refused") {
  const auto tensor = [](const std::string& shape, const std::string& offsets) {
    return "{\"dtype\":\"F32\",\"shape\":[" + shape + "],\"data_offsets\":[" + offsets + "]}";
  };
  const std::string data(8, '\0');
  CHECK(error_of("{\"a\":" + tensor("2", "0,8") + "}", data).empty());
  CHECK(contains(error_of("{\"a\":" + tensor("2", "0,7") + "}", data), "does not fit"));
  CHECK(contains(error_of("{\"a\":" + tensor("3", "0,12") + "}", data), "does not fit"));
  CHECK(contains(error_of("{\"a\":" + tensor("2", "8,0") + "}", data), "does not fit"));
  CHECK(contains(error_of("{\"a\":" + tensor("1", "0,4") + "}", data), "4 bytes follow"));
  CHECK(contains(error_of("{\"a\":" + tensor("1", "4,8") + "}", data), "holes"));
  CHECK(contains(error_of("{\"a\":" + tensor("2", "0,8") + ",\"b\":" + tensor("1", "4,8") + "}", data), "overlap"));
  CHECK(contains(error_of("{\"a\":" + tensor("1", "0,4") + ",\"a\":" + tensor("1", "4,8") + "}", data), "twice"));
  // 2^62 floats wrap to 0 bytes; so do 2^32 x 2^32.
  CHECK(contains(error_of("{\"a\":" + tensor("4611686018427387904", "0,0") + "}", ""), "does not fit"));
  CHECK(contains(error_of("{\"a\":" + tensor("4294967296,4294967296", "0,0") + "}", ""), "does not fit"));
  CHECK(contains(error_of("{\"a\":" + tensor("18446744073709551616", "0,0") + "}", ""), "below 2^64"));
}

TEST_CASE("SafetensorsFile: bad headers are refused") {
  const std::string good = R"({"a":{"dtype":"U8","shape":[0],"data_offsets":[0,0]}})";
  CHECK(error_of(good, "").empty());
  for (const char* bad : {"",
                          " {}",
                          "[]",
                          "{",
                          "{}x",
                          "{}{}",
                          R"({"a":1})",
                          R"({"a":{}})",
                          R"({"a":{"dtype":"U8","shape":[0]}})",
                          R"({"a":{"dtype":"X8","shape":[0],"data_offsets":[0,0]}})",
                          R"({"a":{"dtype":"U8","shape":[-1],"data_offsets":[0,0]}})",
                          R"({"a":{"dtype":"U8","shape":[00],"data_offsets":[0,0]}})",
                          R"({"a":{"dtype":"U8","shape":[0.0],"data_offsets":[0,0]}})",
                          R"({"a":{"dtype":"U8","shape":[0,],"data_offsets":[0,0]}})",
                          R"({"a":{"dtype":"U8","shape":[0],"data_offsets":[0]}})",
                          R"({"a":{"dtype":"U8","shape":[0],"shape":[0],"data_offsets":[0,0]}})",
                          R"({"a":{"dtype":"U8","shape":[0],"data_offsets":[0,0],"x":[]}})",
                          R"({"a":{"dtype":"U8","shape":[0],"data_offsets":[0,0]},})",
                          R"({"__metadata__":{"k":1}})",
                          R"({"__metadata__":{"k":"1","k":"2"}})",
                          R"({"__metadata__":{},"__metadata__":{}})",
                          R"({"__metadata__":{"k":"\ud800"}})",
                          R"({"__metadata__":{"k":"\udc00x"}})",
                          R"({"__metadata__":{"k":"\u12"}})",
                          R"({"__metadata__":{"k":"\x"}})",
                          "{\"__metadata__\":{\"k\":\"\n\"}}",
                          "{\"__metadata__\":{\"k\":\"\xC0\x80\"}}",
                          "{\"__metadata__\":{\"k\":\"\xED\xA0\x80\"}}",
                          "{\"__metadata__\":{\"k\":\"",
                          "{\"__metadata__\":{\"k\":\"\\"}) {
    CAPTURE(bad);
    CHECK(contains(error_of(bad, ""), "bad safetensors header"));
  }
  CHECK(contains(io_error([] { (void)read_safetensors_bytes("1234567"); }), "not a safetensors file"));
  CHECK(contains(io_error([] { (void)read_safetensors_bytes(std::string(16, '\xFF')); }), "promises a header"));
  CHECK(contains(io_error([] { (void)read_safetensors_bytes(std::string("\x03\0\0\0\0\0\0\0{}", 10)); }),
                 "promises a header"));
}

TEST_CASE("SafetensorsFile: damaged files never do worse than IoError") {
  const ScratchFolder folder;
  const float values[] = {1, 2, 3, 4};
  SafetensorsWriter writer;
  writer.metadata["k\n"] = "v\xC3\xA9";
  writer.add("a", {2, 1}, values);
  writer.add("b", {2}, values + 2);
  writer.save(folder / "a.safetensors");
  const int refused = mutation_fuzz(get(folder / "a.safetensors"), 5000, [](const auto& path) {
    const SafetensorsFile file(path);
    unsigned sum = 0;
    for (const TensorInfo& info : file.tensors())
      for (const std::byte byte : file.bytes(info)) sum += static_cast<unsigned>(byte);
    REQUIRE(sum < 256u * 1000u);
  });
  CHECK(refused > 2500);
}
