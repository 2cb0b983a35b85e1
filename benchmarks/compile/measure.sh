#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# What a translation unit pays for LangGsSlam: seconds of compile time (user) and kB of object code, for the smallest
# instantiation alone and for one further FeatDim or K beside it. The least of the rounds counts.
# Usage: measure.sh [ROUNDS]   environment: CXX (g++), CXXFLAGS (-O2), EIGEN (/usr/include/eigen3)
set -euo pipefail
cxx=${CXX:-g++} flags=${CXXFLAGS:--O2} eigen=${EIGEN:-/usr/include/eigen3} rounds=${1:-1}
include=$(cd "$(dirname "$0")/../../include" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# compile NAME [ARGUMENTS]...: sets seconds and kb for a source that instantiates LangGsSlam<ARGUMENTS> for each
compile() {
  local name=$1 arguments round took TIMEFORMAT=%U
  shift
  echo '#include "langgs/slam/slam.hpp"' >"$work/$name.cpp"
  for arguments in "$@"; do echo "template class langgs::LangGsSlam<$arguments>;" >>"$work/$name.cpp"; done
  seconds=
  for (( round = 0; round < rounds; ++round )); do
    # shellcheck disable=SC2086  # flags are words
    took=$( { time "$cxx" -std=c++20 $flags -I"$include" -isystem "$eigen" -c "$work/$name.cpp" -o "$work/$name.o" \
              2>"$work/errors"; } 2>&1 ) || { cat "$work/errors" >&2; exit 1; }
    seconds=$(awk -v a="$took" -v b="${seconds:-$took}" 'BEGIN { print a < b ? a : b }')
  done
  kb=$(( $(stat -c %s "$work/$name.o") / 1000 ))
}

echo "$("$cxx" --version | head -1), -std=c++20 $flags"
printf '%-26s %9s %9s %9s %9s\n' 'LangGsSlam<FeatDim, K>' 'user s' 'more s' 'kB' 'more kB'
compile header
printf '%-26s %9.1f %9s %9d %9s\n' 'none, the header alone' "$seconds" '' "$kb" ''
compile baseline '16, 3'
base_seconds=$seconds base_kb=$kb
printf '%-26s %9.1f %9s %9d %9s\n' '<16, 3>' "$seconds" '' "$kb" ''
for further in '64, 3' '512, 3' '768, 3' '1152, 3' '16, 1' '16, 5' '16, 10'; do
  compile further '16, 3' "$further"
  more=$(awk -v a="$seconds" -v b="$base_seconds" 'BEGIN { print a - b }')
  printf '%-26s %9.1f %9.1f %9d %9d\n' "<16, 3> and <$further>" "$seconds" "$more" "$kb" "$(( kb - base_kb ))"
done
