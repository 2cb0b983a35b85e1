#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# Every source and script names its licence in its first line, or in the second after #!. Run from the repository root.
set -eu
if git rev-parse --is-inside-work-tree >/dev/null 2>&1; then
  files=$(git ls-files --cached)
else
  files=$(find . \( -name build -o -name out -o -name .git \) -prune -o -type f -print)
fi
bad=0
for file in $files; do
  case "$file" in
    *.hpp | *.cpp | *.cu | *.cuh | *.h | *.inc | *.cmake | *.cmake.in | *.sh | *.py | *.cff | */CMakeLists.txt | CMakeLists.txt) ;;
    .ci/* | */.ci/* | *.clang-tidy) ;;
    *) continue ;;
  esac
  [ -f "$file" ] || continue
  if ! head -n 2 "$file" | grep -q 'SPDX-License-Identifier: Apache-2.0'; then
    echo "$file: the first line must be 'SPDX-License-Identifier: Apache-2.0' in a comment"
    bad=1
  fi
done
[ "$bad" = 0 ] && echo "SPDX lines: ok"
exit "$bad"
