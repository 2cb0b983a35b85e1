#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# Runs langgs_slam --device cuda on a small built-in room, and compares what it leaves with that of --device host.
# Exponentials differ in their last bits, and a run carries that on: the two end up near each other, not equal.
# Usage: cuda_program.sh PROGRAM WORK_FOLDER [LAUNCHER...]
set -eu
program=$1 work=$2
shift 2
rm -rf "$work" && mkdir -p "$work"
for device in host cuda; do
  "$@" "$program" --device $device --output "$work/$device" --width 80 --height 60 --frames 40 --max-frames 12 \
    --feature-dim 16 --iterations 2 --no-pictures >"$work/$device.log" 2>&1 ||
    { echo "--device $device failed:"; tail -n 5 "$work/$device.log"; exit 1; }
  for file in trajectory.txt keyframes.txt metrics.json map.ply map.safetensors; do
    [ -s "$work/$device/$file" ] || { echo "$device/$file is missing"; exit 1; }
  done
done

awk '
  function distance(d) { return d < 0 ? -d : d }
  FNR == NR { for (i = 1; i <= 8; ++i) host[FNR, i] = $i; frames = FNR; next }
  {
    moved = sqrt(($2 - host[FNR, 2]) ^ 2 + ($3 - host[FNR, 3]) ^ 2 + ($4 - host[FNR, 4]) ^ 2)
    if (moved > farthest) farthest = moved
    for (i = 5; i <= 8; ++i) if (distance($i - host[FNR, i]) > turned) turned = distance($i - host[FNR, i])
    if ($1 != host[FNR, 1]) { print "time stamps differ"; bad = 1 }
  }
  END {
    printf "%d frames, farthest %.2g m, largest difference of a quaternion %.2g\n", FNR, farthest, turned
    exit bad || FNR != 12 || frames != 12 || farthest > 1e-3 || turned > 1e-3
  }' "$work/host/trajectory.txt" "$work/cuda/trajectory.txt" || { echo "FAILED: trajectories differ"; exit 1; }

# The first number behind a key of metrics.json.
metric() { sed -n "s/.*\"$2\": *\(-\{0,1\}[0-9][0-9.e+-]*\).*/\1/p" "$work/$1/metrics.json" | head -n 1; }
same() { # key, largest difference, relative
  awk -v key="$1" -v a="$(metric host "$1")" -v b="$(metric cuda "$1")" -v most="$2" 'BEGIN {
    d = a > b ? a - b : b - a
    printf "%s: host %s, cuda %s\n", key, a, b
    exit a == "" || b == "" || d > most * (a < 0 ? -a : a) }' || { echo "FAILED: $1 differs"; exit 1; }
}
same frames 0
same keyframes 0
same geometry 0
same feature 0
same gaussians 0.02
same psnr_db 0.01
same accuracy 0.02
