// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <string>

namespace langgs::examples {

/// Progress on standard error: one line that is rewritten on a terminal, a plain line every few seconds elsewhere.
class Progress {
 public:
  explicit Progress(std::string what);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// `done` of `total` steps; `detail` is shown after rate and remaining time.
  void update(int done, int total, const std::string& detail = {});
  /// A line of its own, for what happened on the way.
  void note(const std::string& text);
  /// Ends the line.
  void finish();

 private:
  using Clock = std::chrono::steady_clock;
  std::string what_;
  bool terminal_;
  bool line_open_ = false;
  Clock::time_point start_, shown_;
};

/// From now on Ctrl-C only sets a flag; a second one ends the program at once.
void catch_interrupts();
[[nodiscard]] bool interrupted();

}  // namespace langgs::examples
