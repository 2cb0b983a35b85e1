// SPDX-License-Identifier: Apache-2.0
#pragma once

/// @file sort_by_key, exclusive_scan, select_flagged, group_by_key: Thrust and CUB behind one set of names.

#include "langgs/host/algorithm.hpp"
