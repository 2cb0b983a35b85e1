#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Times features of 512 channels and another program in turns on the same workload, so that both see the same machine,
# and prints medians and ratios for one and two threads.
# Usage: compare.sh FEATURE_BENCHMARK WORKLOAD OTHER [ROUNDS]
#   FEATURE_BENCHMARK  the program built from feature_benchmark.cpp
#   WORKLOAD           folder with gs.ply and cameras.txt
#   OTHER              program run as `OTHER WORKLOAD THREADS 9 feat`; of its lines `NAME median X ms` those are read
#                      whose names are in the table of pairs below
# The other program's steps end at the gradients of features in single precision, without recording and without an
# optimiser; its 320x240 step renders all 640x480 pixels, ours the 320x240 that have a teacher.
set -euo pipefail
if (( $# < 3 )); then
  sed -n '5,11s/^# //p' "$0" >&2
  exit 2
fi
benchmark=$1 workload=$2 other=$3 rounds=${4:-5}
for file in "$benchmark" "$other"; do
  [[ -x $file ]] || { echo "compare.sh: $file is not a program" >&2; exit 2; }
done
[[ -f $workload/gs.ply ]] || { echo "compare.sh: $workload has no gs.ply" >&2; exit 2; }
times=$(mktemp)
trap 'rm -f "$times"' EXIT

# ours=theirs
pairs='average/512/3/full=channel-blocked 128, fp16 640x480
average/512/3/quarter=channel-blocked 128, fp16 320x240
streamed/512/3/full=feat512 top3 fwd, not materialised
streamed/512/blend/full=feat512 full alpha, not materialised
float_image/512/3/full=feat512 top3 fwd, materialised fp32 image
float_image/512/blend/full=feat512 full alpha, materialised fp32 image
record/3/full=
record/blend/full=
half_image/512/3/full=
adam/512/3/full='

# shellcheck disable=SC2001  # once for each line
filter=$(sed 's/=.*//' <<<"$pairs" | paste -sd'|')
for (( round = 0; round < rounds; ++round )); do
  for threads in 1 2; do
    "$other" "$workload" "$threads" 9 feat |
      awk -v t="$threads" -F' median ' 'NF == 2 { gsub(/^ +| +$/, "", $1); print $1 "|" t "|" $2 + 0 }' >>"$times"
    LANGGS_WORKLOAD=$workload "$benchmark" --benchmark_format=csv --benchmark_min_time=0.5 \
        --benchmark_filter="^($filter)/threads:$threads/" 2>/dev/null |
      awk -F, -v t="$threads" '/^"/ && /threads:/ {
        gsub(/"/, "", $1); sub(/\/threads:.*/, "", $1); print $1 "|" t "|" $3 }' >>"$times"
  done
done

awk -F'|' -v pairs="$pairs" '
  function median(name, t,    n, i, j, v, swap) {
    n = split(all[name "|" t], v, " ")
    for (i = 1; i < n; ++i) for (j = i + 1; j <= n; ++j) if (v[j] < v[i]) { swap = v[i]; v[i] = v[j]; v[j] = swap }
    return n ? v[int((n + 1) / 2)] : 0
  }
  { all[$1 "|" $2] = all[$1 "|" $2] " " $3 + 0 }
  END {
    printf "%-27s %7s %9s %9s %7s\n", "ms, medians", "threads", "langgs", "other", "ratio"
    n = split(pairs, pair, "\n")
    for (i = 1; i <= n; ++i) for (t = 1; t <= 2; ++t) {
      split(pair[i], name, "=")
      ours = median(name[1], t); theirs = median(name[2], t)
      printf "%-27s %7d %9.2f", name[1], t, ours
      if (theirs > 0) printf " %9.2f %7.2f", theirs, ours / theirs
      print ""
    }
    for (t = 1; t <= 2; ++t) {
      top3 = median("streamed/512/3/full", t); blend = median("streamed/512/blend/full", t)
      if (!top3) continue
      printf "full blending takes %.1f times as long as Top-3, %.1f times with recording (threads: %d)\n", blend / top3,
             (blend + median("record/blend/full", t)) / (top3 + median("record/3/full", t)), t
    }
  }' "$times"
