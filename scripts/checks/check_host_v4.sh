#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Compiles colmap_ext against the headers of COLMAP 4 without making code: no
# library of it is needed, only a package file that CMake finds and that has the
# target colmap::colmap with the include folders (docs/reference/host.md).
#
#   scripts/checks/check_host_v4.sh COLMAP_DIR [ROOM...]
#
#   COLMAP_DIR   folder of colmap-config.cmake
#   ROOM         as host_v4 or bundle_adjustment; default: every room
set -euo pipefail
if [ $# -lt 1 ]; then sed -n '3,10s/^# \{0,1\}//p' "$0" >&2; exit 1; fi
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
cmake -S "$root" -B "$scratch" -G Ninja -DCOLMAP_DIR="$1" -DADASFM_UNITY=ON \
  -DADASFM_WERROR=ON -DADASFM_BUILD_TESTS=OFF -DADASFM_BUILD_BENCHMARKS=OFF \
  -DCMAKE_EXPORT_COMPILE_COMMANDS=ON > "$scratch/log" 2>&1 ||
  { tail -n 20 "$scratch/log" >&2; exit 1; }
grep -q 'host/v4$' "$scratch/log" || {
  echo "check_host_v4: $1 is no COLMAP 4" >&2
  exit 1
}
python3 - "$scratch/compile_commands.json" "${@:2}" <<'COMPILE'
import json, re, subprocess, sys
rooms, failed = sys.argv[2:], []
for entry in json.load(open(sys.argv[1])):
    file = entry['file']
    room = re.search(r'unity_colmap_ext_(?:(\w+)_)?cxx\.cxx$', file)
    if not room and '/colmap_ext/' not in file:
        continue
    name = room[1] or 'colmap_ext' if room else file.rpartition('/')[2]
    if rooms and name not in rooms:
        continue
    command = re.sub(r' -o \S+', '', entry['command']) + ' -fsyntax-only'
    code = subprocess.run(command, shell=True, cwd=entry['directory']).returncode
    print('%s: %s' % (name, 'fails' if code else 'ok'), flush=True)
    failed += [name] if code else []
sys.exit(bool(failed))
COMPILE
