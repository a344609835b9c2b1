#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Checks that `scripts/setup.sh --for-demo` builds every file of COLMAP's library
# that our program links: links the program once more, with these files alone.
#
#   scripts/checks/check_host_part.sh      after scripts/setup.sh
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
build=${ADASFM_BUILD_DIR:-$root/build}
host=$(sed -n 's/^COLMAP_DIR:[A-Z]*=//p' "$build/CMakeCache.txt")
lib=$(realpath "$host/../../lib/colmap")
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

# Takes the lists from setup.sh.
eval "$(sed -n '/^host_part=(/,/^host_unused/p' "$root/scripts/setup.sh")"
mkdir "$scratch/lib"
for library in "${host_part_libraries[@]}"; do
  cp "$lib/$(basename "$library")" "$scratch/lib"
done
for library in "${host_unused_libraries[@]}"; do ar qcs "$scratch/lib/$library"; done
# Some file names occur in several folders of COLMAP, and so several times in the
# library: all files of such a name are kept.
mapfile -t wanted < <(printf '%s.cc.o\n' "${host_part[@]##*/}" | sort -u)
cp "$lib/libcolmap.a" "$scratch/lib/"
mapfile -t surplus < <(ar t "$scratch/lib/libcolmap.a" |
  grep -vxF -f <(printf '%s\n' "${wanted[@]}") || true)
if [ ${#surplus[@]} != 0 ]; then
  ar d "$scratch/lib/libcolmap.a" "${surplus[@]}"
fi
cd "$build"
command=$(ninja -t commands bin/colmap | tail -n 1)
command=${command//$lib/$scratch/lib}
# The command may name the folder by the path in COLMAP_DIR.
command=${command//"$host/../../lib/colmap"/$scratch/lib}
bash -c "${command/-o bin\/colmap/-o $scratch/colmap}" || {
  echo "check_host_part: host_part in scripts/setup.sh lacks a file of COLMAP" >&2
  exit 1
}
