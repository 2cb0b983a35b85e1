// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "langgs/core/error.hpp"
#include "langgs/core/half.hpp"
#include "langgs/io/atomic_file.hpp"
#include "langgs/io/npy_header.hpp"

/// @file Arrays in NumPy's .npy format, versions 1.0 to 3.0.

namespace langgs {

static_assert(std::endian::native == std::endian::little, "langgs reads and writes little-endian files in place");

namespace detail {

template <class T>
[[nodiscard]] constexpr NpyType npy_type_of() {
  if constexpr (std::is_same_v<T, Half>)
    return NpyType::f2;
  else if constexpr (std::is_floating_point_v<T>)
    return sizeof(T) == 4 ? NpyType::f4 : NpyType::f8;
  else if constexpr (std::is_same_v<T, bool>)
    return NpyType::b1;
  else if constexpr (sizeof(T) == 1)
    return std::is_signed_v<T> ? NpyType::i1 : NpyType::u1;
  else if constexpr (sizeof(T) == 2)
    return std::is_signed_v<T> ? NpyType::i2 : NpyType::u2;
  else if constexpr (sizeof(T) == 4)
    return std::is_signed_v<T> ? NpyType::i4 : NpyType::u4;
  else
    return std::is_signed_v<T> ? NpyType::i8 : NpyType::u8;
}

template <class T>
void convert_to_float(const NpyArray& array, std::vector<float>& out) {
  const std::size_t n = array.size();
  const std::size_t rank = array.shape.size();
  const auto load = [&](std::size_t i) {
    T value;  // the bytes of a string need not be aligned for T
    std::memcpy(&value, array.bytes.data() + i * sizeof(T), sizeof(T));
    return static_cast<float>(value);
  };
  if (!array.fortran_order || rank < 2) {
    for (std::size_t i = 0; i < n; ++i) out[i] = load(i);
    return;
  }
  // An odometer over the C-order index whose last axis turns fastest; in the file the first axis does.
  std::vector<std::size_t> stride(rank, 1), index(rank, 0);
  for (std::size_t d = 1; d < rank; ++d) stride[d] = stride[d - 1] * array.shape[d - 1];
  for (std::size_t i = 0, source = 0; i < n; ++i) {
    out[i] = load(source);
    for (std::size_t d = rank; d-- > 0;) {
      source += stride[d];
      if (++index[d] < array.shape[d]) break;
      source -= stride[d] * array.shape[d];
      index[d] = 0;
    }
  }
}

}  // namespace detail

/// Reads a .npy file of at most `max_bytes`. Throws IoError for anything that is not a whole, plain numeric array.
[[nodiscard]] inline NpyArray read_npy(const std::filesystem::path& path,
                                       std::uint64_t max_bytes = std::uint64_t{4} << 30) {
  const std::string file = path.string();
  std::string content = read_file(path, max_bytes);
  constexpr std::string_view kMagic = "\x93NUMPY";
  if (content.size() < 10 || !content.starts_with(kMagic))
    detail::raise<IoError>(file, " is not a .npy file (", content.size(),
                           " bytes, wrong signature); write it with numpy.save");
  const int major = static_cast<unsigned char>(content[6]), minor = static_cast<unsigned char>(content[7]);
  if (major < 1 || major > 3 || minor != 0)
    detail::raise<IoError>(file, ": .npy version ", major, ".", minor, " is unknown; 1.0, 2.0 and 3.0 are supported");
  const std::size_t length_bytes = major == 1 ? 2 : 4;
  std::size_t header_length = 0;
  if (content.size() < 8 + length_bytes) detail::raise<IoError>(file, " ends inside its header; copy it again");
  std::memcpy(&header_length, content.data() + 8, length_bytes);
  const std::size_t data_begin = 8 + length_bytes + header_length;
  if (data_begin > content.size())
    detail::raise<IoError>(file, " ends inside its header (", content.size(), " of ", data_begin,
                           " bytes); copy it again");

  NpyArray array;
  detail::NpyHeaderParser(std::string_view(content).substr(8 + length_bytes, header_length), file).parse(array);
  std::size_t bytes = npy_type_size(array.dtype);
  for (const std::size_t extent : array.shape) bytes = detail::checked_product(bytes, extent, file);
  if (content.size() - data_begin != bytes)
    detail::raise<IoError>(file, ": its shape needs ", bytes, " bytes of data but ", content.size() - data_begin,
                           " are there; copy it again");
  content.erase(0, data_begin);
  array.bytes = std::move(content);
  return array;
}

/// The elements as floats in C order, whatever type and order they are stored in. Integers beyond 2^24 are rounded.
[[nodiscard]] inline std::vector<float> to_float(const NpyArray& array) {
  std::size_t count = 1;
  for (const std::size_t extent : array.shape) count = detail::checked_product(count, extent, "array");
  LANGGS_EXPECTS(array.bytes.size() == count * npy_type_size(array.dtype), "array has ", array.bytes.size(),
                 " bytes but its shape needs ", count, " elements of type ", npy_type_name(array.dtype));
  std::vector<float> out(count);
  switch (array.dtype) {
    case NpyType::f2:
      detail::convert_to_float<Half>(array, out);
      break;
    case NpyType::f4:
      detail::convert_to_float<float>(array, out);
      break;
    case NpyType::f8:
      detail::convert_to_float<double>(array, out);
      break;
    case NpyType::i1:
      detail::convert_to_float<std::int8_t>(array, out);
      break;
    case NpyType::i2:
      detail::convert_to_float<std::int16_t>(array, out);
      break;
    case NpyType::i4:
      detail::convert_to_float<std::int32_t>(array, out);
      break;
    case NpyType::i8:
      detail::convert_to_float<std::int64_t>(array, out);
      break;
    case NpyType::u1:
    case NpyType::b1:
      detail::convert_to_float<std::uint8_t>(array, out);
      break;
    case NpyType::u2:
      detail::convert_to_float<std::uint16_t>(array, out);
      break;
    case NpyType::u4:
      detail::convert_to_float<std::uint32_t>(array, out);
      break;
    case NpyType::u8:
      detail::convert_to_float<std::uint64_t>(array, out);
      break;
  }
  return out;
}

/// Writes `data` (C order, as many elements as `shape` says) as .npy 1.0, byte for byte as numpy.save does. T is Half,
/// float, double or an integer of fixed width. Throws IoError; the file is complete or absent.
template <class T>
void write_npy(const std::filesystem::path& path, const std::vector<std::size_t>& shape, const T* data) {
  static_assert(std::is_same_v<T, Half> || (std::is_arithmetic_v<T> && sizeof(T) <= 8),
                "write_npy: T must be Half, float, double or an integer of fixed width");
  std::string dims;
  std::size_t bytes = sizeof(T);
  for (std::size_t d = 0; d < shape.size(); ++d) {
    bytes = detail::checked_product(bytes, shape[d], path.string());
    dims += std::to_string(shape[d]);
    // Python writes a tuple of one as "(3,)".
    if (d + 1 < shape.size())
      dims += ", ";
    else if (d == 0)
      dims += ",";
  }
  std::string header = "{'descr': '";
  header += sizeof(T) == 1 ? '|' : '<';
  header += npy_type_name(detail::npy_type_of<T>());
  header += "', 'fortran_order': False, 'shape': (" + dims + "), }";
  constexpr std::size_t kPrefix = 10, kAlignment = 64;  // magic, version, length; data starts at a multiple of 64
  const std::size_t total = (kPrefix + header.size() + 1 + kAlignment - 1) / kAlignment * kAlignment;
  LANGGS_EXPECTS(total - kPrefix <= 0xFFFF, "shape has ", shape.size(), " dimensions; 32 at most");
  header.append(total - kPrefix - header.size() - 1, ' ');
  header += '\n';
  std::string prefix = "\x93NUMPY";
  prefix += {'\x01', '\x00', static_cast<char>(header.size() & 0xFF), static_cast<char>(header.size() >> 8)};
  AtomicFile file(path);
  file.write(prefix);
  file.write(header);
  file.write(data, bytes);
  file.commit();
}

}  // namespace langgs
