// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <charconv>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "langgs/core/error.hpp"
#include "langgs/io/text.hpp"

/// @file The header of a PLY file, and a cursor over the values that follow it.

namespace langgs::detail {

enum class PlyType { int8, uint8, int16, uint16, int32, uint32, float32, float64 };

[[nodiscard]] constexpr std::size_t ply_type_size(PlyType type) {
  constexpr std::size_t kSizes[] = {1, 1, 2, 2, 4, 4, 4, 8};
  return kSizes[static_cast<int>(type)];
}

[[nodiscard]] inline std::optional<PlyType> ply_type_by_name(std::string_view name) {
  constexpr std::string_view kOld[] = {"char", "uchar", "short", "ushort", "int", "uint", "float", "double"};
  constexpr std::string_view kNew[] = {"int8", "uint8", "int16", "uint16", "int32", "uint32", "float32", "float64"};
  for (int i = 0; i < 8; ++i)
    if (name == kOld[i] || name == kNew[i]) return static_cast<PlyType>(i);
  return std::nullopt;
}

struct PlyProperty {
  std::string name;
  PlyType type = PlyType::float32;
  std::optional<PlyType> count_type;  ///< of a list: the type of its length
};

struct PlyElement {
  std::string name;
  std::uint64_t count = 0;
  std::vector<PlyProperty> properties;
};

struct PlyHeader {
  bool binary = false;
  std::vector<PlyElement> elements;
  std::size_t data_begin = 0;  ///< offset of the first value
};

/// Parses the header of `content`, the bytes of the file named `file`. Throws IoError naming the line.
[[nodiscard]] inline PlyHeader parse_ply_header(std::string_view content, const std::string& file) {
  PlyHeader header;
  std::string_view rest = content, line;
  bool seen_format = false;
  for (int number = 1; next_line(rest, line); ++number) {
    std::string_view words = line;
    const auto fail = [&](const char* what) {
      raise<IoError>(file, ":", number, ": ", what, ": '", excerpt(line), "'; export the file again as PLY 1.0");
    };
    const std::string_view keyword = next_word(words);
    if (number == 1) {
      if (keyword != "ply" || !trimmed(words).empty()) fail("not a PLY file");
    } else if (keyword == "format") {
      const std::string_view format = next_word(words);
      if (format != "ascii" && format != "binary_little_endian")
        fail("only ascii and binary_little_endian are supported");
      if (next_word(words) != "1.0") fail("unknown PLY version");
      header.binary = format != "ascii";
      seen_format = true;
    } else if (keyword == "element") {
      PlyElement element;
      element.name = next_word(words);
      const std::string_view count = next_word(words);
      const auto [end, error] = std::from_chars(count.data(), count.data() + count.size(), element.count);
      if (element.name.empty() || error != std::errc{} || end != count.data() + count.size()) fail("bad element");
      header.elements.push_back(element);
    } else if (keyword == "property") {
      if (header.elements.empty()) fail("property before any element");
      PlyProperty property;
      std::string_view type = next_word(words);
      if (type == "list") {
        property.count_type = ply_type_by_name(next_word(words));
        if (!property.count_type || *property.count_type >= PlyType::float32) fail("bad length type of a list");
        type = next_word(words);
      }
      const auto value_type = ply_type_by_name(type);
      property.name = next_word(words);
      if (!value_type || property.name.empty()) fail("bad property");
      property.type = *value_type;
      header.elements.back().properties.push_back(property);
    } else if (keyword == "end_header") {
      if (!seen_format) fail("the format line is missing");
      header.data_begin = content.size() - rest.size();
      return header;
    } else if (keyword != "comment" && keyword != "obj_info" && !keyword.empty()) {
      fail("unknown keyword");
    }
  }
  raise<IoError>(file, ": the PLY header has no end_header line; the file is truncated, copy it again");
}

/// Hands out the values after the header one by one; running out of them is an IoError.
class PlyCursor {
 public:
  PlyCursor(std::string_view data, bool binary, const std::string& file) : data_(data), binary_(binary), file_(file) {}

  [[nodiscard]] double next(PlyType type) {
    if (!binary_) return next_ascii();
    switch (type) {
      case PlyType::int8:
        return load<std::int8_t>();
      case PlyType::uint8:
        return load<std::uint8_t>();
      case PlyType::int16:
        return load<std::int16_t>();
      case PlyType::uint16:
        return load<std::uint16_t>();
      case PlyType::int32:
        return load<std::int32_t>();
      case PlyType::uint32:
        return load<std::uint32_t>();
      case PlyType::float32:
        return static_cast<double>(load<float>());
      case PlyType::float64:
        return load<double>();
    }
    return 0;
  }

  /// Steps over a list property.
  void skip_list(const PlyProperty& list) {
    const double length = next(*list.count_type);
    // At least one byte each, so a length that passes is also a bound on the work.
    if (!(length >= 0) || length > static_cast<double>(data_.size()))
      raise<IoError>(file_, ": a list '", list.name, "' has length ", length, " but ", data_.size(),
                     " bytes are left; the file is damaged");
    const std::size_t count = static_cast<std::size_t>(length);
    if (binary_) {
      take(count * ply_type_size(list.type));
    } else {
      for (std::size_t i = 0; i < count; ++i) (void)next_ascii();
    }
  }

  /// Throws unless `count` rows of `element` can fit into what is left.
  void expect_rows(const PlyElement& element) const {
    std::size_t smallest_row = 0;
    for (const PlyProperty& property : element.properties)
      smallest_row += binary_ ? ply_type_size(property.count_type.value_or(property.type)) : 2;
    // The last number of an ascii file needs no separator.
    const std::size_t left = data_.size() + (binary_ ? 0 : 1);
    if (smallest_row > 0 && element.count > left / smallest_row)
      raise<IoError>(file_, ": the header promises ", element.count, " rows of '", element.name, "' but only ",
                     data_.size(), " bytes are left; the file is truncated, copy it again");
  }

 private:
  const char* take(std::size_t size) {
    if (size > data_.size()) raise<IoError>(file_, " ends inside its data; the file is truncated, copy it again");
    const char* begin = data_.data();
    data_.remove_prefix(size);
    return begin;
  }
  template <class T>
  T load() {
    T value;
    std::memcpy(&value, take(sizeof(T)), sizeof(T));
    return value;
  }
  double next_ascii() {
    while (!data_.empty() && (is_blank(data_.front()) || data_.front() == '\n')) data_.remove_prefix(1);
    std::size_t length = 0;
    while (length < data_.size() && !is_blank(data_[length]) && data_[length] != '\n') ++length;
    const std::string_view word(take(length), length);
    const auto value = parse_number(word);
    if (!value)
      raise<IoError>(file_, ": expected a finite number, found '", excerpt(word),
                     "'; the file is damaged or truncated");
    return *value;
  }

  std::string_view data_;
  bool binary_;
  const std::string& file_;
};

}  // namespace langgs::detail
