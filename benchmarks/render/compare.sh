#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Times the rasteriser and another one in turns on the same workload, so that both see the same machine, and prints
# medians and ratios for one and two threads.
# Usage: compare.sh RENDER_BENCHMARK WORKLOAD OTHER [ROUNDS]
#   RENDER_BENCHMARK  the program built from render_benchmark.cpp
#   WORKLOAD          folder with gs.ply and cameras.txt
#   OTHER             program run as `OTHER WORKLOAD THREADS 9 geo`; of its lines `NAME median X ms` two are read, those
#                     that rotate through the views: `ROTATING CAMS branch-poor fwd` and `... fwd+bwd`
set -euo pipefail
if (( $# < 3 )); then
  sed -n '5,9s/^# //p' "$0" >&2
  exit 2
fi
benchmark=$1 workload=$2 other=$3 rounds=${4:-5}
for file in "$benchmark" "$other"; do
  [[ -x $file ]] || { echo "compare.sh: $file is not a program" >&2; exit 2; }
done
[[ -f $workload/gs.ply ]] || { echo "compare.sh: $workload has no gs.ply" >&2; exit 2; }
times=$(mktemp)
trap 'rm -f "$times"' EXIT

for (( round = 0; round < rounds; ++round )); do
  for threads in 1 2; do
    "$other" "$workload" "$threads" 9 geo |
      awk -v t="$threads" '/ROTATING CAMS branch-poor/ { print "other", $4, t, $6 }' >>"$times"
    LANGGS_WORKLOAD=$workload "$benchmark" --benchmark_format=csv --benchmark_min_time=0.5 \
        --benchmark_filter="^workload/(splat_list|forward|forward_top3|forward_top10|forward_backward)/threads:$threads/" \
        2>/dev/null |
      awk -F, -v t="$threads" '/^"workload/ { split($1, part, "/"); print "langgs", part[2], t, $3 }' >>"$times"
  done
done

awk '
  function median(key,    n, i, j, v, swap) {
    n = split(all[key], v, " ")
    for (i = 1; i < n; ++i) for (j = i + 1; j <= n; ++j) if (v[j] < v[i]) { swap = v[i]; v[i] = v[j]; v[j] = swap }
    return n ? v[int((n + 1) / 2)] : 0
  }
  { all[$1 " " $2 " " $3] = all[$1 " " $2 " " $3] " " $4 + 0 }
  END {
    printf "%-18s %7s %9s %9s %7s\n", "ms, medians", "threads", "langgs", "other", "ratio"
    n = split("splat_list forward forward_top3 forward_top10 forward_backward", names, " ")
    split("- fwd - - fwd+bwd", others, " ")
    for (i = 1; i <= n; ++i) for (t = 1; t <= 2; ++t) {
      ours = median("langgs " names[i] " " t); theirs = median("other " others[i] " " t)
      printf "%-18s %7d %9.2f", names[i], t, ours
      if (theirs > 0) printf " %9.2f %7.2f", theirs, ours / theirs
      print ""
    }
    for (i = 1; i <= n; ++i)
      printf "%-18s two threads are %.2f times as fast as one\n", names[i],
             median("langgs " names[i] " 1") / median("langgs " names[i] " 2")
    plain = median("langgs forward 1")
    printf "Top-3 adds %.0f %%, Top-10 %.0f %% to the forward pass (1 thread)\n",
           100 * (median("langgs forward_top3 1") / plain - 1), 100 * (median("langgs forward_top10 1") / plain - 1)
  }' "$times"
