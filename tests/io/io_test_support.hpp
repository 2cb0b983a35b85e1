// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <doctest/doctest.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "langgs/core/error.hpp"

namespace langgs::test {

/// A folder that is gone after the test.
class ScratchFolder {
 public:
  ScratchFolder() {
    static std::atomic<int> counter{0};
    path_ = std::filesystem::temp_directory_path() /
            ("langgs_test_" + std::to_string(::getpid()) + "_" + std::to_string(counter++));
    std::filesystem::create_directories(path_);
  }
  ~ScratchFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;

  [[nodiscard]] std::filesystem::path operator/(const std::string& name) const { return path_ / name; }
  [[nodiscard]] int num_files() const {
    return static_cast<int>(std::distance(std::filesystem::directory_iterator(path_), {}));
  }

 private:
  std::filesystem::path path_;
};

inline void put(const std::filesystem::path& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

inline std::string get(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

/// The message of the IoError that `action` throws; empty if it does not throw.
template <class Action>
std::string io_error(Action&& action) {
  try {
    action();
  } catch (const IoError& error) {
    return error.what();
  }
  return {};
}

/// Damages `seed` in many deterministic ways and feeds each to `read(path)`, which may succeed or throw IoError but
/// nothing else. Returns how many were refused.
template <class Read>
int mutation_fuzz(const std::string& seed, int rounds, Read&& read) {
  const ScratchFolder folder;
  const std::filesystem::path path = folder / "mutant";
  std::uint64_t state = 0x9E3779B97F4A7C15u;
  const auto random = [&](std::size_t bound) {
    state ^= state << 13;
    state ^= state >> 7;
    state ^= state << 17;
    return static_cast<std::size_t>(state % bound);
  };
  int refused = 0;
  const auto feed = [&](const std::string& mutant) {
    std::filesystem::remove(path);  // some file systems flush a file that is truncated and written again
    put(path, mutant);
    try {
      read(path);
    } catch (const IoError&) {
      ++refused;
    } catch (const std::exception& error) {
      FAIL("a damaged file raised something else than IoError: " << error.what());
    }
  };
  // Every truncation of the beginning, where the lengths are.
  for (std::size_t length = 0; length < seed.size() && length < 400; ++length) feed(seed.substr(0, length));
  const std::string interesting("\x00\xFF\x7F\x80\n 0-9e{}[](),:\"'\\.u", 24);
  for (int round = 0; round < rounds; ++round) {
    std::string mutant = seed;
    for (std::size_t edits = 1 + random(4); edits > 0 && !mutant.empty(); --edits) {
      // Mostly near the front: headers decide over sizes.
      const std::size_t reach = random(4) == 0 ? mutant.size() : std::min<std::size_t>(mutant.size(), 256);
      const std::size_t at = random(reach);
      const std::size_t length = std::min(mutant.size() - at, 1 + random(8));
      switch (random(6)) {
        case 0:
          mutant[at] = static_cast<char>(random(256));
          break;
        case 1:
          mutant[at] = interesting[random(interesting.size())];
          break;
        case 2:
          mutant.erase(at, length);
          break;
        case 3:
          mutant.insert(at, mutant.substr(at, length));
          break;
        case 4:
          mutant.insert(at, std::string(1 + random(20), static_cast<char>('0' + random(10))));
          break;
        case 5:
          mutant.resize(at);
          break;
      }
    }
    feed(mutant);
  }
  return refused;
}

}  // namespace langgs::test
