#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Every header under cuda/ compiles alone, and twice, under nvcc. The device's pass alone: it parses the host's code too.
# Usage: cuda_headers.sh <nvcc> <output directory> <Eigen include directory>, from the repository root.
set -euo pipefail
nvcc=$1 out=$2 eigen=$3
if [[ ! -x $nvcc ]]; then
  echo "SKIPPED: no nvcc on the PATH or under /usr/local/cuda"
  exit 77
fi
mkdir -p "$out"
bad=0
for header in include/langgs/cuda/*.hpp; do
  name=${header#include/}
  source=$out/${name//\//.}.cu
  printf '#include "%s"\n#include "%s"\n' "$name" "$name" >"$source"
  "$nvcc" -std=c++20 --expt-relaxed-constexpr -Werror all-warnings -DEIGEN_NO_CUDA -Iinclude -isystem "$eigen" \
    -arch=compute_75 -ptx "$source" -o "$out/header.ptx" || { echo "FAILED: $name does not compile alone"; bad=1; }
done
exit $bad
