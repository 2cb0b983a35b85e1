#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# Runs langgs_slam on the beginnings of real sequences. Usage: real_data.sh PROGRAM WORK_FOLDER
# LANGGS_DATA_DIR: folder with tum_fr1_xyz, icl_livingroom1 and replica_office0; skipped (exit code 77) without it.
set -eu
program=$1 work=$2 data=${LANGGS_DATA_DIR:-}
if [ -z "$data" ]; then
  echo "SKIPPED: LANGGS_DATA_DIR is not set; no real sequence was run"
  exit 77
fi
mkdir -p "$work"

# value <folder> <key>: the first number behind that key
value() { sed -n "s/^ *\"$2\": \([-0-9.e+]*\),\{0,1\}$/\1/p" "$work/$1/metrics.json" | head -n 1; }
check() { # folder, key, operator, bound
  v=$(value "$1" "$2")
  if [ -z "$v" ] || ! awk "BEGIN { exit !($v $3 $4) }"; then
    echo "$1: $2 is '$v', expected $3 $4"
    exit 1
  fi
  echo "$1: $2 $v $3 $4"
}
run() { # folder, data set, options...
  name=$1 input=$2
  shift 2
  if [ ! -d "$data/$input" ]; then
    echo "SKIPPED: $data/$input is not there"
    return 1
  fi
  rm -rf "${work:?}/$name"
  "$program" --input "$data/$input" --output "$work/$name" --no-pictures --threads 2 "$@" >"$work/$name.log" 2>&1 ||
    { tail -n 3 "$work/$name.log"; exit 1; }
}

if run tum tum_fr1_xyz --dataset tum --features texture --feature-dim 64 --max-frames 60 --iterations 3; then
  check tum lost_frames == 0
  check tum rmse_cm "<=" 2.0
  check tum psnr_db ">=" 17
fi
if run icl icl_livingroom1 --dataset tum --max-frames 40 --iterations 3; then
  check icl lost_frames == 0
  check icl rmse_cm "<=" 0.6
  check icl psnr_db ">=" 26
fi
if run replica replica_office0 --dataset replica --tracking given --features labels --feature-stride 8 \
  --class-features "$data/text/replica_class_features.npy" --max-frames 8 --iterations 8; then
  check replica psnr_db ">=" 28
  check replica accuracy ">=" 0.85
fi
