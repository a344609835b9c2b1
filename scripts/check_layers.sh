#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Fails when a layer includes what it may not know (README, "Layers"): the pure
# layers see core/ and themselves, and only colmap_ext/ sees COLMAP.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

# COLMAP 3.8's unprefixed include folders, and prefixed ones of newer versions.
host='(base|controllers|estimators|exe|feature|mvs|optim|retrieval|sfm|tools|ui|util|colmap)/'
layers='core sensors global partition synthetic colmap_ext'
failed=0

# forbid LAYER REGEX REASON
forbid() {
  local hits
  hits=$(grep -rnE "^[[:space:]]*#[[:space:]]*include[[:space:]]*[<\"]$2" "$1" \
    --include='*.h' --include='*.cc' || true)
  if [ -n "$hits" ]; then
    printf '%s: %s\n%s\n' "$1" "$3" "$hits" >&2
    failed=1
  fi
}

for layer in core sensors global partition synthetic; do
  forbid "$layer" "$host" 'a pure layer must not include COLMAP'
  for other in $layers; do
    case $other in core | "$layer") continue ;; esac
    forbid "$layer" "$other/" "must not include $other/"
  done
  forbid "$layer" 'tests/' 'must not include tests/'
done
forbid colmap_ext 'tests/' 'must not include tests/'

[ "$failed" = 0 ] && echo 'layers: ok'
exit "$failed"
