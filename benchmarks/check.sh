#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Holds figures against their bounds. Prints one line for each, `NAME what value bound ok|short`, and ends with exit
# code 0 only if none is short. What needs something that is not there is skipped aloud.
# Usage: check.sh NAME...
#   track            times of registration and of the front end, and trajectory errors, on the built-in room and on the
#                    sequences in LANGGS_DATA_DIR
#   render, feature  times; in turns with another program, named by LANGGS_YARDSTICK, on the folder LANGGS_WORKLOAD
#   memory           bytes of a map and of keyframes on the built-in room
#   quality          accuracy on the built-in room, and on the sequences in LANGGS_DATA_DIR
# Programs are taken from build/release (LANGGS_BUILD says another); leave the machine alone while times are taken.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
build=${LANGGS_BUILD:-build/release}
(($# > 0)) || { sed -n '5,11s/^# //p' "$0" >&2; exit 2; }
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT
short=0

# figure NAME WHAT VALUE at-most|at-least BOUND
figure() {
  local verdict=ok
  # A figure that is missing is short.
  awk -v v="$3" -v b="$5" -v at="$4" 'BEGIN { exit !(v != "" && (at == "at-most" ? v <= b : v >= b)) }' || { verdict=short; short=1; }
  echo "$1 $2 $3 $5 $verdict"
}
skip() { echo "$1 skipped: $2" >&2; }
has() { [[ -x $build/$2 ]] || { skip "$1" "$build/$2 is not built"; return 1; }; }

# value FILE KEY...: a number of a metrics.json
value() { python3 -c 'import functools, json, sys
print(functools.reduce(lambda j, key: j[key], sys.argv[2:], json.load(open(sys.argv[1]))))' "$@"; }
slam() {
  local folder=$out/$1
  shift
  "$build/examples/langgs_slam" --output "$folder" --no-pictures --threads 2 "$@" >"$out/log" 2>&1 || {
    tail -n 3 "$out/log" >&2
    return 1
  }
}

# Ratios and times of a comparison's table: row NAME THREADS COLUMN
row() { awk -v n="$1" -v t="$2" -v c="$3" '$1 == n && $2 == t { print $c }' "$out/table"; }
compared() {
  has "$1" "benchmarks/$1_benchmark" || return 1
  [[ -n ${LANGGS_WORKLOAD:-} && -n ${LANGGS_YARDSTICK:-} ]] || {
    skip "$1" "set LANGGS_WORKLOAD and LANGGS_YARDSTICK, see benchmarks/$1/compare.sh"
    return 1
  }
  "benchmarks/$1/compare.sh" "$build/benchmarks/$1_benchmark" "$LANGGS_WORKLOAD" "$LANGGS_YARDSTICK" 3 >"$out/table"
}

check_render() {
  compared render || return 0
  figure render forward_ratio "$(row forward 1 5)" at-most 1.0
  figure render forward_backward_ratio "$(row forward_backward 1 5)" at-most 1.1
}
check_feature() {
  compared feature || return 0
  figure feature step_full_ratio "$(row average/512/3/full 2 5)" at-most 1.0
  figure feature step_quarter_ms "$(row average/512/3/quarter 2 3)" at-most 14
  figure feature blend_over_top3 \
    "$(awk -v a="$(row streamed/512/blend/full 2 3)" -v b="$(row streamed/512/3/full 2 3)" 'BEGIN { print a / b }')" \
    at-least 20
}
# ate NAME BOUND OPTION...: trajectory error of a whole run without features
ate() {
  local name=$1 bound=$2
  shift 2
  slam "$name" --tracking gicp --features none "$@"
  figure track "${name}_ate_cm" "$(value "$out/$name/metrics.json" ate rmse_cm)" at-most "$bound"
}
# from FOLDER: true where LANGGS_DATA_DIR has that sequence
from() {
  [[ -n ${LANGGS_DATA_DIR:-} && -d ${LANGGS_DATA_DIR:-}/$1 ]] || { skip track "LANGGS_DATA_DIR has no $1"; return 1; }
}
check_track() {
  if has track benchmarks/alignment_benchmark; then
    local start
    for start in near far; do
      figure track "alignment_${start}_ms_1" "$("$build/benchmarks/alignment_benchmark" --benchmark_format=csv \
        --benchmark_filter="^align/grid/$start/threads:1/" 2>/dev/null | awk -F, '/^"align/ { print $3 }')" at-most 4
    done
  fi
  if has track benchmarks/front_end && from tum_fr1_xyz; then
    "$build/benchmarks/front_end" --dataset tum --input "$LANGGS_DATA_DIR/tum_fr1_xyz" --threads 1 >"$out/front_end"
    local column
    for column in median:4:12 p99:8:25 max:10:60; do
      IFS=: read -r name field bound <<<"$column"
      figure track "front_end_ms_$name" "$(awk -v f="$field" '$1 == "whole" { print $f }' "$out/front_end")" at-most "$bound"
    done
  fi
  has track examples/langgs_slam || return 0
  ate synthetic 0.3 --dataset synthetic
  if from tum_fr1_xyz; then
    ate tum 1.1 --dataset tum --input "$LANGGS_DATA_DIR/tum_fr1_xyz"
    ate tum_stride3 1.5 --dataset tum --input "$LANGGS_DATA_DIR/tum_fr1_xyz" --stride 3
  fi
  if from icl_livingroom1; then
    ate icl 1.25 --dataset tum --input "$LANGGS_DATA_DIR/icl_livingroom1" --iterations 4
  fi
  if from replica_office0; then
    ate replica 0.3 --dataset replica --input "$LANGGS_DATA_DIR/replica_office0" --iterations 4
  fi
}
check_memory() {
  has memory examples/langgs_slam || return 0
  slam memory --dataset synthetic --keyframe-memory 64
  figure memory bytes_per_gaussian_512 "$(value "$out/memory/metrics.json" memory map_bytes_per_gaussian)" at-most 1400
  figure memory keyframe_bytes "$(python3 -c 'import json, sys
parts = json.load(open(sys.argv[1]))["memory"]["bytes_by_part"]
print(parts["keyframe_features"] + parts["keyframe_images"])' "$out/memory/metrics.json")" at-most $((64 << 20))
}
check_quality() {
  has quality examples/langgs_slam || return 0
  slam room --dataset synthetic --hold-out 8
  local room=$out/room/metrics.json
  figure quality synthetic_ate_cm "$(value "$room" ate rmse_cm)" at-most 1.0
  figure quality synthetic_psnr_db "$(value "$room" image keyframes psnr_db)" at-least 27
  figure quality synthetic_accuracy "$(value "$room" semantic accuracy)" at-least 0.92
  local data=${LANGGS_DATA_DIR:-}
  if [[ -d $data/replica_office0 ]]; then
    for optimizer in average adam; do
      slam "replica_$optimizer" --dataset replica --input "$data/replica_office0" --tracking given --features labels \
        --class-features "$data/text/replica_class_features.npy" --feature-stride 8 --iterations 4 \
        --feature-optimizer "$optimizer"
    done
    local average=$out/replica_average/metrics.json adam=$out/replica_adam/metrics.json
    figure quality replica_psnr_db "$(value "$average" image keyframes psnr_db)" at-least 28
    figure quality replica_accuracy "$(value "$average" semantic accuracy)" at-least \
      "$(awk -v a="$(value "$adam" semantic accuracy)" 'BEGIN { print a - 0.003 }')"
    figure quality replica_teacher_cosine "$(value "$average" semantic teacher_cosine)" at-least \
      "$(awk -v a="$(value "$adam" semantic teacher_cosine)" 'BEGIN { print a - 0.002 }')"
  else
    skip quality "LANGGS_DATA_DIR has no replica_office0"
  fi
  if [[ -d $data/tum_fr1_xyz ]]; then
    slam tum --dataset tum --input "$data/tum_fr1_xyz" --features texture --feature-dim 64
    figure quality tum_ate_cm "$(value "$out/tum/metrics.json" ate rmse_cm)" at-most 2.0
    figure quality tum_psnr_db "$(value "$out/tum/metrics.json" image keyframes psnr_db)" at-least 20
  else
    skip quality "LANGGS_DATA_DIR has no tum_fr1_xyz"
  fi
}

for name in "$@"; do
  case $name in
    track | memory | quality) command -v python3 >/dev/null || { skip "$name" "python3 reads metrics.json, and is not there"; continue; } ;;
  esac
  case $name in
    render | feature | track | memory | quality) "check_$name" ;;
    query) skip "$name" "there is no comparison of that name yet" ;;
    *) echo "check.sh: there is no comparison named '$name'" >&2; exit 2 ;;
  esac
done
exit "$short"
