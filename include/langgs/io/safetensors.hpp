// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <limits>
#include <map>
#include <memory>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "langgs/core/error.hpp"
#include "langgs/core/half.hpp"
#include "langgs/io/atomic_file.hpp"
#include "langgs/io/safetensors_header.hpp"

/// @file Named tensors in one .safetensors file, the format that Python reads with `safetensors`.

namespace langgs {

static_assert(std::endian::native == std::endian::little, "tensors are stored as they lie in memory");

/// The safetensors type of a C++ type.
template <class T>
[[nodiscard]] constexpr TensorType tensor_type_of() {
  static_assert(std::is_same_v<T, Half> || (std::is_arithmetic_v<T> && sizeof(T) <= 8),
                "a tensor holds bool, Half, float, double or integers of fixed width");
  if constexpr (std::is_same_v<T, Half>)
    return TensorType::F16;
  else if constexpr (std::is_same_v<T, float>)
    return TensorType::F32;
  else if constexpr (std::is_same_v<T, double>)
    return TensorType::F64;
  else if constexpr (std::is_same_v<T, bool>)
    return TensorType::BOOL;
  else if constexpr (sizeof(T) == 1)
    return std::is_signed_v<T> ? TensorType::I8 : TensorType::U8;
  else if constexpr (sizeof(T) == 2)
    return std::is_signed_v<T> ? TensorType::I16 : TensorType::U16;
  else if constexpr (sizeof(T) == 4)
    return std::is_signed_v<T> ? TensorType::I32 : TensorType::U32;
  else
    return std::is_signed_v<T> ? TensorType::I64 : TensorType::U64;
}

namespace detail {

/// Longest header that is written or read; the same bound as in the format's own library.
inline constexpr std::uint64_t kMaxSafetensorsHeader = 100'000'000;

/// Bytes of a tensor; false if they do not fit into 64 bits.
[[nodiscard]] inline bool tensor_bytes(TensorType type, const std::vector<std::size_t>& shape, std::size_t& bytes) {
  bytes = tensor_type_size(type);
  for (const std::size_t extent : shape) {
    if (extent != 0 && bytes > std::numeric_limits<std::size_t>::max() / extent) return false;
    bytes *= extent;
  }
  return true;
}

}  // namespace detail

/// Collects tensors and writes them as one file. The data are not copied: they must live until save() returns.
class SafetensorsWriter {
 public:
  std::map<std::string, std::string> metadata;  ///< free text by key

  /// Adds a tensor of `shape` in C order. Throws InvalidArgument for a name that is taken, empty or reserved.
  void add(const std::string& name, TensorType dtype, const std::vector<std::size_t>& shape, const void* data) {
    LANGGS_EXPECTS(!name.empty() && name != "__metadata__", "a tensor cannot be named '", name,
                   "'; choose another name");
    LANGGS_EXPECTS(names_.insert(name).second, "tensor '", name, "' was added before; choose another name");
    std::size_t bytes = 0;
    LANGGS_EXPECTS(detail::tensor_bytes(dtype, shape, bytes), "the size of tensor '", name, "' overflows");
    LANGGS_EXPECTS(bytes == 0 || data != nullptr, "tensor '", name, "' has ", bytes, " bytes but no data");
    entries_.push_back({{name, dtype, shape, 0, bytes}, data});
  }
  template <class T>
  void add(const std::string& name, const std::vector<std::size_t>& shape, const T* data) {
    add(name, tensor_type_of<T>(), shape, static_cast<const void*>(data));
  }

  /// Writes the file; the same tensors give the same bytes. The header lists them in the order of add(); their data are
  /// laid out by falling element size (then in that order), so that each is aligned, as readers that map the file ask.
  void save(const std::filesystem::path& path) const {
    std::vector<std::size_t> layout(entries_.size());
    for (std::size_t i = 0; i < layout.size(); ++i) layout[i] = i;
    std::stable_sort(layout.begin(), layout.end(), [&](std::size_t a, std::size_t b) {
      return tensor_type_size(entries_[a].info.dtype) > tensor_type_size(entries_[b].info.dtype);
    });
    std::vector<std::size_t> begin(entries_.size());
    std::size_t total = 0;
    for (const std::size_t i : layout) {
      begin[i] = total;
      total += entries_[i].info.end;
    }
    std::string header = "{\"__metadata__\":{";
    for (const auto& [key, value] : metadata) {
      if (header.back() != '{') header += ',';
      header += detail::json_quoted(key) + ":" + detail::json_quoted(value);
    }
    header += '}';
    for (std::size_t i = 0; i < entries_.size(); ++i) {
      const TensorInfo& info = entries_[i].info;
      header += "," + detail::json_quoted(info.name) + ":{\"dtype\":\"";
      header += tensor_type_name(info.dtype);
      header += "\",\"shape\":[";
      for (const std::size_t extent : info.shape) {
        if (header.back() != '[') header += ',';
        header += std::to_string(extent);
      }
      header += "],\"data_offsets\":[" + std::to_string(begin[i]) + "," + std::to_string(begin[i] + info.end) + "]}";
    }
    header += '}';
    header.append((8 - header.size() % 8) % 8, ' ');
    LANGGS_EXPECTS(header.size() <= detail::kMaxSafetensorsHeader, "the header of ", path.string(), " would have ",
                   header.size(), " bytes; at most ", detail::kMaxSafetensorsHeader,
                   " are allowed: shorten the metadata");
    AtomicFile file(path);
    const std::uint64_t length = header.size();
    file.write(&length, sizeof(length));
    file.write(header);
    for (const std::size_t i : layout) file.write(entries_[i].data, entries_[i].info.end);
    file.commit();
  }

 private:
  struct Entry {
    TensorInfo info;  ///< with begin = 0 and end = its bytes
    const void* data;
  };
  std::vector<Entry> entries_;
  std::set<std::string> names_;
};

/// A safetensors file in memory. Copies share the data.
class SafetensorsFile {
 public:
  /// Throws IoError for anything that is not a whole, valid file of at most `max_bytes`.
  explicit SafetensorsFile(const std::filesystem::path& path, std::uint64_t max_bytes = std::uint64_t{64} << 30)
      : file_(path.string()), content_(std::make_shared<const std::string>(read_file(path, max_bytes))) {
    std::uint64_t length = 0;
    if (content_->size() < sizeof(length))
      detail::raise<IoError>(file_, " has ", content_->size(), " bytes; this is not a safetensors file");
    std::memcpy(&length, content_->data(), sizeof(length));
    if (length > detail::kMaxSafetensorsHeader || length > content_->size() - sizeof(length))
      detail::raise<IoError>(file_, " promises a header of ", length, " bytes but has ", content_->size(),
                             "; it is truncated or not a safetensors file");
    data_begin_ = sizeof(length) + length;
    detail::SafetensorsHeaderParser(std::string_view(*content_).substr(sizeof(length), length), file_)
        .parse(metadata_, tensors_);
    check_layout();
  }

  [[nodiscard]] const std::map<std::string, std::string>& metadata() const { return metadata_; }
  /// All tensors, in the order of the header.
  [[nodiscard]] const std::vector<TensorInfo>& tensors() const { return tensors_; }

  /// The tensor of that name, or nullptr.
  [[nodiscard]] const TensorInfo* find(std::string_view name) const {
    for (const TensorInfo& info : tensors_)
      if (info.name == name) return &info;
    return nullptr;
  }
  /// The tensor of that name; throws IoError if there is none.
  [[nodiscard]] const TensorInfo& at(std::string_view name) const {
    const TensorInfo* info = find(name);
    if (info == nullptr)
      detail::raise<IoError>(file_, " has no tensor '", name, "'; was it written by another program or version?");
    return *info;
  }

  /// The bytes of a tensor in C order; valid while a copy of this file lives. They need not be aligned in files of
  /// other writers: use values() for numbers.
  [[nodiscard]] std::span<const std::byte> bytes(const TensorInfo& info) const {
    return {reinterpret_cast<const std::byte*>(content_->data()) + data_begin_ + info.begin, info.end - info.begin};
  }

  /// A copy of the elements; throws IoError unless the tensor is there and of type T.
  template <class T>
  [[nodiscard]] std::vector<T> values(std::string_view name) const {
    static_assert(!std::is_same_v<T, bool>, "read BOOL tensors with bytes()");
    const TensorInfo& info = at(name);
    if (info.dtype != tensor_type_of<T>())
      detail::raise<IoError>(file_, ": tensor '", name, "' is ", tensor_type_name(info.dtype), ", expected ",
                             tensor_type_name(tensor_type_of<T>()), "; convert it");
    const std::span<const std::byte> source = bytes(info);
    std::vector<T> result(source.size() / sizeof(T));
    if (!result.empty()) std::memcpy(static_cast<void*>(result.data()), source.data(), source.size());
    return result;
  }

 private:
  /// The format asks that tensors cover the data exactly: no overlap, no hole, nothing left over.
  void check_layout() const {
    const std::size_t data_size = content_->size() - data_begin_;
    std::vector<const TensorInfo*> order;
    std::set<std::string_view> names;
    for (const TensorInfo& info : tensors_) {
      std::size_t bytes = 0;
      if (!detail::tensor_bytes(info.dtype, info.shape, bytes) || info.begin > info.end || info.end > data_size ||
          info.end - info.begin != bytes)
        detail::raise<IoError>(file_, ": tensor '", info.name, "' claims bytes ", info.begin, " to ", info.end, " of ",
                               data_size,
                               ", which does not fit its shape or the file; the file is damaged, copy it again");
      if (!names.insert(info.name).second)
        detail::raise<IoError>(file_, ": tensor '", info.name, "' occurs twice; write the file again");
      order.push_back(&info);
    }
    std::sort(order.begin(), order.end(), [](const TensorInfo* a, const TensorInfo* b) {
      return std::pair(a->begin, a->end) < std::pair(b->begin, b->end);
    });
    std::size_t expected = 0;
    for (const TensorInfo* info : order) {
      if (info->begin != expected)
        detail::raise<IoError>(file_, ": tensor '", info->name, "' begins at byte ", info->begin, " instead of ",
                               expected, "; tensors must not overlap or leave holes");
      expected = info->end;
    }
    if (expected != data_size)
      detail::raise<IoError>(file_, ": ", data_size - expected, " bytes follow the last tensor; the file is damaged");
  }

  std::string file_;
  std::shared_ptr<const std::string> content_;
  std::size_t data_begin_ = 0;
  std::map<std::string, std::string> metadata_;
  std::vector<TensorInfo> tensors_;
};

}  // namespace langgs
