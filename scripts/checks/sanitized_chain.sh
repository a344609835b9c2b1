#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Builds all our code with sanitizers and runs the whole chain on a small world
# and on photos with four threads; fails when a command fails, as after a finding.
#
#   scripts/checks/sanitized_chain.sh address|thread [BUILD_FOLDER]
#   scripts/checks/sanitized_chain.sh build address|thread BUILD_FOLDER TARGET...
#                                                     only builds these targets
#   scripts/checks/sanitized_chain.sh run COLMAP      only the chain
#
# address: AddressSanitizer and UBSan; thread: ThreadSanitizer. The first build
# takes long. COLMAP and the system's libraries are not instrumented, so
# ThreadSanitizer does not see how they synchronise: tsan.supp beside this file
# lists the reports about them that are ignored.
# COLMAP_DIR names COLMAP's CMake package (scripts/setup.sh says where it lies).
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
root=$here/../..
host=${ADASFM_CACHE:-${XDG_CACHE_HOME:-$HOME/.cache}/adasfm}/colmap-3.8

usage() { sed -n '3,18s/^# \?//p' "${BASH_SOURCE[0]}" >&2; exit 2; }

# build address|thread FOLDER TARGET...
build() {
  local sanitize=thread folder=$2
  [ "$1" = thread ] || sanitize=ON
  # Only line numbers and few optimisations, since compiling takes most of the time.
  cmake -S "$root" -B "$folder" -G Ninja -DCMAKE_BUILD_TYPE=RelWithDebInfo \
    -DCMAKE_CXX_FLAGS_RELWITHDEBINFO='-O1 -g1' -DADASFM_UNITY=ON \
    -DCOLMAP_DIR="${COLMAP_DIR:-$host/share/colmap}" \
    -DADASFM_BUILD_BENCHMARKS=OFF -DADASFM_SANITIZE="$sanitize" > /dev/null
  cmake --build "$folder" --parallel "$(nproc)" --target "${@:3}"
}

case ${1:-}/$# in
  address/[12] | thread/[12])
    folder=${2:-$root/build-sanitize-$1}
    build "$1" "$folder" adasfm_launcher
    colmap=$(realpath "$folder/bin/colmap")
    ;;
  build/[4-9])
    build "${@:2}"
    exit
    ;;
  run/2) colmap=$(realpath "$2") ;;
  *) usage ;;
esac

world=$(mktemp -d)
trap 'rm -rf "$world"' EXIT
cd "$world"
# COLMAP's own leaks are ignored. A container overflow is reported wrongly where
# only one side of a std::vector is instrumented. COLMAP's headers make vectors of
# Eigen's small types free() memory that other code has allocated with new.
export ASAN_OPTIONS=detect_leaks=0:detect_container_overflow=0:alloc_dealloc_mismatch=0
export UBSAN_OPTIONS=halt_on_error=1:print_stacktrace=1
export TSAN_OPTIONS=halt_on_error=1:second_deadlock_stack=1:suppressions=$here/tsan.supp

step() { printf '== %s\n' "$*"; "$colmap" "$@" > log || { cat log; exit 1; }; }
step adasfm_synthesizer --output_path . --num_images 40 --seed 3 --gnss_rate 1
step adasfm_prior_importer --database_path database.db \
  --image_times_path times.csv --imu_path imu.csv --wheel_path wheel.csv \
  --gnss_path gnss.csv --sensors_path sensors.yaml
step adasfm_global --database_path database.db --output_path coarse \
  --AdaSfmGlobal.num_threads 4
step adasfm_mapper --database_path database.db --input_path coarse/0 \
  --output_path sparse --num_threads 4 --AdaSfmPartition.max_part_size 25 \
  --AdaSfmPartition.max_num_images_undivided 20
step adasfm_evaluator --input_path sparse/0 --ground_truth_path gt.txt
step adasfm_reporter --input_path sparse --coarse_path coarse \
  --database_path database.db --output_path report.html
step adasfm_georeferencer --input_path sparse/0 --output_path utm --frame utm
step adasfm_restorer --database_path database.db
cp database.db other.db
step adasfm_database_merger --input_paths database.db,other.db \
  --prefixes a/,b/ --output_path merged.db
# From photos, with threads in each step.
step adasfm_synthesizer --output_path photos --num_images 12 --render 1 \
  --image_width 320 --image_height 200 --seed 4
cd photos
step adasfm_automatic_reconstructor --image_path images --workspace_path ws \
  --num_threads 4 --camera_model PINHOLE --camera_params 192,192,160,100 \
  --image_times_path times.csv --imu_path imu.csv --wheel_path wheel.csv \
  --sensors_path sensors.yaml --max_num_features 500 --num_similar_images 4
step adasfm_pair_generator --database_path ws/database.db --num_threads 4 \
  --output_path pairs.txt --image_times_path times.csv
echo 'chain: ok'
