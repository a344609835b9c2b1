#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Profiles the three commands on a clean world with perf (Debian's linux-perf):
# profile.sh [images]. Writes the symbols with most own CPU time, per command, to
# adasfm-benchmark/profile-IMAGES/profile.md.
# Environment: COLMAP, the executable (default: setup.sh's).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."

images=${1:-1000}
colmap=${COLMAP:-${ADASFM_BUILD_DIR:-build}/bin/colmap}
folder=adasfm-benchmark/profile-$images
[[ $images =~ ^[1-9][0-9]*$ ]] || {
  echo 'profile.sh takes a number of images' >&2
  exit 2
}
command -v perf > /dev/null || {
  echo 'profile.sh needs perf: apt-get install linux-perf' >&2
  exit 1
}

rm -rf "$folder"
mkdir -p "$folder"
"$colmap" adasfm_synthesizer --output_path "$folder" --num_images "$images" \
  > "$folder/make.log" 2>&1
printf '# Profile of %s images\n\nCommit %s, %s.\n' "$images" \
  "$(git describe --always --dirty 2> /dev/null || echo unknown)" "$(nproc) cores" > "$folder/profile.md"

# Runs one command under perf and appends its table. Sampling by cpu-clock works
# in virtual machines, too.
profile() {
  local name=$1
  shift
  echo "profiling $name" >&2
  perf record -q -F 199 -e cpu-clock -o "$folder/$name.data" \
    "$colmap" "$name" --database_path "$folder/database.db" "$@" \
    > "$folder/$name.log" 2>&1
  {
    printf '\n## %s\n\n| own time %% | library | symbol |\n|---:|---|---|\n' \
      "$name"
    perf report -i "$folder/$name.data" --stdio -q --no-children \
      --sort dso,symbol --percent-limit 1 --field-separator '|' 2> /dev/null |
      sed -nE 's/^ *([0-9.]+)% *\| *([^|]*[^| ]) *\| *\[.\] *(.*[^ ]) *$/\1|\2|\3/p' |
      cut -c1-110 |
      sed -E 's/ +$//; s/^([^|]*)\|([^|]*)\|(.*)$/| \1 | \2 | `\3` |/' |
      head -15
  } >> "$folder/profile.md"
}

profile adasfm_prior_importer --image_times_path "$folder/times.csv" \
  --imu_path "$folder/imu.csv" --wheel_path "$folder/wheel.csv" \
  --sensors_path "$folder/sensors.yaml"
profile adasfm_global --output_path "$folder/global"
profile adasfm_mapper --input_path "$folder/global/0" \
  --output_path "$folder/sparse"
echo "written: $folder/profile.md"
