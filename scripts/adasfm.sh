#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# The whole chain as separate COLMAP commands, to read and to copy from.
# `colmap adasfm_automatic_reconstructor` does the same in one command, and
# continues after an interruption.
#
#   scripts/adasfm.sh PHOTOS WORKSPACE CAMERA_MODEL CAMERA_PARAMS [SENSORS]
#
#   PHOTOS         folder of the photos
#   WORKSPACE      folder for the results
#   CAMERA_MODEL   COLMAP's name, as PINHOLE
#   CAMERA_PARAMS  its parameters, as 700,700,600,180
#   SENSORS        folder with imu.csv, wheel.csv, times.csv and sensors.yaml;
#                  leave it out when there are none
#
# Environment: COLMAP, the executable (default: colmap of the PATH).
set -euo pipefail
if [ $# -lt 4 ]; then sed -n '3,17s/^# \{0,1\}//p' "$0" >&2; exit 1; fi
colmap=${COLMAP:-colmap}
photos=$1 workspace=$2 camera_model=$3 camera_params=$4 sensors=${5:-}
database=$workspace/database.db
mkdir -p "$workspace"

# COLMAP 3.13 and later have these options in other groups.
extraction=SiftExtraction matching=SiftMatching
if grep -q FeatureExtraction.use_gpu <<< "$("$colmap" feature_extractor -h 2>&1)"; then
  extraction=FeatureExtraction matching=FeatureMatching
fi

# Keypoints and descriptors; the camera's parameters are kept as given.
"$colmap" feature_extractor \
  --database_path "$database" --image_path "$photos" \
  --ImageReader.single_camera 1 --ImageReader.camera_model "$camera_model" \
  --ImageReader.camera_params "$camera_params" \
  --SiftExtraction.max_num_features 2048 --"$extraction.use_gpu" 0

# Which pairs to match: neighbours in time and similar images.
"$colmap" adasfm_pair_generator \
  --database_path "$database" --output_path "$workspace/pairs.txt"

# Matching and verification of these pairs.
"$colmap" matches_importer \
  --database_path "$database" --match_list_path "$workspace/pairs.txt" \
  --match_type pairs --"$matching.use_gpu" 0

# Sensor logs become priors in the database.
if [ -n "$sensors" ]; then
  "$colmap" adasfm_prior_importer \
    --database_path "$database" --image_times_path "$sensors/times.csv" \
    --imu_path "$sensors/imu.csv" --wheel_path "$sensors/wheel.csv" \
    --sensors_path "$sensors/sensors.yaml"
fi

# Coarse poses of all images; cleans the database's matches.
"$colmap" adasfm_global \
  --database_path "$database" --output_path "$workspace/coarse"

# The model, in parts that are merged.
"$colmap" adasfm_mapper \
  --database_path "$database" --input_path "$workspace/coarse" \
  --output_path "$workspace/sparse"

# One page to look at.
"$colmap" adasfm_reporter \
  --output_path "$workspace/report.html" --input_path "$workspace/sparse" \
  --coarse_path "$workspace/coarse" --database_path "$database" \
  --image_path "$photos"
