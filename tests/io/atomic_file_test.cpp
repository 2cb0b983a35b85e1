// SPDX-License-Identifier: Apache-2.0
#include "langgs/io/atomic_file.hpp"

#include <sys/resource.h>

#include <csignal>

#include "io_test_support.hpp"

using namespace langgs;
using namespace langgs::test;

TEST_CASE("AtomicFile: the file appears on commit, whole, and nothing else stays") {
  const ScratchFolder folder;
  const auto path = folder / "out.bin";
  put(path, "old");
  {
    AtomicFile file(path);
    file.write("new ");
    file.write("content");
    CHECK(get(path) == "old");
    file.commit();
    CHECK_THROWS_AS(file.write("more"), InvalidArgument);
    CHECK_THROWS_AS(file.commit(), InvalidArgument);
  }
  CHECK(get(path) == "new content");
  CHECK(folder.num_files() == 1);
}

TEST_CASE("AtomicFile: without a commit the old file stays and the temporary one goes") {
  const ScratchFolder folder;
  const auto path = folder / "out.bin";
  put(path, "old");
  { AtomicFile(path).write("half of the new"); }
  CHECK(get(path) == "old");
  CHECK(folder.num_files() == 1);
}

TEST_CASE("AtomicFile: two writers of one file do not disturb each other; a link is followed") {
  const ScratchFolder folder;
  const auto path = folder / "out.bin", link = folder / "link.bin";
  put(path, "old");
  std::filesystem::create_symlink(path, link);
  AtomicFile a(path), b(link);
  a.write("a");
  b.write("b");
  a.commit();
  CHECK(get(path) == "a");
  b.commit();
  CHECK(get(path) == "b");
  CHECK(std::filesystem::is_symlink(link));
  CHECK(folder.num_files() == 2);
}

TEST_CASE("AtomicFile: a place that cannot be written is an IoError that names it") {
  const ScratchFolder folder;
  const std::string missing = io_error([&] { AtomicFile file(folder / "no/such/out.bin"); });
  CHECK(missing.find("no/such/out.bin") != std::string::npos);
  CHECK(missing.find("check that the folder exists") != std::string::npos);
  CHECK(io_error([&] { AtomicFile file(folder / ""); }).find("folder") != std::string::npos);
}

TEST_CASE("AtomicFile: when space runs out it is an IoError, the old file stays and no rest is left") {
  const ScratchFolder folder;
  const auto path = folder / "out.bin";
  put(path, "old");
  rlimit before{};
  REQUIRE(getrlimit(RLIMIT_FSIZE, &before) == 0);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  rlimit limited = before;
  limited.rlim_cur = 1 << 16;  // the kernel then refuses longer files, as a full disk does
  REQUIRE(setrlimit(RLIMIT_FSIZE, &limited) == 0);
  const std::string error = io_error([&] {
    AtomicFile file(path);
    const std::string block(1 << 17, 'x');
    file.write(block);
    file.commit();
  });
  setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, handler);
  CHECK(error.find("out.bin") != std::string::npos);
  CHECK(error.find("free some disk space") != std::string::npos);
  CHECK(get(path) == "old");
  CHECK(folder.num_files() == 1);
}

TEST_CASE("read_file: whole content; missing, too long and odd files are refused") {
  const ScratchFolder folder;
  const std::string bytes("a\0b\nc", 5);
  put(folder / "in", bytes);
  CHECK(read_file(folder / "in", 5) == bytes);
  put(folder / "empty", "");
  CHECK(read_file(folder / "empty", 0).empty());
  CHECK(io_error([&] { (void)read_file(folder / "in", 4); }).find("at most 4") != std::string::npos);
  CHECK(io_error([&] { (void)read_file(folder / "none", 4); }).find("none") != std::string::npos);
  CHECK_THROWS_AS((void)read_file(folder / "", 4), IoError);
  CHECK_THROWS_AS((void)read_file("/dev/zero", 4), IoError);
}

TEST_CASE("read_file: a sparse file larger than the limit is refused before memory is taken") {
  const ScratchFolder folder;
  put(folder / "sparse", "x");
  std::filesystem::resize_file(folder / "sparse", std::uintmax_t{1} << 40);
  CHECK_THROWS_AS((void)read_file(folder / "sparse", std::uint64_t{1} << 30), IoError);
}
