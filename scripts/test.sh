#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Sets up what is missing and runs all tests: format, layers, unit and
# command-line tests with warnings as errors, the report in a browser, the
# packages, the documentation's commands, and once more under AddressSanitizer and
# UBSan the tests of core, sensors and partition. Lists at the end what was tested in
# which half hour, and the slowest tests.
#
#   scripts/test.sh [--no-sanitizers]
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

jobs=$(nproc)
build=${ADASFM_BUILD_DIR:-build}
steps=$(mktemp)
logs=()

# Runs at the exit, also after a failed test.
report() {
  if [ ${#logs[@]} != 0 ]; then
    printf '\n== What was tested when\n'
    python3 scripts/checks/test_times.py "$steps" "${logs[@]}" || true
  fi
  rm -f "$steps"
}
trap report EXIT

step() {
  printf '\n== %s\n' "$1"
  printf '%s\t%s\n' "$(date +%s)" "$1" >> "$steps"
}

# run_tests BUILD_DIR [CTEST OPTIONS...]
run_tests() {
  logs+=("$1/Testing/Temporary/LastTest.log")
  ctest --test-dir "$1" --output-on-failure --parallel "$jobs" "${@:2}"
}

step 'Setting up and building'
scripts/setup.sh --for-tests
step 'Checking format and layers'
scripts/checks/check_format.sh
scripts/checks/check_layers.sh
scripts/checks/check_host_part.sh

step 'Running all tests'
run_tests "$build"

if [ "${1:-}" != --no-sanitizers ]; then
  # sensors parses users' files; the chain covers the other layers
  # (scripts/checks/sanitized_chain.sh).
  layers=(core sensors partition)
  step 'Building with sanitizers (about 8 minutes the first time)'
  scripts/checks/sanitized_chain.sh build address build-sanitize \
    "${layers[@]/#/test_}"
  step 'Running unit tests under AddressSanitizer and UBSan'
  # Excluded are statistical tests of long drives and many seeds: with sanitizers
  # they take ten times as long, and shorter tests run the same code.
  statistics='JitterOfTheImages|OnAStraightRoad|ShiftsAreExact|Honesty'
  statistics+='|RealRoad|IsNotFoundWhereThereIsNone|OverTwentySeeds|ALongDrive'
  statistics+='|AreNamed/(SwappedAxes|OneSecond)|HoursAtRest|TheFirstSteps'
  run_tests build-sanitize --exclude-regex "$statistics" \
    --label-regex "^($(IFS='|'; echo "${layers[*]}"))$"
fi
