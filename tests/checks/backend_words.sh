#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# Only device/, host/ and cuda/ may name a backend's intrinsics. Run from the repository root.
set -eu
words='threadIdx|blockIdx|blockDim|gridDim|__syncthreads|__syncwarp|__CUDA_ARCH__|__shared__|__global__|__shfl|<<<|_mm256_|_mm512_'
found=$(find include/langgs \( -path include/langgs/device -o -path include/langgs/host -o -path include/langgs/cuda \) -prune \
  -o -type f -print | sort | xargs grep -nE "$words" || true)
if [ -n "$found" ]; then
  echo "$found"
  echo "these words belong into include/langgs/{device,host,cuda}/"
  exit 1
fi
echo "backend words: ok"
