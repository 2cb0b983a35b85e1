// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "langgs/device/block.hpp"

/// @file `launch`, `for_each_lanes` and `for_each_n`: how kernels and element-wise loops are run on an Executor.

#if defined(__CUDACC__)
#include "langgs/cuda/launch.hpp"
#else
#include "langgs/host/launch.hpp"
#endif
