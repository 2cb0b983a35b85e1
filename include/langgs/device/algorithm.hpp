// SPDX-License-Identifier: Apache-2.0
#pragma once

/// @file sort_by_key, exclusive_scan, list_size, scan_in_order, select_flagged, group_by_key, sum_rows: Thrust and CUB
/// behind one set of names. Results in integers are the same on every backend.

#if defined(__CUDACC__)
#include "langgs/cuda/algorithm.hpp"
#else
#include "langgs/host/algorithm.hpp"
#endif
