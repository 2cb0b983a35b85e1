// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <new>
#include <string>
#include <string_view>
#include <system_error>

#include "langgs/core/error.hpp"

/// @file Whole-file reading and crash-safe writing: the only place of the library that talks to the file system
/// (POSIX).

namespace langgs {

/// Writes a file that appears under its name complete or not at all.
///
/// Bytes go to a temporary file in the target's folder; commit() syncs it and renames it over the target. Without a
/// commit (an exception, a full disk) the temporary file is removed and an older target stays as it was.
class AtomicFile {
 public:
  /// Throws IoError if no file can be created in the target's folder.
  explicit AtomicFile(const std::filesystem::path& target) : target_(target) {
    std::error_code ignored;
    // A rename would replace the link itself; the user means what it points to.
    if (std::filesystem::is_symlink(target_, ignored)) {
      const std::filesystem::path resolved = std::filesystem::weakly_canonical(target_, ignored);
      if (!ignored) target_ = resolved;
    }
    if (target_.filename().empty() || std::filesystem::is_directory(target_, ignored))
      detail::raise<IoError>("cannot write ", target_.string(), ": it is a folder; give the name of a file");
    constexpr int kMaxAttempts = 1000;  // leftovers of killed programs that had the same process id
    for (int attempt = 0; attempt < kMaxAttempts && file_ < 0; ++attempt) {
      temporary_ = target_;
      temporary_ += ".tmp" + std::to_string(::getpid()) + "_" + std::to_string(attempt);
      file_ = ::open(temporary_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
      if (file_ < 0 && errno != EEXIST) break;
    }
    if (file_ < 0) fail("create a file beside it", "check that the folder exists and is writable");
  }
  ~AtomicFile() { discard(); }
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  /// Appends `size` bytes; throws IoError when they cannot be stored, as on a full disk.
  void write(const void* data, std::size_t size) {
    LANGGS_EXPECTS(file_ >= 0, "write to ", target_.string(), " after commit; open a new AtomicFile");
    constexpr std::size_t kMaxChunk = std::size_t{1} << 30;  // Linux moves at most 2 GiB per call
    const char* next = static_cast<const char*>(data);
    while (size > 0) {
      const ssize_t written = ::write(file_, next, size < kMaxChunk ? size : kMaxChunk);
      if (written < 0 && errno == EINTR) continue;
      if (written <= 0) fail("write", "free some disk space or choose another folder");
      next += written;
      size -= static_cast<std::size_t>(written);
    }
  }
  void write(std::string_view text) { write(text.data(), text.size()); }

  /// Makes the file durable and visible under its name.
  void commit() {
    LANGGS_EXPECTS(file_ >= 0, "second commit of ", target_.string(), "; commit once");
    if (::fsync(file_) != 0) fail("sync", "free some disk space or check the disk");
    const int file = file_;
    file_ = -1;
    if (::close(file) != 0) fail("close", "free some disk space or check the disk");
    if (::rename(temporary_.c_str(), target_.c_str()) != 0) fail("rename its temporary file to it", "check the folder");
    temporary_.clear();
    // The rename survives a power cut only once the folder is synced; some file systems refuse this, which is harmless.
    const std::filesystem::path parent = target_.parent_path();
    const int folder = ::open(parent.empty() ? "." : parent.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (folder >= 0) {
      ::fsync(folder);
      ::close(folder);
    }
  }

 private:
  [[noreturn]] void fail(const char* action, const char* remedy) {
    const std::string reason = std::strerror(errno);
    discard();
    detail::raise<IoError>("cannot write ", target_.string(), ": failed to ", action, " (", reason, "); ", remedy);
  }
  void discard() noexcept {
    if (file_ >= 0) ::close(file_);
    if (!temporary_.empty()) ::unlink(temporary_.c_str());
    file_ = -1;
    temporary_.clear();
  }

  std::filesystem::path target_, temporary_;
  int file_ = -1;
};

/// The bytes of a regular file of at most `max_bytes`; the size is checked before memory is allocated. Throws IoError.
[[nodiscard]] inline std::string read_file(const std::filesystem::path& path, std::uint64_t max_bytes) {
  struct Descriptor {
    int value;
    ~Descriptor() {
      if (value >= 0) ::close(value);
    }
  };
  // O_NONBLOCK: opening a pipe that nobody writes to would wait for ever.
  const Descriptor file{::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK)};
  if (file.value < 0)
    detail::raise<IoError>("cannot read ", path.string(), ": ", std::strerror(errno), "; check the path");
  struct stat status {};
  if (::fstat(file.value, &status) != 0 || !S_ISREG(status.st_mode))
    detail::raise<IoError>("cannot read ", path.string(), ": it is not a regular file; give the name of a file");
  const std::uint64_t size = static_cast<std::uint64_t>(status.st_size);
  if (size > max_bytes)
    detail::raise<IoError>(path.string(), " has ", size, " bytes; at most ", max_bytes,
                           " are accepted for this kind of file");
  std::string bytes;
  try {
    bytes.resize(size);
  } catch (const std::exception&) {
    detail::raise<IoError>("no memory for the ", size, " bytes of ", path.string(), "; free some memory");
  }
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t got = ::read(file.value, bytes.data() + done, bytes.size() - done);
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0)
      detail::raise<IoError>("cannot read ", path.string(), ": it ended after ", done, " of ", size,
                             " bytes; is another program writing it?");
    done += static_cast<std::size_t>(got);
  }
  return bytes;
}

}  // namespace langgs
