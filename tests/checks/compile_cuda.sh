#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Compiles the kernels (tests/cuda/compile_*.cu) for four generations of GPUs. A kernel that spills registers, or
# keeps per-thread values in local memory (a stack frame), is a failure. EIGEN_NO_CUDA: Eigen is host code, as for g++.
# Usage: compile_cuda.sh <nvcc> <output directory> <Eigen include directory>, from the repository root.
set -euo pipefail
nvcc=$1 out=$2 eigen=$3
shopt -s nullglob
sources=(tests/cuda/compile_*.cu)
if [[ ! -x $nvcc ]]; then
  echo "SKIPPED: no nvcc on the PATH or under /usr/local/cuda"
  exit 77
fi
if (( ${#sources[@]} == 0 )); then
  echo "SKIPPED: there is no tests/cuda/compile_*.cu"
  exit 77
fi
mkdir -p "$out"
failed=0
for source in "${sources[@]}"; do
  log=$out/$(basename "$source").log
  echo "$source"
  generations="75 80 90 120"
  if ! "$nvcc" -std=c++20 -O3 --expt-relaxed-constexpr -DEIGEN_NO_CUDA -Iinclude -Itests -isystem "$eigen" \
      $(printf -- '-gencode arch=compute_%d,code=sm_%d ' $(for g in $generations; do echo "$g $g"; done)) \
      -Xptxas -v -c "$source" -o "$out/$(basename "$source").o" >"$log" 2>&1; then
    grep -v 'ptxas info' "$log" | head -n 60
    echo "FAILED to compile: $source (whole log: $log)"
    failed=1
    continue
  fi
  # ptxas prints for each kernel: its name, "N bytes stack frame, N bytes spill stores", "Used N registers".
  awk '
    /Compiling entry function/ { split($0, part, "\047"); kernel = part[2]; arch = part[4] }
    /bytes stack frame/ {
      stack = $1
      for (i = 1; i < NF; ++i) if ($i == "bytes" && $(i + 1) == "spill") { spill = $(i - 1); break }
    }
    /Used [0-9]+ registers/ && kernel != "" {
      match($0, /Used [0-9]+ registers/)
      used = substr($0, RSTART, RLENGTH)
      printf "  %s %s, %d bytes on the stack, %d bytes spilled: %s\n", arch, used, stack, spill, kernel
      if (spill > 0 || stack > 0) bad = 1
      ++kernels
      kernel = ""; spill = 0; stack = 0
    }
    END { if (kernels == 0) print "  no kernels"; exit bad }' "$log" >"$log.kernels" ||
    { echo "FAILED: $source has kernels that spill registers or use local memory"; failed=1; }
  if command -v c++filt >/dev/null; then c++filt <"$log.kernels"; else cat "$log.kernels"; fi
done
exit $failed
