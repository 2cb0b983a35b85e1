#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# What a translation unit pays for LangGsSlam: seconds of compile time (user) and kB of object code, for the smallest
# instantiation alone and for one further FeatDim or K beside it. Rounds visit all sources in turns, so that all see the
# same machine, and the least time counts.
# Usage: measure.sh [ROUNDS]   environment: CXX (g++), CXXFLAGS (-O2), EIGEN (/usr/include/eigen3)
set -euo pipefail
cxx=${CXX:-g++} flags=${CXXFLAGS:--O2} eigen=${EIGEN:-/usr/include/eigen3} rounds=${1:-2}
include=$(cd "$(dirname "$0")/../../include" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

further=('64, 3' '512, 3' '768, 3' '1152, 3' '16, 1' '16, 5' '16, 10')
# Source 0 is the header alone, source 1 the baseline, the others have one further instantiation each.
for (( i = 0; i < 2 + ${#further[@]}; ++i )); do
  {
    echo '#include "langgs/slam/slam.hpp"'
    (( i < 1 )) || echo 'template class langgs::LangGsSlam<16, 3>;'
    (( i < 2 )) || echo "template class langgs::LangGsSlam<${further[i - 2]}>;"
  } >"$work/$i.cpp"
done

TIMEFORMAT=%U
for (( round = 0; round < rounds; ++round )); do
  for (( i = 0; i < 2 + ${#further[@]}; ++i )); do
    # shellcheck disable=SC2086  # flags are words
    took=$( { time "$cxx" -std=c++20 $flags -I"$include" -isystem "$eigen" -c "$work/$i.cpp" -o "$work/$i.o" \
              2>"$work/errors"; } 2>&1 ) || { cat "$work/errors" >&2; exit 1; }
    seconds[i]=$(awk -v a="$took" -v b="${seconds[i]:-$took}" 'BEGIN { print a < b ? a : b }')
    kb[i]=$(( $(stat -c %s "$work/$i.o") / 1000 ))
  done
done

echo "$("$cxx" --version | head -1), -std=c++20 $flags"
printf '%-26s %9s %9s %9s %9s\n' 'LangGsSlam<FeatDim, K>' 'user s' 'more s' 'kB' 'more kB'
printf '%-26s %9.1f %9s %9d\n' 'none, the header alone' "${seconds[0]}" '' "${kb[0]}"
printf '%-26s %9.1f %9s %9d\n' '<16, 3>' "${seconds[1]}" '' "${kb[1]}"
for (( i = 2; i < 2 + ${#further[@]}; ++i )); do
  more=$(awk -v a="${seconds[i]}" -v b="${seconds[1]}" 'BEGIN { print a - b }')
  printf '%-26s %9.1f %9.1f %9d %9d\n' "<16, 3> and <${further[i - 2]}>" "${seconds[i]}" "$more" "${kb[i]}" \
         "$(( kb[i] - kb[1] ))"
done
