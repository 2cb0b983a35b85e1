#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# Runs langgs_slam as a user would, on a small built-in room: the same bytes for any number of threads, all output files,
# and a clear end for wrong options. Usage: end_to_end.sh PROGRAM WORK_FOLDER
set -eu
program=$1 work=$2
rm -rf "$work" && mkdir -p "$work"

run() { # folder, options...
  folder=$1
  shift
  "$program" --output "$work/$folder" --width 160 --height 120 --frames 60 --max-frames 24 --feature-dim 16 "$@" >"$work/$folder.log" 2>&1 || { tail -n 5 "$work/$folder.log"; exit 1; }
}
lockstep="--iterations 4 --hold-out 8"
# shellcheck disable=SC2086
run one --threads 1 $lockstep
# shellcheck disable=SC2086
run two --threads 2 $lockstep
# shellcheck disable=SC2086
run again --threads 2 $lockstep
for file in map.safetensors trajectory.txt map.ply keyframes.txt; do
  cmp "$work/one/$file" "$work/two/$file"
  cmp "$work/two/$file" "$work/again/$file"
done
echo "the same bytes for 1 and 2 threads and repeated runs"
run realtime --mode realtime

for file in trajectory.txt keyframes.txt metrics.json map.ply map.safetensors renders/overview.png; do
  for folder in one realtime; do [ -s "$work/$folder/$file" ] || { echo "$folder/$file is missing"; exit 1; }; done
done
for key in frames keyframes gaussians iterations ate image semantic timing memory config version; do
  grep -q "\"$key\":" "$work/one/metrics.json" || { echo "metrics.json lacks $key"; exit 1; }
done
[ "$(wc -l <"$work/one/trajectory.txt")" -eq 24 ] || { echo "trajectory.txt does not hold every frame"; exit 1; }

refused() { # a wrong command line: exit code 2 and one line
  code=0
  "$program" --output "$work/refused" "$@" >"$work/refused.out" 2>"$work/refused.err" || code=$?
  if [ $code -ne 2 ] || [ "$(wc -l <"$work/refused.err")" -ne 1 ]; then
    echo "'$*' ended with code $code and:"
    cat "$work/refused.err"
    exit 1
  fi
}
refused --dataset tum --input "$work/nowhere"
refused --dataset tum
refused --dataset mars
refused --iterations -1
refused --iterations many
refused --feature-dim 17
if "$program" --help | grep -q "made without CUDA"; then refused --device cuda; fi
refused --no-such-option
refused --features npy:"$work/nowhere"
echo "wrong options end with code 2 and one line"
