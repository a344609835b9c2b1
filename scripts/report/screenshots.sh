#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Makes the pictures of the report from the demo's drive; runs the demo unless its
# folder is there.
#
#   scripts/report/screenshots.sh [DEMO_FOLDER [PICTURES]]
#                                 default: adasfm-demo/ and docs/images/
#
# Environment: COLMAP, an executable that is built already (default: setup.sh's).
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
demo=${1:-adasfm-demo}
pictures=$(realpath -m "${2:-$root/docs/images}")

colmap=${COLMAP:-${ADASFM_BUILD_DIR:-$root/build}/bin/colmap}
[ -n "${COLMAP:-}" ] || "$root/scripts/setup.sh" --for-tests
[ -e "$demo/workspace/coarse/0" ] || "$root/scripts/demo.sh" "$demo"
colmap=$(realpath "$colmap")
# Maps in several parts, to show their colours. Runs inside the folder, since the
# page names the paths that it was made from.
cd "$demo"
database=workspace/database.db
"$colmap" adasfm_mapper --database_path "$database" --input_path workspace/coarse/0 \
  --output_path parts --AdaSfmPartition.max_num_images_undivided 30 \
  --AdaSfmPartition.max_part_size 25
"$colmap" color_extractor --image_path images --input_path parts/0 \
  --output_path parts/0 > color.log 2>&1
"$colmap" adasfm_reporter --output_path parts.html --input_path parts/0 \
  --coarse_path workspace/coarse/0 --database_path "$database" --image_path images \
  --ground_truth_path gt.txt
/usr/bin/python3 "$root/scripts/report/look_at_report.py" parts.html \
  --screenshots "$pictures"
