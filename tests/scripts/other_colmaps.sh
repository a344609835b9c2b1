#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Runs the chain with other COLMAPs than the one that our program links: each
# extracts and matches rendered photos, and each reads our models. COLMAP 3.10
# and 4 are Debian's packages of other releases, fetched once into ADASFM_CACHE
# (1.1 GB); a version that cannot be fetched is left out with one line.
#
#   other_colmaps.sh BUILD_DIR
set -euo pipefail
build=$(cd "$1" && pwd)
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
cache=${ADASFM_CACHE:-${XDG_CACHE_HOME:-$HOME/.cache}/adasfm}
ours=$build/bin/colmap
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

fail() { echo "other_colmaps: $*" >&2; exit 1; }

# call WHAT COMMAND...: shows the end of the command's output if it fails.
call() {
  local what=$1
  shift
  "$@" > "$work/log" 2>&1 || {
    tail -n 5 "$work/log" >&2
    fail "$what failed with exit code $?"
  }
}

host() { ADASFM_HOST_COLMAP=${programs[$1]} call "$1 $2" "$ours" "${@:2}"; }

# option_group HOST COMMAND GROUP NEW_GROUP: the group of use_gpu, which moved
# in COLMAP 3.13.
option_group() {
  local group=$3
  grep -q -- "--$4.use_gpu" <<< "$("${programs[$1]}" "$2" -h 2>&1)" && group=$4
  echo "$group"
}

# database HOST FILE: makes a database of the photos with that COLMAP.
database() {
  local extraction matching
  extraction=$(option_group "$1" feature_extractor SiftExtraction FeatureExtraction)
  matching=$(option_group "$1" exhaustive_matcher SiftMatching FeatureMatching)
  host "$1" feature_extractor --database_path "$2" --image_path "$photos" \
    --ImageReader.single_camera 1 --ImageReader.camera_model PINHOLE \
    --ImageReader.camera_params "$camera" --"$extraction.use_gpu" 0 \
    --SiftExtraction.max_num_features 500
  host "$1" exhaustive_matcher --database_path "$2" --"$matching.use_gpu" 0
}

# chain DATABASE FOLDER: importer, coarse model, mapper, and the check of both.
chain() {
  call adasfm_prior_importer "$ours" adasfm_prior_importer \
    --database_path "$1" --image_times_path "$world/times.csv" \
    --imu_path "$world/imu.csv" --wheel_path "$world/wheel.csv" \
    --sensors_path "$world/sensors.yaml"
  call adasfm_global "$ours" adasfm_global --database_path "$1" \
    --output_path "$2/global"
  call adasfm_mapper "$ours" adasfm_mapper --database_path "$1" \
    --input_path "$2/global/0" --output_path "$2/sparse"
  is_right "$2/sparse/0"
}

# is_right MODEL [ALIGNMENT]: the model has all 8 images at their true positions,
# in metres or after the alignment sim3.
is_right() {
  call adasfm_evaluator "$ours" adasfm_evaluator --input_path "$1" \
    --ground_truth_path "$world/gt.txt" --json_path "$work/evaluation.json"
  python3 - "$work/evaluation.json" "${2:-se3}" <<'CHECK' || fail "the model in $1 is wrong"
import json, sys
figures = json.load(open(sys.argv[1]))
assert figures['num_common_images'] == 8, figures
# The drive is 7 m long; no error of this size is visible.
assert figures[sys.argv[2]]['translation_rmse_m'] < 0.02, figures
CHECK
}

# takes_model HOST MODEL: the host's commands read the model.
takes_model() {
  rm -rf "$work/out"
  mkdir -p "$work/out/dense" "$work/out/adjusted"
  host "$1" model_analyzer --path "$2"
  host "$1" image_undistorter --image_path "$photos" --input_path "$2" \
    --output_path "$work/out/dense"
  host "$1" bundle_adjuster --input_path "$2" --output_path "$work/out/adjusted"
}

# continues_model HOST DATABASE MODEL: the host's commands that read the model
# with its database continue it.
continues_model() {
  rm -rf "$work/out"
  mkdir -p "$work/out/points" "$work/out/more"
  host "$1" point_triangulator --database_path "$2" --image_path "$photos" \
    --input_path "$3" --output_path "$work/out/points"
  host "$1" mapper --database_path "$2" --image_path "$photos" \
    --input_path "$3" --output_path "$work/out/more"
}

# continues_copy HOST DATABASE MODEL: the same on a copy of the database, which
# a newer COLMAP converts to its own form. COLMAP 4 cannot convert a database of
# 3.10 without the column that the launcher's warning asks for. The model stays
# right; the mapper adjusts the whole model without a fixed scale.
continues_copy() {
  cp "$2" "$work/copy.db"
  if [[ $1 == 4.* && $2 == */3.10/* ]]; then
    sqlite3 "$work/copy.db" \
      'ALTER TABLE pose_priors ADD COLUMN position_covariance BLOB'
  fi
  continues_model "$1" "$work/copy.db" "$3"
  is_right "$work/out/points"
  is_right "$work/out/more" sim3
  rm -f "$work"/copy.db*
}

# warns HOST DATABASE WORDS: the host cannot use a copy of the database; the
# launcher warns of that with these words.
warns() {
  rm -f "$work"/copy.db*
  cp "$2" "$work/copy.db"
  ADASFM_HOST_COLMAP=${programs[$1]} "$ours" mapper --image_path "$photos" \
    --database_path "$work/copy.db" --output_path "$work/out" \
    > "$work/log" 2>&1 && fail "COLMAP $1 can use $2 after all"
  grep -q "WARNING: $work/copy.db is of COLMAP $3" "$work/log" ||
    fail "no warning before COLMAP $1 spoils $2"
}

rows() { sqlite3 "$1" 'SELECT pair_id, rows, cols, quote(data), config,
  quote(F), quote(E), quote(H), quote(qvec), quote(tvec)
  FROM two_view_geometries ORDER BY pair_id'; }

declare -A programs=([3.8]=$(sed -nE \
  's/^ADASFM_HOST_COLMAP:FILEPATH=(.*)/\1/p' "$build/CMakeCache.txt"))
hosts=(3.8)
for release in trixie sid; do
  if program=$("$here/fetch_colmap.sh" "$cache/other" "$release"); then
    name=$("$program" help 2> /dev/null | sed -nE '1s/COLMAP ([0-9.]+).*/\1/p')
    programs[$name]=$program
    hosts+=("$name")
  else
    echo "other_colmaps: left out the COLMAP of Debian $release"
  fi
done
newest=${hosts[-1]}

echo '== Rendering'
world=$work/world
mkdir -p "$world"
call adasfm_synthesizer "$ours" adasfm_synthesizer --output_path "$world" \
  --render 1 --num_images 8 --seed 2
photos=$world/images
camera=$(sed -nE 's/^ *intrinsics: *\[(.*)\]/\1/p' "$world/sensors.yaml" | tr -d ' ')

for name in "${hosts[@]}"; do
  echo "== Database of COLMAP $name"
  folder=$work/$name
  mkdir -p "$folder"
  database "$name" "$folder/database.db"
  cp "$folder/database.db" "$folder/original.db"
  chain "$folder/database.db" "$folder"
  # The oldest host comes first. No host opens the database of a newer one, but
  # each runs the commands on its model that need no database.
  is_older=1
  for other in "${hosts[@]}"; do
    takes_model "$other" "$folder/sparse/0"
    [ "$other" != "$name" ] || is_older=0
    [ "$is_older" = 1 ] ||
      continues_copy "$other" "$folder/database.db" "$folder/sparse/0"
  done
  continues_model "$name" "$folder/database.db" "$folder/sparse/0"
  call adasfm_restorer "$ours" adasfm_restorer --database_path "$folder/database.db"
  [ "$(rows "$folder/database.db")" = "$(rows "$folder/original.db")" ] ||
    fail "the originals of COLMAP $name's database are not restored"
done

if [[ $newest == 4.* ]]; then
  echo "== Database of COLMAP 3.8 that $newest opened after adasfm_global"
  folder=$work/opened
  mkdir -p "$folder"
  cp "$work/3.8/original.db" "$folder/database.db"
  cp "$work/3.8/original.db" "$folder/expected.db"
  chain "$folder/database.db" "$folder"
  continues_model "$newest" "$folder/database.db" "$folder/sparse/0"
  # 3.8 still reads the database that the newest has converted.
  continues_copy 3.8 "$folder/database.db" "$folder/sparse/0"
  call adasfm_restorer "$ours" adasfm_restorer --database_path "$folder/database.db"
  # The newest converts a database with the original geometries.
  host "$newest" mapper --database_path "$folder/expected.db" \
    --image_path "$photos" --input_path "$work/3.8/sparse/0" \
    --output_path "$work/out/more"
  [ "$(rows "$folder/database.db")" = "$(rows "$folder/expected.db")" ] ||
    fail "the originals are not restored after COLMAP $newest opened the file"

  echo "== Database of COLMAP $newest with other ids of frames than of images"
  folder=$work/frames
  mkdir -p "$folder"
  cp "$work/$newest/original.db" "$folder/database.db"
  sqlite3 "$folder/database.db" 'PRAGMA foreign_keys = OFF;
    UPDATE frames SET frame_id = frame_id + 100;
    UPDATE frame_data SET frame_id = frame_id + 100;'
  chain "$folder/database.db" "$folder"
  [ -f "$folder/sparse/0/frames.bin" ] || fail 'no frames.bin was written'
  continues_model "$newest" "$folder/database.db" "$folder/sparse/0"
  takes_model "$newest" "$folder/sparse/0"
  host 3.8 model_analyzer --path "$folder/sparse/0"
fi
# stereo FOLDER: a synthetic drive with two cameras.
stereo() {
  mkdir -p "$1"
  call adasfm_synthesizer "$ours" adasfm_synthesizer --output_path "$1" \
    --num_images 12 --num_neighbors 4 --stereo_baseline 0.5
}

# is_rig HOST MODEL: this COLMAP reads one rig of two cameras, and 12 frames of
# two images each.
is_rig() {
  rm -rf "$work/out"
  mkdir -p "$work/out"
  host "$1" model_converter --input_path "$2" --output_path "$work/out" \
    --output_type TXT
  awk '!/^#/ { rigs++; cameras += $2 } END { exit !(rigs == 1 && cameras == 2) }' \
    "$work/out/rigs.txt" || fail "COLMAP $1 sees no rig of two cameras in $2"
  awk '!/^#/ { frames++; images += $10 }
    END { exit !(frames == 12 && images == 24) }' "$work/out/frames.txt" ||
    fail "COLMAP $1 sees other frames in $2"
}

if [[ $newest == 4.* ]]; then
  echo "== A stereo rig of the calibration"
  folder=$work/calibrated
  stereo "$folder"
  call adasfm_prior_importer "$ours" adasfm_prior_importer \
    --database_path "$folder/database.db" --image_times_path "$folder/times.csv" \
    --sensors_path "$folder/sensors.yaml"
  call adasfm_global "$ours" adasfm_global \
    --database_path "$folder/database.db" --output_path "$folder/global"
  call adasfm_mapper "$ours" adasfm_mapper \
    --database_path "$folder/database.db" --input_path "$folder/global/0" \
    --output_path "$folder/sparse"
  is_rig "$newest" "$folder/sparse/0"
  takes_model "$newest" "$folder/sparse/0"
  takes_model 3.8 "$folder/sparse/0"

  echo "== A stereo rig of COLMAP $newest, of which the relative pose is unknown"
  folder=$work/configured
  stereo "$folder"
  echo '[{"cameras": [{"image_prefix": "cam0/", "ref_sensor": true},
                      {"image_prefix": "cam1/"}]}]' > "$folder/rig.json"
  host "$newest" rig_configurator --database_path "$folder/database.db" \
    --rig_config_path "$folder/rig.json"
  call adasfm_global "$ours" adasfm_global \
    --database_path "$folder/database.db" --output_path "$folder/global"
  call adasfm_mapper "$ours" adasfm_mapper \
    --database_path "$folder/database.db" --input_path "$folder/global/0" \
    --output_path "$folder/sparse"
  is_rig "$newest" "$folder/sparse/0"
  takes_model "$newest" "$folder/sparse/0"
  continues_model "$newest" "$folder/database.db" "$folder/sparse/0"
fi

for name in "${hosts[@]}"; do
  echo "== scripts/adasfm.sh with COLMAP $name"
  COLMAP=$ours ADASFM_HOST_COLMAP=${programs[$name]} call adasfm.sh \
    "$here/../../scripts/adasfm.sh" "$photos" "$work/script-$name" PINHOLE \
    "$camera" "$world"
done

for name in "${hosts[@]:1}"; do
  echo "== adasfm_automatic_reconstructor with COLMAP $name, interrupted and again"
  reconstruct=(env ADASFM_HOST_COLMAP="${programs[$name]}"
    "$ours" adasfm_automatic_reconstructor --image_path "$photos"
    --workspace_path "$work/auto-$name" --camera_model PINHOLE
    --camera_params "$camera" --max_num_features 500)
  timeout -s INT 4 "${reconstruct[@]}" > "$work/log" 2>&1 || true
  call adasfm_automatic_reconstructor "${reconstruct[@]}"
  call model_analyzer "$ours" model_analyzer --path "$work/auto-$name/sparse/0"
  grep -q 'Registered images: 8' "$work/log" || fail "images are missing"
done

# The documentation test runs the commands with COLMAP 3.8. The slowest pages are
# left out here: the commands of automatic_reconstruction.md are run above, and on
# the other pages only scripts/benchmark calls the host.
if [[ $newest == 4.* ]]; then
  echo "== The commands of README.md and the guides with COLMAP $newest"
  guides=$here/../../docs/guide
  ADASFM_HOST_COLMAP=${programs[$newest]} call check_docs.py \
    python3 "$here/../../scripts/checks/check_docs.py" "$ours" --run \
    "$here/../../README.md" \
    "$guides"/{tutorial,pair_selection,cleaner,evaluation,report}.md \
    "$here"/../../docs/reference/{formats,mapper}.md
fi

if [ -n "${programs[3.10]:-}" ] && [[ $newest == 4.* ]]; then
  echo '== Warnings'
  warns 3.8 "$work/3.10/original.db" '3.10 or later'
  warns 3.8 "$work/$newest/original.db" '4.0 or later'
  warns 3.10 "$work/$newest/original.db" '4.0 or later'
  warns "$newest" "$work/3.10/original.db" '3.10, which'
fi
echo 'other_colmaps: ok'
