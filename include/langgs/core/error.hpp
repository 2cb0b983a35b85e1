// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sstream>
#include <stdexcept>
#include <string>

/// @file Errors and contracts. Every message says what was wrong, the value, and the remedy.

namespace langgs {

/// Root of everything that langgs throws.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// A caller's mistake: a size, a range or a combination of arguments that cannot work.
class InvalidArgument : public Error {
 public:
  using Error::Error;
};

/// A file or stream that is missing, malformed, truncated or cannot be written.
class IoError : public Error {
 public:
  using Error::Error;
};

namespace detail {

template <class... Parts>
[[nodiscard]] std::string concat(const Parts&... parts) {
  std::ostringstream text;
  (text << ... << parts);
  return text.str();
}

/// Out of line and cold, so that a contract costs its caller one compare and one jump.
template <class E, class... Parts>
[[noreturn, gnu::noinline, gnu::cold]] void raise(const Parts&... parts) {
  throw E(concat(parts...));
}

}  // namespace detail
}  // namespace langgs

/// Precondition of a public function: throws langgs::InvalidArgument with the concatenated parts as its message.
#define LANGGS_EXPECTS(condition, ...)                                                 \
  do {                                                                                 \
    if (!(condition)) ::langgs::detail::raise<::langgs::InvalidArgument>(__VA_ARGS__); \
  } while (false)
