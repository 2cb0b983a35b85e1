#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Compiles every kernel (tests/cuda/all_kernels.cu) and lists for each generation of GPUs its registers, shared memory
# and occupancy. A kernel that spills registers, keeps per-thread values in local memory (a stack frame) or lets less
# than a quarter of a multiprocessor's threads run at once is a failure: a quarter still hides memory's latency where
# each thread has several loads under way. So is a kernel that the list leaves out.
# Usage: cuda_kernels.sh <nvcc> <c++ compiler> <output directory> <Eigen include directory> [page], from the repository
# root. With a page, the figures are also written there (docs/cuda_kernels.md).
set -euo pipefail
nvcc=$1 compiler=$2 out=$3 eigen=$4 page=${5:-}
generations="75 80 86 89 90 100 120"
least_occupancy=25
if [[ ! -x $nvcc ]]; then
  echo "SKIPPED: no nvcc on the PATH or under /usr/local/cuda"
  exit 77
fi
mkdir -p "$out"

# Two kinds of PTX, for from sm_80 on there are instructions that we use; each generation's assembler allocates registers.
for from in 75 80; do
  if ((from == 75)); then to=75; else to=${generations#75 }; fi
  "$nvcc" -std=c++20 -O3 --expt-relaxed-constexpr -DEIGEN_NO_CUDA -Iinclude -Itests -isystem "$eigen" \
    -arch=compute_$from -ptx tests/cuda/all_kernels.cu -o "$out/kernels_$from.ptx"
  "$nvcc" -gencode "arch=compute_$from,code=[sm_${to// /,sm_}]" -fatbin -Xptxas -v "$out/kernels_$from.ptx" \
    -o "$out/kernels_$from.fatbin" >"$out/ptxas_$from.log" 2>&1 || { cat "$out/ptxas_$from.log"; exit 1; }
done
cat "$out"/ptxas_75.log "$out"/ptxas_80.log >"$out/ptxas.log"

# The PTX has each kernel's threads; ptxas prints its name, "N bytes stack frame", and "Used N registers, ... N bytes
# smem".
awk '
  function number_before(word,   text) {
    if (!match($0, "[0-9]+ " word)) return 0
    text = substr($0, RSTART, RLENGTH); sub(/ .*/, "", text); return text
  }
  FNR == NR && /\.entry/ { sub(/.*\.entry /, ""); sub(/\(.*/, ""); entry = $0; next }
  FNR == NR && /\.maxntid/ { gsub(/[^0-9 ]/, ""); threads[entry] = $1; next }
  FNR == NR { next }
  /Compiling entry function/ { split($0, part, "\047"); kernel = part[2]; sm = part[4]; sub(/sm_/, "", sm) }
  /bytes stack frame/ { stack = number_before("bytes stack frame"); spill = number_before("bytes spill stores") }
  /Used [0-9]+ registers/ && kernel ~ /^_ZN6langgs/ {
    match($0, /Used [0-9]+/); used = substr($0, RSTART + 5, RLENGTH - 5)
    print sm, threads[kernel], used, number_before("bytes smem"), stack, spill, kernel
    kernel = ""
  }' "$out/kernels_75.ptx" "$out/ptxas.log" >"$out/resources.txt"
toolkit=$("$nvcc" --dryrun -c -x cu /dev/null 2>&1 | sed -n 's/^#\$ TOP=//p')
"$compiler" -std=c++17 -isystem "$toolkit/include" tests/checks/occupancy.cpp -o "$out/occupancy"
filter=cat
if command -v c++filt >/dev/null; then filter=c++filt; fi
"$out/occupancy" <"$out/resources.txt" | $filter |
  sed -e 's/void langgs::detail:://' -e 's/langgs:://g' -e 's/([^(]*$//' -e 's/ >/>/g' >"$out/report.txt"

bad=0
awk -v least=$least_occupancy -v generations="$generations" '
  BEGIN { print "   sm occupancy threads registers shared  kernel" }
  {
    name = $0
    for (i = 1; i <= 7; ++i) sub(/^[^ ]+ /, "", name)
    ++seen[$1]
    printf "%5d %8d%% %7d %9d %6d  %s\n", $1, $2, $3, $4, $5, name
    if ($6 > 0 || $7 > 0) { print "FAILED: " $7 " bytes spilled, " $6 " bytes of local memory"; bad = 1 }
    if ($2 < least) { print "FAILED: less than " least "% of the threads run at once"; bad = 1 }
  }
  END {
    for (i = split(generations, sm, " "); i >= 1; --i)
      if (!seen[sm[i]]) { print "FAILED: no kernels for sm_" sm[i]; bad = 1 }
    exit bad
  }' "$out/report.txt" || bad=1

# A kernel is a struct that is called with a block, with lanes, or with the number of an element.
# shellcheck disable=SC2013
for kernel in $(find include/langgs -name '*.hpp' -exec awk '
    FNR == 1 { name = "" }
    /^ *(struct|class) [A-Z]/ && !/ Shared/ { name = $2; sub(/[^A-Za-z0-9_].*/, "", name) }
    /HD void operator\(\)\((Block& |const Lanes& |int( [a-z]+)?\))/ { print name }' {} +); do
  grep -q "\b$kernel\b" "$out/report.txt" || { echo "FAILED: tests/cuda/all_kernels.cu leaves out $kernel"; bad=1; }
done

if [[ -n $page ]]; then
  version=$("$nvcc" --version | sed -n 's/.*release .*, V//p')
  awk -v generations="$generations" -v version="$version" -v least=$least_occupancy -f tests/checks/cuda_kernels_page.awk \
    "$out/report.txt" >"$page"
fi
exit $bad
