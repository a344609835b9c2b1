#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Runs the chain on a small world, and opens its report in a browser:
#   report_in_browser.sh LAUNCHER
set -euo pipefail
colmap=$1
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

for tool in /usr/bin/chromium /usr/bin/chromedriver; do
  [ -x "$tool" ] || { echo "$tool is missing; scripts/setup.sh installs it"; exit 1; }
done
# Places that look alike give removed pairs to show.
"$colmap" adasfm_synthesizer --output_path "$work" --num_images 150 \
  --spacing 2 --num_keypoints 100 --alias_ratio 0.05 > /dev/null
# Any picture serves as a photo; OpenCV detects the format by the content.
mkdir "$work/images"
sqlite3 "$work/database.db" 'SELECT name FROM images' | while read -r name; do
  { printf 'P6 80 50 255\n'; head -c 12000 /dev/zero | tr '\0' '\140'; } \
    > "$work/images/$name"
done
"$colmap" adasfm_prior_importer --database_path "$work/database.db" \
  --image_times_path "$work/times.csv" --imu_path "$work/imu.csv" \
  --wheel_path "$work/wheel.csv" --sensors_path "$work/sensors.yaml" > /dev/null
"$colmap" adasfm_global --database_path "$work/database.db" \
  --output_path "$work/global" > /dev/null
# Reports on several parts, checks them, and takes the documentation's pictures.
COLMAP=$colmap "$root/scripts/report/screenshots.sh" "$work" "$work/pictures"
for picture in "$root"/docs/images/report_*; do
  [ -s "$work/pictures/$(basename "$picture")" ] ||
    { echo "screenshots.sh does not make $picture"; exit 1; }
done
