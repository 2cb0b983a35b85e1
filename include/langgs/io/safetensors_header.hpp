// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <charconv>
#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "langgs/core/error.hpp"

/// @file The header of a .safetensors file: the small, strict subset of JSON that the format allows.

namespace langgs {

/// Element types of a safetensors file, named as the format names them.
enum class TensorType { BOOL, U8, I8, I16, U16, F16, BF16, I32, U32, F32, I64, U64, F64 };

[[nodiscard]] constexpr std::string_view tensor_type_name(TensorType type) {
  constexpr std::string_view kNames[] = {"BOOL", "U8",  "I8",  "I16", "U16", "F16", "BF16",
                                         "I32",  "U32", "F32", "I64", "U64", "F64"};
  return kNames[static_cast<int>(type)];
}

/// Bytes of one element.
[[nodiscard]] constexpr std::size_t tensor_type_size(TensorType type) {
  constexpr std::size_t kSizes[] = {1, 1, 1, 2, 2, 2, 2, 4, 4, 4, 8, 8, 8};
  return kSizes[static_cast<int>(type)];
}

/// What the header says of one tensor. [begin, end) are byte offsets into the data that follow the header.
struct TensorInfo {
  std::string name;
  TensorType dtype = TensorType::F32;
  std::vector<std::size_t> shape;
  std::size_t begin = 0, end = 0;
};

namespace detail {

/// JSON accepts UTF-8 only; other readers refuse a file with anything else in its names.
[[nodiscard]] inline bool is_utf8(std::string_view text) {
  for (std::size_t i = 0; i < text.size();) {
    const auto byte = [&](std::size_t k) { return static_cast<unsigned char>(text[k]); };
    const unsigned lead = byte(i);
    const std::size_t length = lead < 0x80 ? 1 : lead >= 0xF0 ? 4 : lead >= 0xE0 ? 3 : 2;
    if ((lead >= 0x80 && lead < 0xC2) || lead > 0xF4 || i + length > text.size()) return false;
    unsigned code = length == 1 ? lead : lead & (0x7Fu >> length);
    for (std::size_t k = 1; k < length; ++k) {
      if ((byte(i + k) & 0xC0u) != 0x80u) return false;
      code = (code << 6) | (byte(i + k) & 0x3Fu);
    }
    // Overlong forms, surrogates and what lies beyond Unicode.
    if ((length == 3 && code < 0x800) || (length == 4 && (code < 0x10000 || code > 0x10FFFF))) return false;
    if (code >= 0xD800 && code <= 0xDFFF) return false;
    i += length;
  }
  return true;
}

/// `text` as a JSON string with its quotes.
[[nodiscard]] inline std::string json_quoted(std::string_view text) {
  LANGGS_EXPECTS(is_utf8(text), "a tensor name or metadata string is not UTF-8; convert it first");
  constexpr char kHex[] = "0123456789abcdef";
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    if (static_cast<unsigned char>(c) < 0x20) {
      out += "\\u00";
      out += kHex[c >> 4];
      out += kHex[c & 15];
    } else {
      out += c;
    }
  }
  return out + '"';
}

/// Parses {"__metadata__": {string: string}, name: {"dtype", "shape", "data_offsets"}, ...} and nothing else.
class SafetensorsHeaderParser {
 public:
  SafetensorsHeaderParser(std::string_view text, const std::string& file) : text_(text), file_(file) {}

  void parse(std::map<std::string, std::string>& metadata, std::vector<TensorInfo>& tensors) {
    if (!is_utf8(text_)) fail("it is not UTF-8");
    // The format asks for '{' as the very first byte and allows spaces only at the end.
    if (text_.empty() || text_.front() != '{') fail("it must begin with '{'");
    bool seen_metadata = false;
    object([&](std::string&& key) {
      if (key == "__metadata__") {
        if (std::exchange(seen_metadata, true)) fail("__metadata__ occurs twice");
        object([&](std::string&& name) {
          if (!metadata.emplace(std::move(name), string()).second) fail("a metadata key occurs twice");
        });
      } else {
        tensors.push_back(tensor(std::move(key)));
      }
    });
    skip_space();
    if (at_ != text_.size()) fail("there is text after it");
  }

 private:
  [[noreturn]] void fail(const char* what) const {
    raise<IoError>(file_, ": bad safetensors header at byte ", at_, ": ", what, "; the file is damaged, copy it again");
  }
  void skip_space() {
    while (at_ < text_.size() && (text_[at_] == ' ' || text_[at_] == '\n' || text_[at_] == '\t' || text_[at_] == '\r'))
      ++at_;
  }
  bool accept(char c) {
    skip_space();
    if (at_ >= text_.size() || text_[at_] != c) return false;
    ++at_;
    return true;
  }
  void expect(char c, const char* what) {
    if (!accept(c)) fail(what);
  }

  /// Calls `member(key)` with the cursor before each value.
  template <class Member>
  void object(Member&& member) {
    expect('{', "expected an object");
    if (accept('}')) return;
    do {
      std::string key = string();
      expect(':', "expected ':'");
      member(std::move(key));
    } while (accept(','));
    expect('}', "expected ',' or '}'");
  }

  TensorInfo tensor(std::string&& name) {
    TensorInfo info;
    info.name = std::move(name);
    int seen = 0;  // one bit for each key
    object([&](std::string&& key) {
      const int bit = key == "dtype" ? 1 : key == "shape" ? 2 : key == "data_offsets" ? 4 : 0;
      if (bit == 0 || (seen & bit) != 0) fail("unknown or repeated key of a tensor");
      seen |= bit;
      if (bit == 1) info.dtype = type(string());
      if (bit == 2) info.shape = numbers();
      if (bit == 4) {
        const std::vector<std::size_t> offsets = numbers();
        if (offsets.size() != 2) fail("data_offsets must be two numbers");
        info.begin = offsets[0];
        info.end = offsets[1];
      }
    });
    if (seen != 7) fail("a tensor lacks dtype, shape or data_offsets");
    return info;
  }

  TensorType type(const std::string& name) const {
    for (int i = 0; i <= static_cast<int>(TensorType::F64); ++i)
      if (name == tensor_type_name(static_cast<TensorType>(i))) return static_cast<TensorType>(i);
    fail("unknown dtype");
  }

  std::vector<std::size_t> numbers() {
    std::vector<std::size_t> result;
    expect('[', "expected a list of numbers");
    if (accept(']')) return result;
    do {
      skip_space();
      std::uint64_t value = 0;
      const char* begin = text_.data() + at_;
      const auto [end, error] = std::from_chars(begin, text_.data() + text_.size(), value);
      if (error != std::errc{} || (*begin == '0' && end != begin + 1)) fail("expected a whole number below 2^64");
      at_ += static_cast<std::size_t>(end - begin);
      result.push_back(value);
    } while (accept(','));
    expect(']', "expected ',' or ']'");
    return result;
  }

  std::string string() {
    expect('"', "expected a string");
    std::string out;
    for (;;) {
      if (at_ >= text_.size()) fail("unterminated string");
      const char c = text_[at_++];
      if (c == '"') return out;
      if (static_cast<unsigned char>(c) < 0x20) fail("control character in a string");
      if (c != '\\') {
        out += c;
        continue;
      }
      constexpr std::string_view kEscapes = "\"\\/bfnrt", kMeaning = "\"\\/\b\f\n\r\t";
      const char escape = at_ < text_.size() ? text_[at_++] : '\0';
      const std::size_t i = kEscapes.find(escape);
      if (escape == 'u')
        append_utf8(code_point(), out);
      else if (i != std::string_view::npos)
        out += kMeaning[i];
      else
        fail("unknown escape in a string");
    }
  }

  unsigned hex4() {
    unsigned value = 0;
    if (text_.size() - at_ < 4) fail("unterminated string");
    const char* begin = text_.data() + at_;
    if (std::from_chars(begin, begin + 4, value, 16).ptr != begin + 4) fail("\\u needs four hexadecimal digits");
    at_ += 4;
    return value;
  }
  unsigned code_point() {
    const unsigned high = hex4();
    if (high < 0xD800 || high > 0xDFFF) return high;
    if (high > 0xDBFF || text_.substr(at_, 2) != "\\u") fail("unpaired surrogate");
    at_ += 2;
    const unsigned low = hex4();
    if (low < 0xDC00 || low > 0xDFFF) fail("unpaired surrogate");
    return 0x10000 + ((high - 0xD800) << 10) + (low - 0xDC00);
  }
  static void append_utf8(unsigned code, std::string& out) {
    const auto push = [&](unsigned byte) { out += static_cast<char>(byte); };
    if (code < 0x80) return push(code);
    if (code < 0x800) {
      push(0xC0 | (code >> 6));
    } else {
      if (code < 0x10000) {
        push(0xE0 | (code >> 12));
      } else {
        push(0xF0 | (code >> 18));
        push(0x80 | ((code >> 12) & 0x3F));
      }
      push(0x80 | ((code >> 6) & 0x3F));
    }
    push(0x80 | (code & 0x3F));
  }

  std::string_view text_;
  const std::string& file_;
  std::size_t at_ = 0;
};

}  // namespace detail
}  // namespace langgs
