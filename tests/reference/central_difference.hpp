// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>

namespace langgs::reference {

/// Derivative of `function()` by `variable`, fourth-order central difference. `function` must read `variable`.
template <class F>
[[nodiscard]] double central_difference(F&& function, double& variable, double step = 1e-4) {
  const double at = variable;
  const auto value = [&](double offset) {
    variable = at + offset;
    return function();
  };
  const double slope = (8 * (value(step) - value(-step)) - (value(2 * step) - value(-2 * step))) / (12 * step);
  variable = at;
  return slope;
}

/// |a - b| relative to the larger of both, at least `scale`.
[[nodiscard]] inline double relative_error(double a, double b, double scale = 1e-12) {
  return std::abs(a - b) / std::max({std::abs(a), std::abs(b), scale});
}

}  // namespace langgs::reference
