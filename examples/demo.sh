#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Installs what is missing, builds langgs_slam, maps the built-in room and says which pictures to look at.
# Usage: bash examples/demo.sh [options of langgs_slam]
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
out=out/demo

bash cmake/setup_machine.sh
generator=()
command -v ninja >/dev/null && generator=(-G Ninja)
mkdir -p build
echo "Building langgs_slam (a few minutes)"
if ! { cmake -S . -B build/demo "${generator[@]}" -DCMAKE_BUILD_TYPE=Release -DLANGGS_BUILD_TESTS=OFF \
         -DLANGGS_BUILD_BENCHMARKS=OFF -DLANGGS_WARNINGS_AS_ERRORS=OFF &&
       cmake --build build/demo --parallel "${LANGGS_JOBS:-$(nproc)}" --target langgs_slam; } >build/demo.log 2>&1; then
  tail -n 40 build/demo.log
  echo "The build failed; the whole log is build/demo.log" >&2
  exit 1
fi

program=$(find build/demo/examples -name langgs_slam -type f | head -n 1)
"$program" --dataset synthetic --output "$out" "$@"

echo
echo "Look at:"
shopt -s nullglob
pictures=("$out"/renders/*.png)
if ((${#pictures[@]} == 0)); then
  echo "no pictures were written under $out/renders" >&2
  exit 1
fi
printf '  %s\n' "${pictures[@]:0:12}"
((${#pictures[@]} > 12)) && echo "  ... and $((${#pictures[@]} - 12)) more in $out/renders"
[[ -f $out/report.html ]] && echo "  $out/report.html (numbers, plots and pictures on one page)"
[[ -f $out/map.ply ]] && echo "  $out/map.ply (opens in any Gaussian splat viewer)"
exit 0
