#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Runs scripts/adasfm.sh on a small rendered drive, with the sensors and without:
#   adasfm_sh.sh LAUNCHER
set -euo pipefail
export COLMAP=$1
script=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)/scripts/adasfm.sh
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
num_images=12

fail() { echo "adasfm.sh: $*" >&2; exit 1; }

"$COLMAP" adasfm_synthesizer --output_path "$work/drive" --render 1 \
  --num_images "$num_images" --spacing 1 --image_width 400 --image_height 250 \
  > "$work/log"
camera=$(sed -nE 's/^ *intrinsics: *\[(.*)\]/\1/p' "$work/drive/sensors.yaml" | tr -d ' ')

# check_result WORKSPACE METRIC: the model has all images; METRIC: whether its
# lengths are metres.
check_result() {
  [ -s "$1/report.html" ] || fail "$1 has no report"
  "$COLMAP" adasfm_evaluator --input_path "$1/sparse" \
    --ground_truth_path "$work/drive/gt.txt" --json_path "$1/figures.json" > "$work/log"
  grep -q "\"num_common_images\": $num_images" "$1/figures.json" ||
    fail "images are missing: $(cat "$1/figures.json")"
  grep -q "\"is_metric\": $2" "$1/sparse/summary.json" ||
    fail "is_metric is not $2: $(cat "$1/sparse/summary.json")"
}

for sensors in "$work/drive" ''; do
  workspace=$work/with_${sensors:+sensors}
  "$script" "$work/drive/images" "$workspace" PINHOLE "$camera" \
    ${sensors:+"$sensors"} > "$work/log" 2>&1 || { tail -n 20 "$work/log"; fail 'failed'; }
  if [ -n "$sensors" ]; then check_result "$workspace" true
  else check_result "$workspace" false; fi
done

# Without arguments the script prints its usage.
if "$script" > "$work/log" 2>&1; then fail 'wants arguments'; fi
grep -q 'adasfm.sh PHOTOS WORKSPACE' "$work/log" || fail 'does not explain itself'
echo 'adasfm.sh: ok'
