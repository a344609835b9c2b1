#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Sets up what is missing, renders a drive with its IMU and wheel logs, and runs
# the whole chain on it, from photos to one metric model.
#
#   scripts/demo.sh [OUTPUT_FOLDER]      default: adasfm-demo/ in this folder
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
output=${1:-adasfm-demo}

say() { printf '\n== %s\n' "$*"; }

"$root/scripts/setup.sh"
colmap=${ADASFM_BUILD_DIR:-$root/build}/bin/colmap

say "1/6 Rendering the world into $output (about 1 minute)"
rm -rf "$output"
mkdir -p "$output"
"$colmap" adasfm_synthesizer --output_path "$output" --render 1 \
  --num_images 60 --seed 2
database=$output/database.db
camera=$(sed -nE 's/^ *intrinsics: *\[(.*)\]/\1/p' "$output/sensors.yaml" | tr -d ' ')

# COLMAP 3.13 and later have these options in other groups.
extraction=SiftExtraction matching=SiftMatching
if grep -q FeatureExtraction.use_gpu <<< "$("$colmap" feature_extractor -h 2>&1)"; then
  extraction=FeatureExtraction matching=FeatureMatching
fi

say '2/6 Extracting and matching features with COLMAP (about 2 minutes)'
"$colmap" feature_extractor --database_path "$database" \
  --image_path "$output/images" --ImageReader.single_camera 1 \
  --ImageReader.camera_model PINHOLE --ImageReader.camera_params "$camera" \
  --"$extraction.use_gpu" 0 --SiftExtraction.max_num_features 2000 \
  > "$output/features.log" 2>&1
"$colmap" sequential_matcher --database_path "$database" \
  --SequentialMatching.overlap 8 --"$matching.use_gpu" 0 \
  > "$output/matches.log" 2>&1

say '3/6 Importing the IMU and wheel logs as priors'
"$colmap" adasfm_prior_importer --database_path "$database" \
  --image_times_path "$output/times.csv" --imu_path "$output/imu.csv" \
  --wheel_path "$output/wheel.csv" --sensors_path "$output/sensors.yaml"

say '4/6 Coarse global SfM'
"$colmap" adasfm_global --database_path "$database" \
  --output_path "$output/global"

say '5/6 Partitioned mapping'
"$colmap" adasfm_mapper --database_path "$database" \
  --input_path "$output/global/0" --output_path "$output/sparse"

"$colmap" color_extractor --image_path "$output/images" \
  --input_path "$output/sparse/0" --output_path "$output/sparse/0" \
  > "$output/colors.log" 2>&1

say '6/6 Comparing with the ground truth, drawing the report'
"$colmap" adasfm_evaluator --input_path "$output/sparse/0" \
  --ground_truth_path "$output/gt.txt"
"$colmap" adasfm_reporter --output_path "$output/report.html" \
  --input_path "$output/sparse/0" --coarse_path "$output/global/0" \
  --database_path "$database" --image_path "$output/images" \
  --ground_truth_path "$output/gt.txt"

cat <<TEXT

Where to look:
  $output/report.html       everything in one page: open it in a browser
  $output/images            the rendered photos
  $output/sparse/0          the model; COLMAP's graphical interface opens it
                            (File > Import model)
  $output/sparse/summary.json, $output/global/summary.json   figures of each stage
TEXT
