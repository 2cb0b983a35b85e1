#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# Installs the tree and builds tests/downstream against it, then builds it once more with add_subdirectory.
# Usage: downstream.sh <cmake> <build directory> <generator> <C++ compiler>, from the repository root.
set -eu
cmake=$1 build=$2 generator=$3 compiler=$4
work=$build/downstream
rm -rf "$work"
"$cmake" --install "$build" --prefix "$work/prefix" >/dev/null

consume() {  # name, options
  name=$1
  shift
  "$cmake" -S tests/downstream -B "$work/$name" -G "$generator" -DCMAKE_CXX_COMPILER="$compiler" \
    -DCMAKE_BUILD_TYPE=Release "$@"
  "$cmake" --build "$work/$name"
  "$work/$name/consumer"
}
consume installed -DCMAKE_PREFIX_PATH="$work/prefix"
consume subdirectory -DLANGGS_SOURCE_DIR="$PWD"

# Nothing of our own build may reach a user's compile lines.
for name in installed subdirectory; do
  if grep -E -- '-march=|-ffast-math|-fsanitize|-Werror' "$work/$name/compile_commands.json"; then
    echo "a consumer's compile line carries flags of ours ($name)"
    exit 1
  fi
done
