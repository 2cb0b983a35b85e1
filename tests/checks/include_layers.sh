#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# An include may only point down the layers of docs/design.md, and no two folders may include each other.
# Run from the repository root.
set -eu
find include/langgs \( -name '*.hpp' -o -name '*.cuh' \) | sort | xargs grep -n '^ *# *include "' | awk '
BEGIN {
  n = split("core:0 device:1 host:1 cuda:1 frame:2 map:2 eval:2 track:3 render:3 io:3 optimize:4 manage:4 query:4 slam:5", rows, " ")
  for (i = 1; i <= n; ++i) { split(rows[i], cell, ":"); layer[cell[1]] = cell[2] }
  layer["version.hpp"] = 0; layer["langgs.hpp"] = 6
}
{
  place = $0; sub(/:[^:]*#.*/, "", place)          # file:line
  from = place; sub(/^include\/langgs\//, "", from); sub(/[\/:].*/, "", from)
  to = $0; sub(/^[^"]*"/, "", to); sub(/".*/, "", to)
  file = "include/" to
  if (to !~ /^langgs\//) { fail(place ": \"" to "\": write the path from langgs/ on"); next }
  sub(/^langgs\//, "", to); sub(/\/.*/, "", to)
  if (!(from in layer)) { fail(place ": folder " from " has no layer; add it here and in docs/design.md"); next }
  if (!(to in layer)) { fail(place ": folder " to " has no layer; add it here and in docs/design.md"); next }
  if ((getline line < file) < 0) fail(place ": " file " does not exist"); else close(file)
  if (layer[to] > layer[from]) fail(place ": " from "/ (layer " layer[from] ") includes " to "/ (layer " layer[to] ")")
  # device/ and its host/ and cuda/ twins are one thing in three folders.
  if (from != to && layer[from] != 1) {
    seen[from, to] = place
    if ((to, from) in seen) fail(place ": " from "/ and " to "/ include each other, see " seen[to, from])
  }
}
function fail(text) { print text; bad = 1 }
END { if (NR == 0) fail("no includes were found: run from the repository root"); exit bad }'
echo "include layers: ok"
