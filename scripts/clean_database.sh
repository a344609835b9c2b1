#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Cleans the matches of a COLMAP database of any version, for COLMAP's own
# mappers: a copy of the database gets the sensors' priors, and adasfm_global
# rewrites the copy's pairs, their matches and relative poses. The database itself
# stays as it is (docs/guide/cleaner.md).
#
#   scripts/clean_database.sh DATABASE CLEANED [SENSORS]
#
#   DATABASE   matched and verified, by any COLMAP from 3.6 on
#   CLEANED    the copy to make; CLEANED.coarse becomes the coarse model, and
#              CLEANED.options the options that COLMAP's mapper needs, if any
#   SENSORS    folder with imu.csv, wheel.csv, times.csv and sensors.yaml;
#              leave it out when there are none
#
# Environment: COLMAP, our executable (default: colmap of the PATH).
set -euo pipefail
if [ $# -lt 2 ]; then sed -n '3,17s/^# \{0,1\}//p' "$0" >&2; exit 1; fi
colmap=${COLMAP:-colmap}
database=$1 cleaned=$2 sensors=${3:-}
if [ -e "$cleaned" ]; then echo "$cleaned is there already" >&2; exit 1; fi

# The copy includes the contents of the write-ahead log.
python3 - "$database" "$cleaned" <<'COPY'
import pathlib, sqlite3, sys
source = sqlite3.connect(pathlib.Path(sys.argv[1]).absolute().as_uri() +
                         '?mode=ro', uri=True)
with sqlite3.connect(sys.argv[2]) as target:
    source.backup(target)
COPY

if [ -n "$sensors" ]; then
  "$colmap" adasfm_prior_importer \
    --database_path "$cleaned" --image_times_path "$sensors/times.csv" \
    --imu_path "$sensors/imu.csv" --wheel_path "$sensors/wheel.csv" \
    --sensors_path "$sensors/sensors.yaml"
fi

# Positions and the direction of gravity are written if the database has
# COLMAP 4's table of priors.
priors=0
if python3 - "$cleaned" <<'TABLE'
import sqlite3, sys
columns = [row[1] for row in sqlite3.connect(sys.argv[1]).execute(
    'PRAGMA table_info(pose_priors)')]
sys.exit(0 if {'gravity', 'corr_data_id'} <= set(columns) else 1)
TABLE
then priors=1; fi
mkdir -p "$cleaned.coarse"
"$colmap" adasfm_global --database_path "$cleaned" \
  --output_path "$cleaned.coarse" --AdaSfmGlobal.write_pose_priors "$priors"

# Removes joins that vision cannot measure, since COLMAP's mappers have no sensors
# to bridge them.
scripts=$(dirname "${BASH_SOURCE[0]}")
"$scripts/drop_weak_joins.py" "$cleaned"
"$scripts/mapper_start.py" "$cleaned" "$cleaned.coarse/summary.json" \
  > "$cleaned.options"
