// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "langgs/core/error.hpp"
#include "langgs/eval/association.hpp"
#include "langgs/io/atomic_file.hpp"
#include "langgs/io/text.hpp"

namespace langgs {

/// One line of a TUM list such as rgb.txt or depth.txt.
struct TumListEntry {
  double timestamp = 0;  ///< seconds
  std::string filename;  ///< as written: relative to the folder of the list
};

/// Reads `timestamp filename` lines in their order; # starts a comment line. Throws IoError naming the line, also for
/// a list without entries.
[[nodiscard]] inline std::vector<TumListEntry> read_tum_list(const std::filesystem::path& path) {
  constexpr std::uint64_t kMaxBytes = std::uint64_t{1} << 28;  // three million frames
  const std::string content = read_file(path, kMaxBytes);
  std::vector<TumListEntry> entries;
  std::string_view rest = content, line;
  for (int number = 1; detail::next_line(rest, line); ++number) {
    std::string_view words = detail::meaningful(line);
    if (words.empty()) continue;
    const auto timestamp = detail::parse_number(detail::next_word(words));
    const std::string_view filename = detail::trimmed(words);
    if (!timestamp || filename.empty() || filename.find('\0') != std::string_view::npos)
      detail::raise<IoError>(path.string(), ":", number, ": expected 'timestamp filename', found '",
                             detail::excerpt(line), "'; correct the line or start it with #");
    entries.push_back({*timestamp, std::string(filename)});
  }
  if (entries.empty())
    detail::raise<IoError>(path.string(), " lists no files; it needs lines of the form 'timestamp filename'");
  return entries;
}

}  // namespace langgs
