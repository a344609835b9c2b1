#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# The whole chain on a cluster with Slurm, or on one machine without it
# (docs/guide/cluster.md):
#
#   adasfm_slurm.sh submit WORKSPACE [options]   queues all remaining tasks
#   adasfm_slurm.sh status WORKSPACE             one table of progress
#   adasfm_slurm.sh cancel WORKSPACE             cancels the jobs
#   adasfm_slurm.sh local  WORKSPACE [options]   the same tasks without Slurm
#
# `adasfm_slurm.sh submit -h` lists the options. Environment: COLMAP, the
# executable (default: colmap of the PATH).
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
command -v python3 > /dev/null || { echo 'ERROR: python3 is missing' >&2; exit 1; }
PYTHONPATH=$here${PYTHONPATH:+:$PYTHONPATH} PYTHONDONTWRITEBYTECODE=1 \
  exec python3 -m chain "$@"
