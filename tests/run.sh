#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Builds and runs everything that says whether langgs is correct; ends with "N passed, N failed, N skipped".
# Usage: bash tests/run.sh [--quick]    (--quick: g++ only, no second compiler and no sanitizers)
#   LANGGS_DATA_DIR   folder with real sequences; without it the tests that need them are skipped
#   LANGGS_JOBS       parallel jobs (default: all processors)
#   LANGGS_CUDA_LAUNCHER   command that runs CUDA programs; default: the GPU if there is one
set -uo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

quick=0
case ${1:-} in
  "") ;;
  --quick) quick=1 ;;
  *) echo "tests/run.sh: unknown option '$1'; the only one is --quick" >&2; exit 2 ;;
esac
jobs=${LANGGS_JOBS:-$(nproc)}
passed=0 failed=0 skipped=0

bash cmake/setup_machine.sh --tests || exit $?
generator=() keep_going=(-k)
if command -v ninja >/dev/null; then generator=(-G Ninja) keep_going=(-k 0); fi

say() { printf '\n=== %s (%d s)\n' "$*" "$SECONDS"; }
fail() { echo "FAILED: $*"; failed=$((failed + 1)); }
skip() { echo "SKIPPED: $*"; skipped=$((skipped + 1)); }

# build <name> <targets> <cmake options...>: configures and builds build/<name>, as much of it as compiles; a failure
# counts as one failed test. Returns 1 only when there is nothing to test.
build() {
  local name=$1 targets=$2
  shift 2
  say "$name: build"
  if ! cmake -S . -B "build/$name" "${generator[@]}" "$@" >"build/$name.log" 2>&1; then
    tail -n 40 "build/$name.log"
    fail "$name cannot be configured (whole log: build/$name.log)"
    return 1
  fi
  # shellcheck disable=SC2086
  if ! cmake --build "build/$name" --parallel "$jobs" --target $targets -- "${keep_going[@]}" >>"build/$name.log" 2>&1; then
    grep -E -A 5 '(error|FAILED|undefined reference)' "build/$name.log" | cut -c 1-300 | head -n 100
    fail "$name does not build (whole log: build/$name.log)"
  fi
  return 0
}

# run_ctest <name> <ctest options...>: runs the tests of build/<name> and adds up their results.
run_ctest() {
  local name=$1 report status counts
  shift
  say "$name: test"
  report=$PWD/build/$name.junit.xml
  rm -f "$report"
  "${launcher[@]}" ctest --test-dir "build/$name" --output-on-failure --parallel "$jobs" --output-junit "$report" "$@"
  status=$?
  # The first <testsuite> tag carries the sums; its attributes may be on lines of their own.
  counts=$(tr '\n\t' '  ' <"$report" 2>/dev/null | grep -o '<testsuite [^>]*>' | head -n 1)
  attribute() { sed -n "s/.* $1=\"\([0-9]*\)\".*/\1/p" <<<"$counts"; }
  local total failures omitted
  total=$(attribute tests) failures=$(attribute failures)
  omitted=$(($(attribute skipped) + $(attribute disabled)))
  if [[ -z $total || -z $failures ]]; then
    fail "$name: ctest left no report"
    return
  fi
  # CTest's report calls a test without an executable skipped; here it is a test that could not be built.
  local unbuilt
  unbuilt=$(grep -c '<skipped message="\(Unable to find\|Could not find\)' "$report")
  omitted=$((omitted - unbuilt)) failures=$((failures + unbuilt))
  passed=$((passed + total - failures - omitted)) failed=$((failed + failures)) skipped=$((skipped + omitted))
  if ((status != 0 && failures == 0)); then fail "$name: ctest ended with exit code $status"; fi
  if ((total == 0)); then fail "$name: no test was run"; fi
}
launcher=()

# clang++ takes half of g++'s time to see that every header compiles alone: leave that to it where there is one.
headers_elsewhere=()
if ((!quick)) && command -v clang++ >/dev/null; then headers_elsewhere=(-LE headers); fi

# A folder's tests become one translation unit, for most of the time goes into instantiating the same templates again.
# Not with --quick: there each file compiles on its own, and after a change only what it touches.
unity=(-DCMAKE_UNITY_BUILD=ON -DCMAKE_UNITY_BUILD_BATCH_SIZE=0)
if ((quick)); then unity=(-DCMAKE_UNITY_BUILD=OFF); fi

# Our programs are built for this machine; the tests of the kernels also for those with less.
architectures=()
if ((!quick)) && grep -qw avx2 /proc/cpuinfo && grep -qw fma /proc/cpuinfo; then
  architectures=("-DLANGGS_TEST_ARCHITECTURES=x86-64-v3;x86-64")
fi

mkdir -p build
if build release all "${unity[@]}" "${architectures[@]}" -DCMAKE_BUILD_TYPE=Release -DCMAKE_CXX_COMPILER="${CXX:-g++}"; then
  run_ctest release "${headers_elsewhere[@]}"
fi

# The test executables that a build tree knows, as targets: test_core test_map ...
host_targets() { ls tests | while read -r d; do compgen -G "tests/$d/*_test.cpp" >/dev/null && [[ $d != examples && $d != cuda && $d != fuzz ]] && echo "test_$d"; done; }
common=("${unity[@]}" -DLANGGS_BUILD_EXAMPLES=OFF -DLANGGS_BUILD_BENCHMARKS=OFF -DLANGGS_INSTALL=OFF)
sanitizer=("${common[@]}" -DCMAKE_BUILD_TYPE=None "-DCMAKE_CXX_FLAGS=-O1 -g1" -DLANGGS_WARNINGS_AS_ERRORS=OFF
           -DCMAKE_CXX_COMPILER=g++)

if ((!quick)); then
  targets=$(host_targets | tr '\n' ' ')
  if ! command -v clang++ >/dev/null; then
    skip "clang: clang++ is not installed"
  elif build clang "$targets" "${common[@]}" -DCMAKE_BUILD_TYPE=Release -DCMAKE_CXX_COMPILER=clang++; then
    run_ctest clang -L 'host|headers'
  fi

  export ASAN_OPTIONS=detect_leaks=1:strict_string_checks=1 UBSAN_OPTIONS=print_stacktrace=1
  export TSAN_OPTIONS=halt_on_error=1:second_deadlock_stack=1
  if build asan "$targets" "${sanitizer[@]}" -DLANGGS_SANITIZE=address; then run_ctest asan -L host; fi

  # Threads start in the worker pool and in slam/; the rest reaches them through the pool.
  threaded=()
  for folder in core host slam; do
    if compgen -G "tests/$folder/*_test.cpp" >/dev/null; then threaded+=("$folder"); fi
  done
  # g++ 12's ThreadSanitizer does not know the memory layouts of newer kernels' address randomisation.
  if setarch "$(uname -m)" -R true 2>/dev/null; then launcher=(setarch "$(uname -m)" -R); fi
  if build tsan "${threaded[*]/#/test_}" "${sanitizer[@]}" -DLANGGS_SANITIZE=thread; then
    run_ctest tsan -R "^($(IFS='|'; echo "${threaded[*]}"))\$"
  fi
  launcher=()
fi

if ((!quick)) && [[ -n ${LANGGS_CUDA_LAUNCHER:-} || -e /dev/nvidia0 ]] && compgen -G "tests/cuda/*_test.cu" >/dev/null; then
  # What takes time is the kernels, and of langgs_slam the templates: -O1 is enough for the host.
  if build cuda "test_cuda langgs_slam" "${unity[@]}" -DLANGGS_BUILD_BENCHMARKS=OFF -DLANGGS_INSTALL=OFF \
      -DCMAKE_BUILD_TYPE=None -DCMAKE_CXX_FLAGS=-O1 -DCMAKE_CUDA_FLAGS=-O1 -DLANGGS_ENABLE_CUDA=ON \
      -DLANGGS_EXAMPLE_PIPELINES=d16 -DLANGGS_CUDA_LAUNCHER="${LANGGS_CUDA_LAUNCHER:-}"; then
    run_ctest cuda -R '^cuda\.(run|slam|program)'
  fi
fi

say "done"
printf '%d passed, %d failed, %d skipped\n' "$passed" "$failed" "$skipped"
((failed == 0))
