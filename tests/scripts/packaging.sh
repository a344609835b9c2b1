#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Installs the build into a temporary folder and uses it as other projects would,
# then makes the Debian packages and checks their contents:
#   packaging.sh BUILD_DIR COLMAP_DIR
set -euo pipefail
build=$1
colmap_dir=$2
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

fail() { echo "packaging: $*" >&2; exit 1; }

echo '== cmake --install'
cmake --install "$build" --prefix "$work/root" > /dev/null
for file in bin/colmap-adasfm lib/adasfm/bin/colmap \
  share/man/man1/colmap-adasfm.1.gz include/adasfm/core/rigid3d.h \
  include/adasfm/colmap_ext/adasfm_pipeline.h lib/libadasfm_core.a \
  lib/cmake/adasfm/adasfm-config.cmake share/doc/colmap-adasfm/README.md \
  share/doc/colmap-adasfm/docs/reference/math.md share/doc/colmap-adasfm/copyright \
  share/bash-completion/completions/colmap-adasfm; do
  [ -e "$work/root/$file" ] || fail "$file is not installed"
done
if grep -rlE "$build|${colmap_dir%/share/colmap}" "$work/root/lib/cmake"; then
  fail 'the files above hold paths of the machine that built them'
fi
program=$work/root/bin/colmap-adasfm
commands=$("$program" help 2> /dev/null | sed -nE 's/^  (adasfm_\w+) .*/\1/p')
[ -n "$commands" ] || fail 'the installed program lists no commands'
[ "$("$work/root/lib/adasfm/bin/colmap" adasfm_mapper -h)" = \
  "$("$program" adasfm_mapper -h)" ] || fail 'the launcher is another program'

echo '== manual page and completion against the help'
zcat "$work/root/share/man/man1/colmap-adasfm.1.gz" | sed 's/\\-/-/g' \
  > "$work/page"
# shellcheck disable=SC1091
source "$work/root/share/bash-completion/completions/colmap-adasfm"
# complete_words WORDS...: the completions of the last word.
complete_words() {
  COMP_WORDS=("$@")
  COMP_CWORD=$(($# - 1))
  _colmap_adasfm
  printf '%s\n' "${COMPREPLY[@]}"
}
complete_words "$program" '' > "$work/offered"
for command in $commands; do
  grep -qx "$command" "$work/offered" || fail "$command is not completed"
  grep -qx ".SS $command" "$work/page" || fail "$command has no manual"
done
for command in $commands; do
  options=$("$program" "$command" -h | grep -oE '^  (-h \[ )?--[A-Za-z0-9_.]+' |
    grep -oE -- '--.*')
  [ "$(wc -l <<< "$options")" -ge 4 ] || fail "$command has no options"
  complete_words "$program" "$command" -- > "$work/offered"
  sed -n "/^\.SS $command$/,/^\.S[SH] /p" "$work/page" > "$work/section"
  zcat "$work/root/share/man/man1/$command.1.gz" | sed 's/\\-/-/g' > "$work/own-page"
  for option in $options; do
    grep -qxe "$option" "$work/offered" || fail "$command $option is not completed"
    grep -qFe "\\fB$option\\fR" "$work/section" ||
      fail "$command $option is not in the manual"
    grep -qFe "\\fB$option\\fR" "$work/own-page" ||
      fail "$command $option is not in its own manual page"
  done
done

echo '== find_package(adasfm)'
cmake -S "$here/consumer" -B "$work/consumer" \
  -DCMAKE_PREFIX_PATH="$work/root" -DCOLMAP_DIR="$colmap_dir" \
  -DCMAKE_BUILD_TYPE=Release > "$work/log" 2>&1 ||
  { tail -n 20 "$work/log" >&2; fail 'the consumer is not configured'; }
cmake --build "$work/consumer" > "$work/log" 2>&1 ||
  { tail -n 20 "$work/log" >&2; fail 'the consumer is not built'; }
"$work/consumer/consumer" > /dev/null || fail 'the consumer fails'

echo '== Debian packages'
(cd "$build" && cpack -G DEB -B "$work/packages") > "$work/log" 2>&1 ||
  { tail -n 20 "$work/log" >&2; fail 'cpack fails'; }
runtime=$(echo "$work"/packages/colmap-adasfm_*.deb)
dev=$(echo "$work"/packages/libadasfm-dev_*.deb)
dpkg-deb -c "$runtime" > "$work/contents"
dpkg-deb -c "$dev" > "$work/dev-contents"
for file in usr/bin/colmap-adasfm usr/lib/adasfm/bin/colmap \
  usr/share/man/man1/colmap-adasfm.1.gz usr/share/doc/colmap-adasfm/copyright \
  usr/share/doc/colmap-adasfm/changelog.gz; do
  grep -qE " \./$file( |$)" "$work/contents" || fail "$runtime lacks $file"
done
# Debian's package colmap owns these names and folders.
if grep -E ' \./usr/(bin/colmap|share/(doc/colmap|applications/.*|man/man1/colmap\.1\.gz))$' \
  "$work/contents" "$work/dev-contents"; then
  fail 'the files above belong to the package colmap'
fi
if grep -E '\.a$|/include/' "$work/contents"; then
  fail 'the files above belong to the package libadasfm-dev'
fi
grep -q ' ./usr/lib/libadasfm_core.a' "$work/dev-contents" ||
  fail "$dev lacks the libraries"
if command -v lintian > /dev/null; then
  # --allow-root is for containers.
  lintian --allow-root --fail-on error,warning "$runtime" "$dev" ||
    fail 'lintian finds the faults above'
else
  echo 'lintian is not installed, and was left out'
fi

echo '== beside the package colmap'
# dpkg needs root. It installs into a folder, after a stand-in package with the
# paths of Debian's colmap.
if [ "$(id -u)" = 0 ]; then
  for file in bin/colmap share/doc/colmap/copyright share/man/man1/colmap.1.gz \
    share/applications/colmap.desktop; do
    mkdir -p "$work/stub/usr/$(dirname "$file")"
    echo colmap > "$work/stub/usr/$file"
  done
  mkdir -p "$work/stub/DEBIAN" "$work/system/var/lib/dpkg"/{info,updates,triggers}
  printf '%s\n' 'Package: colmap' 'Version: 3.8-1' 'Architecture: all' \
    'Maintainer: nobody <nobody@adasfm.invalid>' 'Description: stand-in' \
    > "$work/stub/DEBIAN/control"
  dpkg-deb -b "$work/stub" "$work/colmap.deb" > /dev/null
  touch "$work/system/var/lib/dpkg/status"
  dpkg_here() {
    dpkg --root="$work/system" --force-depends --force-script-chrootless \
      --no-triggers "$@" > "$work/log" 2>&1 ||
      { tail -n 20 "$work/log" >&2; fail "dpkg $* fails"; }
  }
  dpkg_here -i "$work/colmap.deb"
  dpkg_here -i "$runtime" "$dev"
  [ -x "$work/system/usr/bin/colmap-adasfm" ] || fail 'the program is not installed'
  dpkg_here -r colmap-adasfm libadasfm-dev
  [ ! -e "$work/system/usr/bin/colmap-adasfm" ] || fail 'the program is not removed'
  dpkg_here -V colmap
  [ "$(cat "$work/system/usr/bin/colmap")" = colmap ] || fail 'colmap was replaced'
else
  echo 'not root: dpkg was left out'
fi
# A file, since grep -q on a pipe ends at the first match and so kills the writer
# by SIGPIPE.
dpkg-deb -f "$runtime" Depends > "$work/depends"
grep -q 'libopencv-core' "$work/depends" ||
  fail 'the dependencies of the program are missing'
dpkg -x "$runtime" "$work/deb"
"$work/deb/usr/bin/colmap-adasfm" adasfm_mapper -h > "$work/help" &&
  grep -q 'Options:' "$work/help" ||
  fail 'the packaged program does not run'
# If the COLMAP that it was built with is missing, the program uses the colmap on
# the PATH, but never itself.
python3 - "$work/deb/usr/bin/colmap-adasfm" "${colmap_dir%/share/colmap}/bin/colmap" << 'PYTHON'
import pathlib, sys
program, host = pathlib.Path(sys.argv[1]), sys.argv[2].encode()
data = program.read_bytes()
assert host in data
program.write_bytes(data.replace(host, b'/nowhere'.ljust(len(host), b'x')))
PYTHON
mkdir "$work/host"
printf '#!/bin/sh\necho "host $*"\n' > "$work/host/colmap"
chmod +x "$work/host/colmap"
[ "$(PATH="$work/deb/usr/lib/adasfm/bin:$work/host:$PATH" colmap mapper x)" = \
  'host mapper x' ] || fail 'the packaged program does not find the host'
if PATH="$work/deb/usr/lib/adasfm/bin:/usr/sbin:/sbin" ADASFM_HOST_COLMAP='' \
  "$work/deb/usr/bin/colmap-adasfm" mapper 2> "$work/log"; then
  fail 'without a host the program should fail'
fi
grep -q ADASFM_HOST_COLMAP "$work/log" || fail 'nothing says that the host is missing'
echo 'packaging: ok'
