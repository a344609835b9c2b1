#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Kills commands, damages their files and takes their disk away:
#   faults.sh COLMAP [--seconds 45] [--seed 1]
# See faults.py beside this file.
set -euo pipefail
exec python3 "$(dirname "${BASH_SOURCE[0]}")/faults.py" "$@"
