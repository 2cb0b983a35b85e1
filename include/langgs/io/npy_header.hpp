// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <limits>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "langgs/core/error.hpp"

/// @file What a .npy file says of its array, and the parser of its header.

namespace langgs {

/// Element types of a .npy file, named as NumPy names them (kind and bytes).
enum class NpyType { f2, f4, f8, i1, i2, i4, i8, u1, u2, u4, u8, b1 };

/// NumPy's name of a type, for example "f4".
[[nodiscard]] constexpr std::string_view npy_type_name(NpyType type) {
  constexpr std::string_view kNames[] = {"f2", "f4", "f8", "i1", "i2", "i4", "i8", "u1", "u2", "u4", "u8", "b1"};
  return kNames[static_cast<int>(type)];
}

/// Bytes of one element.
[[nodiscard]] constexpr std::size_t npy_type_size(NpyType type) {
  return static_cast<std::size_t>(npy_type_name(type)[1] - '0');
}

/// An array as stored: `bytes` holds the elements in C order, or in Fortran order if `fortran_order`.
struct NpyArray {
  std::vector<std::size_t> shape;
  NpyType dtype = NpyType::f4;
  bool fortran_order = false;
  std::string bytes;

  [[nodiscard]] std::size_t size() const { return bytes.size() / npy_type_size(dtype); }  ///< elements
};

namespace detail {

/// a * b, or IoError: a product that overflows never was the size of a real array.
[[nodiscard]] inline std::size_t checked_product(std::size_t a, std::size_t b, std::string_view file) {
  if (a != 0 && b > std::numeric_limits<std::size_t>::max() / a)
    raise<IoError>(file, ": a shape of ", a, " x ", b, " elements overflows; the file is damaged");
  return a * b;
}

/// Reads the header's Python literal: a dictionary with exactly the keys descr, fortran_order and shape.
class NpyHeaderParser {
 public:
  NpyHeaderParser(std::string_view text, const std::string& file) : text_(text), file_(file) {}

  void parse(NpyArray& array) {
    bool seen_type = false, seen_order = false, seen_shape = false;
    expect('{');
    while (!accept('}')) {
      const std::string_view key = quoted();
      expect(':');
      if (key == "descr" && !std::exchange(seen_type, true)) {
        array.dtype = dtype(quoted());
      } else if (key == "fortran_order" && !std::exchange(seen_order, true)) {
        array.fortran_order = boolean();
      } else if (key == "shape" && !std::exchange(seen_shape, true)) {
        array.shape = shape();
      } else {
        fail("unknown or repeated key '" + std::string(key) + "'");
      }
      if (!accept(',')) {
        expect('}');
        break;
      }
    }
    skip_space();
    if (at_ != text_.size()) fail("text after the dictionary");
    if (!seen_type || !seen_order || !seen_shape) fail("descr, fortran_order or shape is missing");
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    raise<IoError>(file_, ": bad .npy header at character ", at_, ": ", what,
                   "; save it again with numpy.save as a plain numeric array");
  }
  void skip_space() {
    while (at_ < text_.size() && (text_[at_] == ' ' || text_[at_] == '\n' || text_[at_] == '\t')) ++at_;
  }
  bool accept(char c) {
    skip_space();
    if (at_ >= text_.size() || text_[at_] != c) return false;
    ++at_;
    return true;
  }
  void expect(char c) {
    if (!accept(c)) fail(std::string("expected '") + c + "'");
  }
  bool accept_word(std::string_view word) {
    skip_space();
    if (text_.substr(at_, word.size()) != word) return false;
    at_ += word.size();
    return true;
  }
  std::string_view quoted() {
    skip_space();
    const char quote = at_ < text_.size() ? text_[at_] : '\0';
    // A structured type has a list here; its arrays are tables, not numbers.
    if (quote != '\'' && quote != '"') fail("expected a quoted word");
    const std::size_t end = text_.find(quote, at_ + 1);
    if (end == std::string_view::npos) fail("unterminated quote");
    const std::string_view word = text_.substr(at_ + 1, end - at_ - 1);
    at_ = end + 1;
    return word;
  }
  bool boolean() {
    if (accept_word("True")) return true;
    if (!accept_word("False")) fail("expected True or False");
    return false;
  }
  std::vector<std::size_t> shape() {
    constexpr std::size_t kMaxDimensions = 32;  // NumPy's own limit
    std::vector<std::size_t> result;
    expect('(');
    while (!accept(')')) {
      skip_space();
      std::size_t value = 0, digits = 0;
      for (; at_ < text_.size() && text_[at_] >= '0' && text_[at_] <= '9'; ++at_, ++digits) {
        const std::size_t digit = static_cast<std::size_t>(text_[at_] - '0');
        if (value > (std::numeric_limits<std::size_t>::max() - digit) / 10) fail("a dimension overflows");
        value = 10 * value + digit;
      }
      if (digits == 0) fail("expected a dimension");
      accept('L');  // written by Python 2
      if (result.size() == kMaxDimensions) fail("more than 32 dimensions");
      result.push_back(value);
      if (!accept(',')) {
        expect(')');
        break;
      }
    }
    return result;
  }
  NpyType dtype(std::string_view descr) const {
    if (descr.size() == 3 && descr[0] == '>' && descr[2] != '1')
      raise<IoError>(file_, ": type '", descr, "' is big-endian; convert it with array.astype('<", descr.substr(1),
                     "')");
    if (descr.size() == 3 && (descr[0] == '<' || descr[0] == '|' || descr[0] == '=' || descr[0] == '>'))
      for (int i = 0; i <= static_cast<int>(NpyType::b1); ++i)
        if (descr.substr(1) == npy_type_name(static_cast<NpyType>(i))) return static_cast<NpyType>(i);
    raise<IoError>(file_, ": type '", descr, "' is not supported; convert it with array.astype('float32')");
  }

  std::string_view text_;
  const std::string& file_;
  std::size_t at_ = 0;
};

}  // namespace detail
}  // namespace langgs
