// SPDX-License-Identifier: Apache-2.0
// Reads lines "sm threads registers shared-bytes kernel..." and writes "sm percent ..." behind: the share of a
// multiprocessor's threads that can run at once, by NVIDIA's cuda_occupancy.h.
#include <cuda_occupancy.h>

#include <cstdio>
#include <iostream>
#include <string>

namespace {

struct Multiprocessor {
  int sm, threads;
  std::size_t shared_kib, reserved;
};
// CUDA C++ Programming Guide, technical specifications by compute capability. All of them have 65536 registers.
constexpr Multiprocessor kMultiprocessors[] = {{75, 1024, 64, 0},     {80, 2048, 164, 1024}, {86, 1536, 100, 1024},
                                               {89, 1536, 100, 1024}, {90, 2048, 228, 1024}, {100, 2048, 228, 1024},
                                               {120, 1536, 100, 1024}};

int percent(const Multiprocessor& m, int threads, int registers, std::size_t shared) {
  cudaOccDeviceProp device;
  device.computeMajor = m.sm / 10;
  device.computeMinor = m.sm % 10;
  device.maxThreadsPerBlock = 1024;
  device.maxThreadsPerMultiprocessor = m.threads;
  device.regsPerBlock = device.regsPerMultiprocessor = 65536;
  device.warpSize = 32;
  device.sharedMemPerBlock = 48 * 1024;
  device.sharedMemPerMultiprocessor = m.shared_kib * 1024;
  device.numSms = 1;
  device.sharedMemPerBlockOptin = m.shared_kib * 1024 - m.reserved;
  device.reservedSharedMemPerBlock = m.reserved;
  cudaOccFuncAttributes kernel;
  kernel.maxThreadsPerBlock = threads;
  kernel.numRegs = registers;
  kernel.sharedSizeBytes = shared;
  kernel.partitionedGCConfig = PARTITIONED_GC_OFF;
  kernel.shmemLimitConfig = FUNC_SHMEM_LIMIT_DEFAULT;
  kernel.maxDynamicSharedSizeBytes = 0;
  kernel.numBlockBarriers = 1;
  cudaOccDeviceState state;
  state.cacheConfig = CACHE_PREFER_SHARED;
  state.carveoutConfig = SHAREDMEM_CARVEOUT_MAX_SHARED;
  cudaOccResult result;
  if (cudaOccMaxActiveBlocksPerMultiprocessor(&result, &device, &kernel, &state, threads, 0) != CUDA_OCC_SUCCESS)
    return -1;
  return 100 * result.activeBlocksPerMultiprocessor * threads / m.threads;
}

}  // namespace

int main() {
  int sm = 0, threads = 0, registers = 0;
  std::size_t shared = 0;
  std::string kernel;
  while (std::cin >> sm >> threads >> registers >> shared && std::getline(std::cin, kernel)) {
    int share = -1;
    for (const Multiprocessor& m : kMultiprocessors)
      if (m.sm == sm) share = percent(m, threads, registers, shared);
    std::printf("%d %d %d %d %zu%s\n", sm, share, threads, registers, shared, kernel.c_str());
  }
}
