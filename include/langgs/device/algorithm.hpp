// SPDX-License-Identifier: Apache-2.0
#pragma once

/// @file sort_by_key, exclusive_scan, select_flagged, group_by_key: Thrust and CUB behind one set of names.
/// For CUDA they are not written yet: owners of buffers can be named there, and cannot be instantiated.

#if !defined(__CUDACC__)
#include "langgs/host/algorithm.hpp"
#endif
