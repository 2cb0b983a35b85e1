// SPDX-License-Identifier: Apache-2.0
#include "common/progress.hpp"

#include <unistd.h>

#include <csignal>
#include <cstdio>

namespace langgs::examples {

namespace {

volatile std::sig_atomic_t interrupt_flag = 0;

void on_interrupt(int signal) {
  interrupt_flag = 1;
  std::signal(signal, SIG_DFL);
}

std::string duration(double seconds) {
  char text[32];
  const int s = static_cast<int>(seconds + 0.5);
  if (s < 3600)
    std::snprintf(text, sizeof(text), "%d:%02d", s / 60, s % 60);
  else
    std::snprintf(text, sizeof(text), "%d:%02d:%02d", s / 3600, s / 60 % 60, s % 60);
  return text;
}

}  // namespace

void catch_interrupts() {
  std::signal(SIGINT, on_interrupt);
  std::signal(SIGTERM, on_interrupt);
}
bool interrupted() { return interrupt_flag != 0; }

Progress::Progress(std::string what)
    : what_(std::move(what)), terminal_(::isatty(2) != 0), start_(Clock::now()), shown_(Clock::now()) {}
Progress::~Progress() { finish(); }

void Progress::update(int done, int total, const std::string& detail) {
  const Clock::time_point now = Clock::now();
  const bool complete = done >= total;
  const auto period = terminal_ ? std::chrono::milliseconds(100) : std::chrono::milliseconds(5000);
  if (!complete && now - shown_ < period) return;
  shown_ = now;
  const double elapsed = std::chrono::duration<double>(now - start_).count();
  const double rate = elapsed > 0 ? done / elapsed : 0;
  char text[160];
  std::snprintf(text, sizeof(text), "%s %d/%d  %.1f/s  %s%s", what_.c_str(), done, total, rate,
                complete ? "in " : "left ", duration(complete ? elapsed : (total - done) / rate).c_str());
  const std::string line = text + (detail.empty() ? "" : "  " + detail);
  std::fprintf(stderr, terminal_ ? "\r\033[K%s" : "%s\n", line.c_str());
  std::fflush(stderr);
  line_open_ = terminal_;
}

void Progress::note(const std::string& text) {
  std::fprintf(stderr, line_open_ ? "\r\033[K%s\n" : "%s\n", text.c_str());
  line_open_ = false;
}

void Progress::finish() {
  if (line_open_) std::fputc('\n', stderr);
  line_open_ = false;
}

}  // namespace langgs::examples
