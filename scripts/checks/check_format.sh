#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Fails if a source file is not formatted by clang-format, or lacks its licence
# line. --fix corrects the format.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."

mapfile -t files < <(git ls-files '*.h' '*.cc')
if [ "${1:-}" = --fix ]; then
  clang-format -i "${files[@]}"
  exit
fi
clang-format --dry-run --Werror "${files[@]}"
missing=$(grep -L 'SPDX-License-Identifier: BSD-3-Clause' \
  "${files[@]}" $(git ls-files '*.sh' '*.py' '*.cmake' '*CMakeLists.txt') || true)
if [ -n "$missing" ]; then
  printf 'no SPDX line: %s\n' $missing >&2
  exit 1
fi
echo 'format: ok'
