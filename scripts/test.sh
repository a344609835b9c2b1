#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Sets up what is missing and runs all tests: format, layers, unit and
# command-line tests with warnings as errors, the report in a browser, the
# packages, the documentation's commands, and the pure layers' tests once more
# under AddressSanitizer and UBSan.
#
#   scripts/test.sh [--no-sanitizers]
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

jobs=$(nproc)
scripts/setup.sh --for-tests
printf '\n== Checking format and layers\n'
scripts/checks/check_format.sh
scripts/checks/check_layers.sh
scripts/checks/check_host_part.sh

if [ "${1:-}" != --no-sanitizers ]; then
  printf '\n== Building the pure layers with sanitizers (about 4 minutes the first time)\n'
  cmake -S . -B build-sanitize -G Ninja -DCMAKE_BUILD_TYPE=RelWithDebInfo \
    -DADASFM_WITH_COLMAP=OFF -DADASFM_BUILD_BENCHMARKS=OFF \
    -DADASFM_SANITIZE=ON -DADASFM_WERROR=ON > /dev/null
  cmake --build build-sanitize --parallel "$jobs"
  printf '\n== Running the unit tests under AddressSanitizer and UBSan\n'
  ctest --test-dir build-sanitize --output-on-failure --parallel "$jobs"
fi

printf '\n== Running all tests\n'
ctest --test-dir "${ADASFM_BUILD_DIR:-build}" --output-on-failure \
  --parallel "$jobs"
