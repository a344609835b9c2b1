#!/bin/bash
# SPDX-License-Identifier: BSD-3-Clause
# Benchmarks AdaSfM beside COLMAP's mappers: benchmark.sh [quick|full] [options
# of scripts/benchmark/benchmark.py]. quick makes worlds of up to 1,000 images, full of up
# to 10,000, which takes hours. Tables and plots end up in adasfm-benchmark/.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."

sets=quick
if [[ ${1:-} == quick || ${1:-} == full ]]; then
  sets=$1
  shift
fi
scripts/setup.sh
exec /usr/bin/python3 scripts/benchmark/benchmark.py "$sets" "$@"
