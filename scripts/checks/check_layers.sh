#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Fails if a room (a folder of sources) includes a room that it may not include,
# or if a file outside colmap_ext/host/v*/ includes a COLMAP header.
#
# The table below is the architecture: a room, and the rooms whose headers it
# may include besides its own. A room with a trailing /... stands for all rooms of
# that layer. Each room is listed below the rooms that it may include, so the order
# of the table proves that there is no cycle.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."

rooms='
core
core/sparse                    core
synthetic                      core
partition                      core

sensors/bags                   core
sensors/io                     core sensors/bags
sensors/log_cleaning           core sensors/io
sensors/preintegration         core sensors/io
sensors/smoother               core sensors/io sensors/preintegration
sensors/calibration_check      core sensors/io sensors/preintegration
sensors                        core sensors/...

global/view_graph              core core/sparse
global/two_view                core global/view_graph
global/odometry                core global/view_graph
global/rotation_averaging      core global/view_graph
global/structure               core global/view_graph
global/calibration             core global/view_graph global/two_view global/odometry
global/loop_closures           core global/view_graph global/odometry
global/translation_averaging   core core/sparse global/view_graph global/odometry
global                         core global/...

colmap_ext/io                  core
colmap_ext/matching            core
colmap_ext/host/v3             core global/view_graph global/two_view colmap_ext/io colmap_ext/matching
colmap_ext/host/v4             core colmap_ext/io colmap_ext/matching
colmap_ext/host                colmap_ext/host/v3 colmap_ext/host/v4 core global/view_graph global/two_view colmap_ext/io colmap_ext/matching
colmap_ext/features            core colmap_ext/io colmap_ext/host
colmap_ext/database            core colmap_ext/io colmap_ext/host global/calibration
colmap_ext/scene               core colmap_ext/io colmap_ext/host colmap_ext/database global/view_graph global/two_view
colmap_ext/cost_functions      core colmap_ext/host
colmap_ext/bundle_adjustment   core core/sparse colmap_ext/host colmap_ext/scene colmap_ext/cost_functions
colmap_ext/priors              core colmap_ext/host colmap_ext/database colmap_ext/scene sensors sensors/... global/two_view
colmap_ext/coarse              core colmap_ext/host colmap_ext/bundle_adjustment colmap_ext/cost_functions colmap_ext/scene global global/...
colmap_ext/mapper              core colmap_ext/host colmap_ext/bundle_adjustment colmap_ext/cost_functions colmap_ext/scene partition
colmap_ext/pairs               core colmap_ext/matching colmap_ext/host colmap_ext/database colmap_ext/scene sensors/io global/odometry
colmap_ext/evaluation          core colmap_ext/host colmap_ext/scene sensors/io
colmap_ext/datasets            core colmap_ext/io colmap_ext/host synthetic
colmap_ext/bags                core sensors/bags sensors/io colmap_ext/io colmap_ext/datasets
colmap_ext/mapper_stage        core colmap_ext/io colmap_ext/host colmap_ext/bundle_adjustment colmap_ext/cost_functions colmap_ext/scene colmap_ext/mapper partition global/odometry
colmap_ext/report              core colmap_ext/io colmap_ext/host colmap_ext/database colmap_ext/evaluation
colmap_ext                     core colmap_ext/io colmap_ext/host colmap_ext/database colmap_ext/scene colmap_ext/priors colmap_ext/coarse colmap_ext/mapper_stage
colmap_ext/workspace           core sensors/io colmap_ext colmap_ext/bags colmap_ext/io colmap_ext/features colmap_ext/host colmap_ext/database colmap_ext/coarse colmap_ext/pairs colmap_ext/datasets colmap_ext/report
colmap_ext/commands            core synthetic sensors sensors/... global global/... partition colmap_ext colmap_ext/...
'

# COLMAP 3.8's unprefixed include folders, and the prefix of newer versions.
host='(base|controllers|estimators|exe|feature|mvs|optim|retrieval|sfm|tools|ui|util|colmap)/'
failed=0

# fail MESSAGE LINES: reports the lines, if there are any.
fail() {
  [ -n "$2" ] || return 0
  printf '%s\n%s\n' "$1" "$2" >&2
  failed=1
}

# The includes of the sources directly in a folder, as FILE:"HEADER.
includes() {
  grep -HoE '^[[:space:]]*#[[:space:]]*include[[:space:]]*[<"][^>"]+' \
    "$1"/*.h "$1"/*.cc 2> /dev/null | sed -E 's/:[^<"]*[<"]/:/' || true
}

known=
while read -r room allowed; do
  [ -n "$room" ] || continue
  pattern="^$room/[^/]+$"
  for other in $allowed; do
    case $other in
      */...) grep -q "^${other%...}" <<< "$known" ||
        fail "$room: $other names no room above it in the table" "$other" ;;
      *) grep -qx "$other" <<< "$known" ||
        fail "$room: $other is not above it in the table" "$other" ;;
    esac
    case $other in
      */...) pattern+="|^${other%/...}/[^/]+/[^/]+$" ;;
      *) pattern+="|^$other/[^/]+$" ;;
    esac
  done
  known+=$room$'\n'
  own=$(includes "$room" |
    grep -E ':(core|sensors|global|partition|synthetic|colmap_ext|tests)/' |
    awk -F: -v pattern="$pattern" '$2 !~ pattern' || true)
  # A version's sources implement the headers of the folder above.
  case $room in
    */v[0-9]*)
      own=$(grep -vE "\.cc:${room%/*}/[^/]+$" <<< "$own" || true) ;;
  esac
  fail "$room may not include (scripts/checks/check_layers.sh):" "$own"
  case $room in
    colmap_ext/host/v*) ;;
    *)
      fail "$room: COLMAP headers belong below colmap_ext/host/v*/" \
        "$(includes "$room" | grep -E ":$host" | cut -d: -f1 | sort -u || true)"
      ;;
  esac
done <<< "$rooms"

fail 'sources in folders that the table does not name' \
  "$(git ls-files 'core/*' 'sensors/*' 'global/*' 'partition/*' 'synthetic/*' \
    'colmap_ext/*' | grep -E '\.(h|cc)$' | xargs -n1 dirname | sort -u |
    grep -vxF "$known" || true)"
[ "$failed" = 0 ] && echo 'layers: ok'
exit "$failed"
