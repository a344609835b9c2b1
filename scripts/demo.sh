#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Sets up what is missing, renders a drive with its IMU and wheel logs, and runs
# the whole chain on it, from photos to one metric model and its report.
#
#   scripts/demo.sh [OUTPUT_FOLDER]      default: adasfm-demo/ in this folder
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
output=${1:-adasfm-demo}

say() { printf '\n== %s\n' "$*"; }

"$root/scripts/setup.sh" --for-demo
colmap=${ADASFM_BUILD_DIR:-$root/build}/bin/colmap

say "1/3 Rendering the world into $output"
rm -rf "$output"
mkdir -p "$output"
"$colmap" adasfm_synthesizer --output_path "$output" --render 1 \
  --num_images 60 --seed 2

say '2/3 From photos and logs to the model'
"$colmap" adasfm_automatic_reconstructor --image_path "$output/images" \
  --workspace_path "$output/workspace" --image_times_path "$output/times.csv" \
  --imu_path "$output/imu.csv" --wheel_path "$output/wheel.csv" \
  --sensors_path "$output/sensors.yaml" --ground_truth_path "$output/gt.txt"

say '3/3 Comparing with the ground truth'
"$colmap" adasfm_evaluator --input_path "$output/workspace/sparse/0" \
  --ground_truth_path "$output/gt.txt"

cat <<TEXT

Where to look:
  $output/workspace/report.html   everything in one page: open it in a browser
  $output/images                  the rendered photos
  $output/workspace/sparse/0      the model; COLMAP's graphical interface opens
                                  it (File > Import model)
  $output/workspace/sparse/summary.json, $output/workspace/coarse/summary.json
                                  figures of each stage
TEXT
