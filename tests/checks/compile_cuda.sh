#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Compiles tests/cuda/*.cu for three generations of GPUs; a register spill in any kernel is a failure.
# Usage: compile_cuda.sh <nvcc> <output directory> <Eigen include directory>, from the repository root.
set -euo pipefail
nvcc=$1 out=$2 eigen=$3
shopt -s nullglob
sources=(tests/cuda/*.cu)
if [[ ! -x $nvcc ]]; then
  echo "SKIPPED: no nvcc on the PATH or under /usr/local/cuda"
  exit 77
fi
if (( ${#sources[@]} == 0 )); then
  echo "SKIPPED: there is no tests/cuda/*.cu"
  exit 77
fi
mkdir -p "$out"
failed=0
for source in "${sources[@]}"; do
  log=$out/$(basename "$source").log
  echo "$source"
  if ! "$nvcc" -std=c++20 -O3 --expt-relaxed-constexpr -Iinclude -Itests -isystem "$eigen" \
      -gencode arch=compute_75,code=sm_75 -gencode arch=compute_80,code=sm_80 -gencode arch=compute_90,code=sm_90 \
      -Xptxas -v -c "$source" -o "$out/$(basename "$source").o" >"$log" 2>&1; then
    grep -v 'ptxas info' "$log" | head -n 60
    echo "FAILED to compile: $source (whole log: $log)"
    failed=1
    continue
  fi
  # ptxas prints for each kernel: its name, "N bytes spill stores", "Used N registers".
  awk '
    /Compiling entry function/ { split($0, part, "\047"); kernel = part[2]; arch = part[4] }
    /bytes spill stores/ { for (i = 1; i < NF; ++i) if ($i == "bytes" && $(i + 1) == "spill") { spill = $(i - 1); break } }
    /Used [0-9]+ registers/ && kernel != "" {
      match($0, /Used [0-9]+ registers/)
      printf "  %s %s: %s, %d bytes spilled\n", arch, substr(kernel, 1, 90), substr($0, RSTART, RLENGTH), spill
      if (spill > 0) bad = 1
      kernel = ""; spill = 0
    }
    END { exit bad }' "$log" || { echo "FAILED: $source has kernels that spill registers"; failed=1; }
done
exit $failed
