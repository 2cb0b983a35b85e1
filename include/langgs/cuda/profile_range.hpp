// SPDX-License-Identifier: Apache-2.0
#pragma once

#if defined(__has_include)
#if __has_include(<nvtx3/nvToolsExt.h>)
#include <nvtx3/nvToolsExt.h>
#define LANGGS_HAS_NVTX 1
#endif
#endif

namespace langgs::gpu {

/// Names the host's work of a scope for Nsight and other profilers; does nothing where NVTX is not installed.
class ProfileRange {
 public:
#if defined(LANGGS_HAS_NVTX)
  explicit ProfileRange(const char* name) { nvtxRangePushA(name); }
  ~ProfileRange() { nvtxRangePop(); }
#else
  explicit ProfileRange(const char*) {}
#endif
  ProfileRange(const ProfileRange&) = delete;
  ProfileRange& operator=(const ProfileRange&) = delete;
};

}  // namespace langgs::gpu

#undef LANGGS_HAS_NVTX
