#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Fetches the COLMAP of another Debian release, to test against it: apt downloads
# the package and its libraries from the machine's own mirror into a folder, where
# they are unpacked. The script needs no root and installs nothing into the
# system.
#
#   fetch_colmap.sh FOLDER SUITE     SUITE: trixie (COLMAP 3.10, 0.3 GB) or
#                                    sid (COLMAP 4, 0.8 GB)
#
# Prints the program's path, FOLDER/SUITE/colmap; fetches nothing if the program
# exists. Ends with 1 and one line on standard error if it cannot be fetched.
set -euo pipefail
if [ $# -ne 2 ]; then sed -n '3,13s/^# \{0,1\}//p' "$0" >&2; exit 1; fi
mkdir -p "$1"
base=$(cd "$1" && pwd)/$2
suite=$2

die() { echo "COLMAP of Debian $suite: $*" >&2; exit 1; }

write_program() {
  cat > "$base/colmap" <<'PROGRAM'
#!/bin/sh
# Starts the COLMAP beside with the libraries of its own release.
root=$(dirname "$0")/root
for libraries in "$root"/usr/lib/*-linux-gnu; do :; done
for loader in "$root"/lib64/ld-linux-*.so.* "$root"/usr/lib64/ld-linux-*.so.* \
  "$libraries"/ld-linux-*.so.*; do
  [ -e "$loader" ] && break
done
unset LD_LIBRARY_PATH
export QT_QPA_PLATFORM=offscreen
exec "$loader" --library-path \
  "$libraries:$root/lib/${libraries##*/}:$libraries/blas:$libraries/lapack" \
  "$root/usr/bin/colmap" "$@"
PROGRAM
  chmod +x "$base/colmap"
}

if [ ! -x "$base/colmap" ]; then
  # shellcheck disable=SC2016  # apt's own variables
  mirror=$(apt-get indextargets --format '$(SITE)' 'Label: Debian' 2> /dev/null |
    sort -u | head -n 1)
  [ -n "$mirror" ] || die 'this machine has no package lists of Debian'
  keyring=/usr/share/keyrings/debian-archive-keyring.gpg
  [ -f "$keyring" ] || die "$keyring is missing"
  rm -rf "$base"
  mkdir -p "$base"/lists/partial "$base"/cache/archives/partial "$base/root"
  : > "$base/status"
  echo "deb [signed-by=$keyring] $mirror $suite main" > "$base/sources.list"
  options=(-o Dir::Etc::sourcelist="$base/sources.list"
    -o Dir::Etc::sourceparts=/dev/null -o Dir::State="$base"
    -o Dir::State::lists="$base/lists" -o Dir::Cache="$base/cache"
    -o Dir::State::status="$base/status" -o APT::Sandbox::User=
    -o APT::Install-Recommends=false -o APT::Update::Error-Mode=any
    -o Debug::NoLocking=1)
  {
    apt-get "${options[@]}" update &&
      apt-get "${options[@]}" -y -d install colmap
  } > "$base/log" 2>&1 || die "apt cannot download it; see $base/log"
  for package in "$base"/cache/archives/*.deb; do
    dpkg -x "$package" "$base/root" || die "cannot unpack $package"
  done
  rm -rf "$base/cache" "$base/lists"
  write_program
fi
"$base/colmap" help > /dev/null 2>&1 || die "$base/colmap does not start here"
echo "$base/colmap"
