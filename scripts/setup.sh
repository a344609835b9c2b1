#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Sets up everything on Debian 12: installs the packages, builds the host
# COLMAP once into a cache folder, configures and builds the project.
# It may run again at any time: finished steps are not repeated.
#
#   scripts/setup.sh [--for-demo | --for-tests] [--host-only] [--configure-only]
#                    [CMake arguments...]
#
# --for-demo builds only what the adasfm_* commands need: no tests, no benchmarks,
# no program of COLMAP, only the files of its library that are linked; a later
# run without it builds everything else. --for-tests also installs the browser
# for the report's test and the screenshots, a Slurm for the cluster's test, and
# the tools that check the packages and the documentation. --host-only
# stops after the host; --configure-only leaves the project unbuilt.
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
host_source=$cache/apt/sources/colmap-$colmap_version
host_log=$cache/colmap-build.log
# CPU minutes, for the plan; an idle machine needs less.
host_minutes=12 host_part_minutes=6 project_minutes=20 demo_minutes=11

# The packages that every build needs.
demo_packages=(
  # The tools; Python writes the manual pages.
  build-essential cmake ninja-build dpkg-dev python3
  # The host's own dependencies.
  libboost-program-options-dev libboost-filesystem-dev libboost-graph-dev
  libboost-system-dev libboost-test-dev libfreeimage-dev libflann-dev
  liblz4-dev libmetis-dev libgoogle-glog-dev libsqlite3-dev libglew-dev
  libgl1-mesa-dev libeigen3-dev libceres-dev libsuitesparse-dev
  # OpenBLAS is faster than the ATLAS that libceres-dev brings. Its OpenMP build
  # starts threads only on request, which our commands never make, but takes
  # buffers for each core. Its serial build errs if two threads call it at once.
  libopenblas-openmp-dev
  # The project's dependencies.
  libopencv-dev libyaml-cpp-dev nlohmann-json3-dev libzstd-dev
  libgoogle-perftools-dev)
more_packages=(
  ccache clang-format
  # ROS 1 bags, tests and benchmarks.
  librosbag-storage-dev libsensor-msgs-dev libnav-msgs-dev
  libgtest-dev libgmock-dev libbenchmark-dev
  # For the scripts that draw tables and compare models.
  python3-numpy python3-matplotlib sqlite3)
test_packages=(chromium chromium-driver python3-selenium file lintian locales
  python3-h5py clang libclang-rt-14-dev linux-perf ffmpeg
  slurmctld slurmd slurm-client munge)

# The files of COLMAP's library that our program links
# (scripts/checks/check_host_part.sh), and its other libraries.
host_part=(base/{camera,camera_database,camera_models,camera_rig}
  base/{correspondence_graph,database,database_cache,essential_matrix,gps}
  base/homography_matrix
  base/{image,image_reader,point2d,point3d,polynomial,pose,projection}
  base/{reconstruction,similarity_transform,track,triangulation}
  base/visibility_pyramid estimators/{absolute_pose,affine_transform}
  estimators/{essential_matrix,fundamental_matrix,homography_matrix,pose}
  estimators/{triangulation,two_view_geometry,utils}
  feature/{extraction,matching,sift,types,utils}
  optim/{bundle_adjustment,combination_sampler,random_sampler}
  optim/support_measurement retrieval/{geometry,vote_and_verify}
  sfm/incremental_{mapper,triangulator}
  util/{bitmap,camera_specs,logging,math,misc}
  util/{ply,random,string,threading,timer})
host_part_libraries=(PBA/libpba.a SiftGPU/libsift_gpu.a VLFeat/libvlfeat.a)
# Linked by name, but no part of them is used.
host_unused_libraries=(liblsd.a libpoisson_recon.a)

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

# Reads lines `DONE ALL` of numbers, and shows one line of progress with the
# time left; without a terminal, a line at every tenth.
show_progress() {
  local what=$1 start=$SECONDS shown=0 finished all percent rest line
  while read -r finished all; do
    percent=$((100 * finished / all))
    printf -v line '   %s: %3d %%' "$what" "$percent"
    if [ "$percent" -ge 2 ]; then
      rest=$(((SECONDS - start) * (all - finished) / finished))
      printf -v line '%s, %d:%02d left' "$line" $((rest / 60)) $((rest % 60))
    fi
    if [ -t 1 ]; then
      printf '\r%-60s' "$line"
    elif [ $((percent / 10)) -gt "$shown" ]; then
      printf '%s\n' "$line"
    fi
    shown=$((percent / 10))
  done
  if [ -t 1 ]; then printf '\n'; fi
}

# Builds with Ninja in the folder $2: the targets after $3, or all. Appends to the
# log $3 and shows progress under the name $1.
build_with_progress() {
  local what=$1 folder=$2 log=$3
  shift 3
  NINJA_STATUS='[%f %t] ' ninja -C "$folder" -j "$jobs" "$@" 2>&1 |
    tee -a "$log" | sed -unE 's/^\[([0-9]+ [0-9]+)\].*/\1/p' |
    show_progress "$what"
}

find_missing_packages() {
  local package
  missing_packages=()
  for package in "${packages[@]}"; do
    dpkg-query -W -f '${Status}' "$package" 2> /dev/null |
      grep -q 'install ok installed' || missing_packages+=("$package")
  done
}

install_packages() {
  if [ ${#missing_packages[@]} = 0 ]; then return; fi
  say "Installing ${#missing_packages[@]} Debian packages: ${missing_packages[*]}"
  check_root
  local log=$cache/apt.log kind percent
  {
    as_root apt-get -o APT::Update::Error-Mode=any update > "$log" 2>&1 &&
      as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y \
        --no-install-recommends -o APT::Status-Fd=1 "${missing_packages[@]}" \
        2>> "$log" | tee -a "$log" |
        while IFS=: read -r kind _ percent _; do
          # Downloading the packages counts as a quarter of the time.
          case $kind in
            dlstatus) echo "${percent%%.*}" 400 ;;
            pmstatus) echo $((100 + 3 * ${percent%%.*})) 400 ;;
          esac
        done | show_progress packages
  } || {
    tail -n 5 "$log" >&2
    die "installing the packages failed (it needs the network); see $log"
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

configure_host() {
  if [ -f "$host_source/build/build.ninja" ]; then return; fi
  fetch_host_source
  rm -rf "$host_prefix"
  cmake -S "$host_source" -B "$host_source/build" -G Ninja \
    -DCMAKE_BUILD_TYPE=Release -DCMAKE_INSTALL_PREFIX="$host_prefix" \
    -DGUI_ENABLED=OFF -DOPENGL_ENABLED=OFF -DCUDA_ENABLED=OFF \
    -DCGAL_ENABLED=OFF -DTESTS_ENABLED=OFF -DBOOST_STATIC=OFF > "$host_log" 2>&1
}

# Headers, CMake package and the files of the libraries that our program links.
# The build folder stays: build_whole_host continues there, and installs the same
# headers.
build_host_part() {
  local source objects=() lib=$host_prefix/lib/colmap
  for source in "${host_part[@]}"; do
    objects+=("src/CMakeFiles/colmap.dir/$source.cc.o")
  done
  configure_host &&
    build_with_progress COLMAP "$host_source/build" "$host_log" \
      "${objects[@]}" "${host_part_libraries[@]/#/lib/}" &&
    cmake -D CMAKE_INSTALL_LOCAL_ONLY=1 \
      -P "$host_source/build/cmake_install.cmake" >> "$host_log" 2>&1 &&
    mkdir -p "$lib" && cd "$host_source/build" &&
    cp "${host_part_libraries[@]/#/lib/}" "$lib" &&
    rm -f "$lib/libcolmap.a" && ar qcs "$lib/libcolmap.a" "${objects[@]}" &&
    for source in "${host_unused_libraries[@]}"; do ar qcs "$lib/$source"; done
}

build_whole_host() {
  configure_host &&
    build_with_progress COLMAP "$host_source/build" "$host_log" &&
    cmake --install "$host_source/build" >> "$host_log" 2>&1 &&
    rm -rf "$host_source/build"
}

# $1: whole or part.
build_host() {
  say "Building COLMAP $colmap_version ($1) into $host_prefix, once"
  local mark=$host_prefix/.complete
  if [ "$1" = part ]; then mark=$host_prefix/.part; fi
  # In a subshell, so that cd has no effect here. errexit is off before ||, so the
  # functions chain their commands with &&.
  (
    case $1 in
      part) build_host_part ;;
      whole) build_whole_host ;;
    esac
  ) || {
    tail -n 20 "$host_log" >&2
    die "building COLMAP failed; see $host_log"
  }
  touch "$mark"
}

build_project() {
  say "Building the project into $build"
  local options=(-DCMAKE_BUILD_TYPE="${ADASFM_BUILD_TYPE:-Release}"
    -DCOLMAP_DIR="$colmap_dir" -DADASFM_WERROR=ON -DADASFM_UNITY=ON)
  local log=$cache/configure.log targets=()
  if [ "$for_demo" = 1 ]; then
    targets=(adasfm_launcher)
    # A folder that was set up with tests keeps them.
    if [ ! -f "$build/CMakeCache.txt" ]; then
      options+=(-DADASFM_BUILD_TESTS=OFF -DADASFM_BUILD_BENCHMARKS=OFF)
    fi
  else
    options+=(-DADASFM_BUILD_TESTS=ON -DADASFM_BUILD_BENCHMARKS=ON)
  fi
  cmake -S "$root" -B "$build" -G Ninja "${options[@]}" \
    "${cmake_arguments[@]}" > "$log" 2>&1 || {
    tail -n 20 "$log" >&2
    die "configuring failed; see $log"
  }
  if [ "$configure_only" = 1 ]; then return; fi
  log=$cache/build.log
  : > "$log"
  build_with_progress project "$build" "$log" "${targets[@]}" || {
    grep -A 30 -m 1 '^FAILED' "$log" >&2 || tail -n 20 "$log" >&2
    die "building the project failed; see $log"
  }
}

# The CPU minutes above, divided among the cores.
say_plan() {
  local total=0 minutes
  plan() {
    minutes=$1
    total=$((total + minutes))
    printf '   about %2d min  %s\n' "$minutes" "$2"
  }
  say "This will take, on $jobs cores, at most:"
  if [ ${#missing_packages[@]} != 0 ]; then
    plan 2 "${#missing_packages[@]} Debian packages (about 200 MB to download)"
  fi
  case $host in
    part) plan $((host_part_minutes / jobs + 1)) "the part of COLMAP $colmap_version that is needed" ;;
    whole) plan $((host_minutes / jobs + 1)) "COLMAP $colmap_version" ;;
  esac
  if [ "$host_only$configure_only" = 00 ] && [ ! -f "$build/bin/colmap" ]; then
    if [ "$for_demo" = 1 ]; then
      plan $((demo_minutes / jobs + 1)) 'the project'
    else
      plan $((project_minutes / jobs + 1)) 'the project with its tests'
    fi
  fi
  if [ "$total" = 0 ]; then printf '   seconds\n'; fi
}

main() {
  [ -r /etc/debian_version ] || die 'this script knows Debian 12 only; see docs/guide/install.md for other systems'
  mkdir -p "$cache" && [ -w "$cache" ] ||
    die "cannot write to the cache folder $cache; set ADASFM_CACHE to another one"
  local argument for_demo=0 host_only=0 configure_only=0 cmake_arguments=()
  local colmap_dir=$host_prefix/share/colmap host=none missing_packages
  local packages=("${demo_packages[@]}" "${more_packages[@]}")
  for argument in "$@"; do
    case $argument in
      --host-only) host_only=1 ;;
      --for-demo) for_demo=1 packages=("${demo_packages[@]}") ;;
      --for-tests) packages+=("${test_packages[@]}") ;;
      --configure-only) configure_only=1 ;;
      -DCOLMAP_DIR=*) colmap_dir=${argument#*=} ;;
      -*) cmake_arguments+=("$argument") ;;
      *) die "unknown argument: $argument" ;;
    esac
  done
  find_missing_packages
  if [ "$colmap_dir" = "$host_prefix/share/colmap" ] &&
    [ ! -f "$host_prefix/.complete" ]; then
    host=whole
    if [ "$for_demo" = 1 ]; then host=part; fi
    if [ "$host" = part ] && [ -f "$host_prefix/.part" ]; then host=none; fi
  fi
  say_plan
  install_packages
  if [ "$host" != none ]; then build_host "$host"; fi
  if [ "$host_only" = 0 ]; then build_project; fi
}

main "$@"
