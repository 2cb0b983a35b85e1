#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Installs what is missing on Debian 12, Ubuntu 22.04 or 24.04. Installs nothing when everything is there.
# Usage: setup_machine.sh [--tests]   (--tests: also the optional tools of the full test suite)
# Exit code 2 when something needed is missing and cannot be installed.
set -euo pipefail

needed=(g++ cmake ninja-build libeigen3-dev libnanoflann-dev libthrust-dev doctest-dev libcli11-dev
        nlohmann-json3-dev libopencv-core-dev libopencv-imgproc-dev libopencv-imgcodecs-dev)
# Compiling and linking with sanitizers needs only g++; clang is the second compiler, clang-format 14 defines our format.
optional=()
[[ ${1:-} == --tests ]] && optional=(clang clang-format-14 libbenchmark-dev)

if ! command -v dpkg-query >/dev/null; then
  echo "This is neither Debian nor Ubuntu: nothing was installed. The Debian names of what is needed:" >&2
  echo "  ${needed[*]} ${optional[*]}" >&2
  exit 0  # it may be there under other names; CMake will tell
fi

missing() {
  local package
  for package in "$@"; do
    dpkg-query -W -f='${Status}' "$package" 2>/dev/null | grep -q 'ok installed' || echo "$package"
  done
}
# A compiler or CMake that did not come from a package is as good.
satisfied_otherwise() {
  case $1 in
    g++ | cmake | clang | clang-format-14) command -v "$1" ;;
    ninja-build) command -v ninja ;;
    *) false ;;
  esac >/dev/null 2>&1
}
to_install() {
  local package
  for package in $(missing "$@"); do satisfied_otherwise "$package" || echo "$package"; done
}

mapfile -t want < <(to_install "${needed[@]}")
mapfile -t wish < <((( ${#optional[@]} )) && to_install "${optional[@]}" || true)
(( ${#want[@]} + ${#wish[@]} == 0 )) && exit 0

as_root=()
if (( EUID != 0 )); then
  if command -v sudo >/dev/null; then as_root=(sudo); else as_root=(false); fi
fi
apt=("${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get)
if ! command -v apt-get >/dev/null || [[ ${as_root[*]} == false ]]; then
  if (( ${#want[@]} )); then
    echo "These packages are needed and cannot be installed from here (no apt-get, root or sudo): ${want[*]}" >&2
    echo "Install them and run this again: apt-get install ${want[*]}" >&2
    exit 2
  fi
  echo "Not installed, parts of the test suite will be skipped: ${wish[*]}" >&2
  exit 0
fi

echo "Installing Debian packages: ${want[*]} ${wish[*]}"
"${apt[@]}" update -qq || echo "apt-get update failed; trying with the package lists that are there" >&2
if (( ${#want[@]} )) && ! "${apt[@]}" install -y -qq --no-install-recommends "${want[@]}"; then
  echo "Could not install: ${want[*]}. Install them by hand and run this again." >&2
  exit 2
fi
for package in "${wish[@]}"; do
  "${apt[@]}" install -y -qq --no-install-recommends "$package" ||
    echo "Could not install $package; the part of the test suite that needs it will be skipped" >&2
done
