#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Makes every comparison table of README.md and docs from scratch, except those of
# matching.md (experiments of earlier builds): sets up, builds, runs what is not
# done yet with this version on this machine, and writes the tables into the pages.
# After an interruption the script continues. Tables whose recordings or other
# COLMAP are missing are left out with one line.
#
#   scripts/benchmark/all.sh --quick    README's table and COLMAP 4 beside it: 20 to
#                                       45 minutes on two idle cores
#   scripts/benchmark/all.sh            everything: several hours
#   scripts/benchmark/all.sh -h         all options
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
case " $* " in
  *' -h '* | *' --help '* | *' --draw '*) ;;
  *) scripts/setup.sh ;;
esac
exec /usr/bin/python3 scripts/benchmark/all.py "$@"
