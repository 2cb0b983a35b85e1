#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# Sources are formatted by clang-format 14; other versions break lines differently, so only that one is asked.
# Run from the repository root. With --fix, formats instead of checking.
set -eu
for tool in clang-format-14 clang-format ""; do
  if [ -z "$tool" ]; then
    echo "SKIPPED: clang-format 14 is not installed (package clang-format-14)"
    exit 77
  fi
  "$tool" --version 2>/dev/null | grep -q 'version 14\.' && break
done
mode='--dry-run --Werror'
[ "${1:-}" = --fix ] && mode=-i
if git rev-parse --is-inside-work-tree >/dev/null 2>&1; then
  git ls-files '*.hpp' '*.cpp' '*.cu' '*.cuh' '*.inc'
else
  find include tests examples benchmarks \( -name '*.hpp' -o -name '*.cpp' -o -name '*.cu' -o -name '*.cuh' -o -name '*.inc' \)
fi | while read -r file; do [ -f "$file" ] && echo "$file"; done | xargs "$tool" $mode
echo "format: ok"
