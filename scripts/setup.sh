#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Sets up everything on Debian 12: installs the packages, builds the host
# COLMAP once into a cache folder, configures and builds the project.
# Run it again at any time: what is done is not done twice.
#
#   scripts/setup.sh [--host-only] [--for-tests] [--configure-only] [CMake arguments...]
#
# --host-only stops after the host, --for-tests also installs the browser that
# the report's test and the screenshots need, a Slurm for the cluster's test,
# and what the packages and the documentation are checked with;
# --configure-only leaves the project unbuilt.
# Environment: ADASFM_CACHE (default: the user's cache folder) holds the host;
# ADASFM_BUILD_DIR (default: build/); ADASFM_BUILD_TYPE (default: Release).
# With -DCOLMAP_DIR=PREFIX/share/colmap that COLMAP is used instead.
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
cache=${ADASFM_CACHE:-${XDG_CACHE_HOME:-$HOME/.cache}/adasfm}
build=${ADASFM_BUILD_DIR:-$root/build}
jobs=$(nproc)
colmap_version=3.8
host_prefix=$cache/colmap-$colmap_version

packages=(
  # The tools.
  build-essential cmake ninja-build ccache clang-format dpkg-dev
  # The host's own dependencies.
  libboost-program-options-dev libboost-filesystem-dev libboost-graph-dev
  libboost-system-dev libboost-test-dev libfreeimage-dev libflann-dev
  liblz4-dev libmetis-dev libgoogle-glog-dev libsqlite3-dev libglew-dev
  libgl1-mesa-dev libeigen3-dev libceres-dev libsuitesparse-dev
  # Faster than the ATLAS that libceres-dev brings; serial, so that results
  # do not depend on the number of cores.
  libopenblas-serial-dev
  # Ours.
  libopencv-dev libyaml-cpp-dev nlohmann-json3-dev libzstd-dev
  librosbag-storage-dev libsensor-msgs-dev libnav-msgs-dev
  libgtest-dev libgmock-dev libbenchmark-dev
  # For the scripts that draw tables and compare models.
  python3 python3-numpy python3-matplotlib sqlite3)
test_packages=(chromium chromium-driver python3-selenium file lintian
  python3-h5py clang libclang-rt-14-dev linux-perf
  slurmctld slurmd slurm-client munge)

say() { printf '\n== %s\n' "$*"; }
die() { printf 'setup: %s\n' "$*" >&2; exit 1; }

# Runs a command as root: directly, or with sudo.
as_root() {
  if [ "$(id -u)" = 0 ]; then "$@"; else sudo "$@"; fi
}

check_root() {
  [ "$(id -u)" = 0 ] && return
  command -v sudo > /dev/null ||
    die 'installing packages needs root: install sudo, or run this script as root'
  sudo -v || die 'installing packages needs root, and sudo refused; run this script as root'
}

install_packages() {
  local missing=() package
  for package in "${packages[@]}"; do
    dpkg-query -W -f '${Status}' "$package" 2> /dev/null |
      grep -q 'install ok installed' || missing+=("$package")
  done
  if [ ${#missing[@]} = 0 ]; then return; fi
  say "Installing ${#missing[@]} Debian packages (about 2 minutes): ${missing[*]}"
  check_root
  {
    as_root apt-get -o APT::Update::Error-Mode=any update &&
      as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y \
        --no-install-recommends "${missing[@]}"
  } > "$cache/apt.log" 2>&1 || {
    tail -n 5 "$cache/apt.log" >&2
    die "installing the packages failed (it needs the network); see $cache/apt.log"
  }
}

# Writes the machine's own package sources, with source packages switched on,
# into the folder $1. /etc stays as it is.
write_source_list() {
  local parts=$1 file
  mkdir -p "$parts"
  for file in /etc/apt/sources.list /etc/apt/sources.list.d/*.list; do
    [ -f "$file" ] || continue
    sed -nE 's/^[[:space:]]*deb([[:space:]].*)/deb-src\1/p' "$file" \
      > "$parts/$(basename "$file" .list)-src.list"
  done
  for file in /etc/apt/sources.list.d/*.sources; do
    [ -f "$file" ] || continue
    sed -E 's/^Types:.*/Types: deb-src/' "$file" \
      > "$parts/$(basename "$file")"
  done
}

fetch_host_source() {
  local apt=$cache/apt
  mkdir -p "$apt/lists/partial" "$apt/archives/partial" "$apt/sources"
  write_source_list "$apt/parts"
  local options=(-o Dir::Etc::sourcelist=/dev/null
    -o Dir::Etc::sourceparts="$apt/parts" -o Dir::State::lists="$apt/lists"
    -o Dir::Cache="$apt" -o APT::Sandbox::User=)
  local version
  apt-get "${options[@]}" update > "$apt/log" 2>&1 &&
    version=$(apt-cache "${options[@]}" showsrc colmap |
      sed -nE "s/^Version: ($colmap_version-.*)/\1/p" | sort -u | tail -n 1) &&
    (cd "$apt/sources" && rm -rf colmap-* &&
      apt-get "${options[@]}" source --only-source "colmap=$version" \
        >> "$apt/log" 2>&1) || {
    tail -n 5 "$apt/log" >&2
    die "getting the source package of COLMAP $colmap_version failed (it needs the network); see $apt/log"
  }
}

build_host() {
  if [ -f "$host_prefix/.complete" ]; then return; fi
  say "Building the host COLMAP $colmap_version into $host_prefix, once" \
    "(about $((20 / jobs + 1)) minutes on $jobs cores)"
  fetch_host_source
  local source_dir=$cache/apt/sources/colmap-$colmap_version
  local log=$cache/colmap-build.log
  rm -rf "$host_prefix"
  {
    cmake -S "$source_dir" -B "$source_dir/build" -G Ninja \
      -DCMAKE_BUILD_TYPE=Release -DCMAKE_INSTALL_PREFIX="$host_prefix" \
      -DGUI_ENABLED=OFF -DOPENGL_ENABLED=OFF -DCUDA_ENABLED=OFF \
      -DCGAL_ENABLED=OFF -DTESTS_ENABLED=OFF -DBOOST_STATIC=OFF
    cmake --build "$source_dir/build" --parallel "$jobs"
    cmake --install "$source_dir/build"
  } > "$log" 2>&1 || {
    tail -n 20 "$log" >&2
    die "building COLMAP failed; see $log"
  }
  rm -rf "$source_dir/build"
  touch "$host_prefix/.complete"
}

main() {
  [ -r /etc/debian_version ] || die 'this script knows Debian 12 only; see docs/guide/install.md for other systems'
  mkdir -p "$cache" && [ -w "$cache" ] ||
    die "cannot write to the cache folder $cache; set ADASFM_CACHE to another one"
  local host_only=0 configure_only=0 argument cmake_arguments=()
  local colmap_dir=$host_prefix/share/colmap
  for argument in "$@"; do
    case $argument in
      --host-only) host_only=1 ;;
      --for-tests) packages+=("${test_packages[@]}") ;;
      --configure-only) configure_only=1 ;;
      -DCOLMAP_DIR=*) colmap_dir=${argument#*=} ;;
      -*) cmake_arguments+=("$argument") ;;
      *) die "unknown argument: $argument" ;;
    esac
  done
  install_packages
  if [ "$colmap_dir" = "$host_prefix/share/colmap" ]; then build_host; fi
  if [ "$host_only" = 1 ]; then return; fi
  say "Building the project into $build (about $((14 / jobs + 1)) minutes the first time, seconds later)"
  cmake -S "$root" -B "$build" -G Ninja \
    -DCMAKE_BUILD_TYPE="${ADASFM_BUILD_TYPE:-Release}" \
    -DCOLMAP_DIR="$colmap_dir" -DADASFM_WERROR=ON "${cmake_arguments[@]}" > "$cache/configure.log" 2>&1 || {
    tail -n 20 "$cache/configure.log" >&2
    die "configuring failed; see $cache/configure.log"
  }
  if [ "$configure_only" = 1 ]; then return; fi
  cmake --build "$build" --parallel "$jobs" ||
    die 'building the project failed; the messages above say where'
}

main "$@"
