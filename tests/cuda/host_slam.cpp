// SPDX-License-Identifier: Apache-2.0
#include "cuda/slam_run.hpp"

namespace langgs::test {

SlamRun slam_run_on_host() { return slam_run<Host>(); }

}  // namespace langgs::test
