#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Runs scripts/cluster/adasfm_slurm.sh on this machine and through a real Slurm
# of two nodes on loopback. A node's disk is full, a node is drained, a node is
# lost, and tasks are killed; the models must equal those of the same chain
# without a cluster, byte by byte. Ends with 77 if Slurm cannot be started here:
#   slurm.sh LAUNCHER
set -euo pipefail
launcher=$1
script=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)/scripts/cluster/adasfm_slurm.sh
work=$(mktemp -d /tmp/adasfm-slurm-XXXXXX)
chmod 755 "$work"
hold=$work/hold
daemons=()
mounted=''
PATH=$PATH:/usr/sbin:/sbin

clean() {
  set +e
  [ ${#daemons[@]} = 0 ] || scancel --quiet --user="$(id -un)" 2> /dev/null
  rm -rf "$hold"
  sleep 0.3
  for daemon in "${daemons[@]}"; do kill "$daemon" 2> /dev/null; done
  wait 2> /dev/null
  [ -z "$mounted" ] || umount -l "$mounted"
  rm -rf "$work"
}
trap clean EXIT

fail() { echo "slurm: $*" >&2; exit 1; }
skip() { echo "slurm: skipped, $*"; exit 77; }

# wait_for SECONDS WHAT COMMAND...: waits until the command succeeds.
wait_for() {
  local end=$((SECONDS + $1)) what=$2
  shift 2
  until "$@"; do
    if [ $SECONDS -ge $end ]; then
      "$script" status "$work/photos" 2> /dev/null || true
      "$script" status "$work/drive300" 2> /dev/null || true
      squeue -r 2> /dev/null || true
      tail -n 5 "$work"/*/logs/slurm-* 2> /dev/null || true
      fail "waited in vain until $what"
    fi
    sleep 0.2
  done
}

# expect_error MESSAGE ARGUMENTS...: adasfm_slurm.sh fails with one ERROR line of
# this message; $path, if set, is its PATH.
expect_error() {
  local message=$1
  shift
  if env PATH="${path:-$PATH}" "$script" "$@" > "$work/log" 2>&1; then fail "$* succeeded"; fi
  grep -q "^ERROR: .*$message" "$work/log" ||
    fail "$*: expected '$message', got: $(cat "$work/log")"
  [ "$(wc -l < "$work/log")" = 1 ] || fail "$*: $(cat "$work/log")"
}

# A wrapper of the program that waits while a file in $hold has the name of an
# argument, in place of a long computation. COLMAP's matcher builds random search
# trees and finds other matches in every run, so a block that has been matched
# before gets the earlier matches.
write_program() {
  mkdir -p "$hold" "$work/matched"
  cat > "$work/colmap" << EOF
#!/bin/bash
set -e
for argument in "\$@"; do
  while [ -e "$hold/\$argument" ]; do sleep 0.1; done
done
[ "\$1" = matches_importer ] || exec "$launcher" "\$@"
# matches_importer --database_path FILE --match_list_path FILE ...
kept=$work/matched/\$(cksum < "\$5" | tr ' ' -).db
if [ ! -f "\$kept" ]; then
  "$launcher" "\$@"
  cp "\$3" "\$kept.\$\$"
  mv "\$kept.\$\$" "\$kept"
fi
cp "\$kept" "\$3"
EOF
  chmod +x "$work/colmap"
  export COLMAP=$work/colmap
}

make_worlds() {
  "$launcher" adasfm_synthesizer --output_path "$work/drive" --render 1 \
    --num_images 10 --spacing 1 --image_width 400 --image_height 250
  "$launcher" adasfm_synthesizer --output_path "$work/world" --num_images 300 \
    --num_keypoints 150
} > "$work/log"

check_errors() {
  COLMAP=/nowhere expect_error '/nowhere is no program' \
    local "$work/none" --image_path "$work/drive/images"
  expect_error 'either --image_path or --database_path' local "$work/none"
  expect_error 'nowhere is no folder' local "$work/none" --image_path /nowhere
  expect_error 'has no imu.csv' local "$work/none" \
    --image_path "$work/drive/images" --sensors_path "$work/drive/images"
  expect_error 'threads must be positive' local "$work/none" \
    --image_path "$work/drive/images" --threads 0
  expect_error 'is no workspace' status "$work/none"
  expect_error 'has 0 photos' local "$work/empty" --image_path "$hold"
  expect_error 'cannot copy the database' local "$work/text" \
    --database_path "$work/drive/gt.txt"
  # The failed workspace may begin again with other options.
  expect_error 'cannot copy the database' local "$work/text" \
    --database_path "$work/colmap"
  # Without Slurm.
  mkdir -p "$work/bin"
  ln -sf "$(command -v bash)" "$(command -v dirname)" \
    "$(command -v env)" "$work/bin"
  ln -s "$(python3 -c "import sys; print(sys.executable)")" "$work/bin/python3"
  path=$work/bin expect_error 'sbatch is missing' submit "$work/none" \
    --image_path "$work/drive/images"
}

photo_options() {
  local camera
  camera=$(sed -nE 's/^ *intrinsics: *\[(.*)\]/\1/p' "$work/drive/sensors.yaml" | tr -d ' ')
  options=(--image_path "$work/drive/images" --sensors_path "$work/drive"
    --camera_model PINHOLE --camera_params "$camera" --threads 1
    --images_per_block 4 --pairs_per_block 15)
}

# The reference models on this machine: photos with `local`, where one task is
# killed, and the database with the commands themselves.
run_references() {
  local sensors=$work/world pid
  photo_options
  touch "$hold/matches_importer"
  "$script" local "$work/photos-local" "${options[@]}" --retries 0 \
    --scratch_path "$work/scratch-local" > "$work/log-local" 2>&1 &
  pid=$!
  wait_for 200 'a matching task runs' grep -qs running \
    "$work/photos-local/state/matches/00000.json"
  kill -9 $(pgrep -f "task $work/photos-local matches 0")
  rm "$hold/matches_importer"
  if wait "$pid"; then fail 'a killed task went unnoticed'; fi
  grep -q 'ERROR: matches failed; the same command continues' "$work/log-local" ||
    fail "$(cat "$work/log-local")"
  "$script" local "$work/photos-local" > "$work/log-local"
  grep -q '^Finished' "$work/log-local" || fail "$(cat "$work/log-local")"
  expect_error 'was begun with --max_num_features 2048' \
    local "$work/photos-local" --max_num_features 100
  # Finished items were not made again.
  [ "$(grep -c '^\$ .*feature_extractor' "$work"/photos-local/logs/features-00000.log)" = 1 ] ||
    fail 'features were extracted twice'

  mkdir "$work/plain"
  cp "$sensors/database.db" "$work/plain"
  {
    "$launcher" adasfm_prior_importer --database_path "$work/plain/database.db" \
      --image_times_path "$sensors/times.csv" --imu_path "$sensors/imu.csv" \
      --wheel_path "$sensors/wheel.csv" --sensors_path "$sensors/sensors.yaml"
    "$launcher" adasfm_global --database_path "$work/plain/database.db" \
      --output_path "$work/plain/global" --AdaSfmGlobal.num_threads 1
    "$launcher" adasfm_mapper --database_path "$work/plain/database.db" \
      --input_path "$work/plain/global/0" --output_path "$work/plain/sparse" \
      --num_threads 1 "${mapper_options[@]}"
  } > "$work/log-plain" 2>&1 || fail "$(tail -n 3 "$work/log-plain")"
}

free_ports() {
  python3 -c 'import socket
sockets = [socket.socket() for _ in range(3)]
for s in sockets: s.bind(("127.0.0.1", 0))
print(*(s.getsockname()[1] for s in sockets))'
}

# A controller, two nodes of one core each, and munge, all of this user. The
# second node's disk has no room.
start_slurm() {
  local program slurm=$work/slurm ports node
  for program in munged slurmctld slurmd sbatch; do
    command -v "$program" > /dev/null ||
      skip "$program is missing (scripts/setup.sh --for-tests installs it)"
  done
  read -r -a ports <<< "$(free_ports)"
  mkdir -p "$slurm"/{state,spool-one,spool-two,munge} "$work"/scratch-{one,two}
  head -c 1024 /dev/urandom > "$slurm/munge/key"
  chmod 600 "$slurm/munge/key"
  cat > "$slurm/slurm.conf" << EOF
ClusterName=adasfm
SlurmctldHost=localhost(127.0.0.1)
SlurmctldPort=${ports[0]}
SlurmUser=$(id -un)
SlurmdUser=$(id -un)
AuthType=auth/munge
AuthInfo=socket=$slurm/munge/socket,cred_expire=5
CredType=cred/munge
StateSaveLocation=$slurm/state
SlurmdSpoolDir=$slurm/spool-%n
SlurmctldPidFile=$slurm/slurmctld.pid
SlurmdPidFile=$slurm/slurmd-%n.pid
SlurmctldLogFile=$slurm/slurmctld.log
SlurmdLogFile=$slurm/slurmd-%n.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SwitchType=switch/none
MpiDefault=none
ReturnToService=2
SchedulerType=sched/backfill
SchedulerParameters=sched_interval=1,bf_interval=1
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU_Memory
KillWait=1
MinJobAge=3600
MessageTimeout=30
AccountingStorageType=accounting_storage/none
NodeName=one NodeHostname=localhost NodeAddr=127.0.0.1 Port=${ports[1]} CPUs=1 RealMemory=8000
NodeName=two NodeHostname=localhost NodeAddr=127.0.0.1 Port=${ports[2]} CPUs=1 RealMemory=8000
PartitionName=all Nodes=one,two Default=YES State=UP
EOF
  export SLURM_CONF=$slurm/slurm.conf
  munged --force --foreground --socket="$slurm/munge/socket" \
    --key-file="$slurm/munge/key" --pid-file="$slurm/munge/pid" \
    --log-file="$slurm/munge/log" --seed-file="$slurm/munge/seed" \
    --num-threads=2 > "$slurm/munged.out" 2>&1 &
  daemons+=($!)
  wait_for 10 'munge answers' test -S "$slurm/munge/socket"
  slurmctld -D -c > "$slurm/slurmctld.out" 2>&1 &
  daemons+=($!)
  for node in one two; do
    slurmd -D -c -N "$node" > "$slurm/slurmd-$node.out" 2>&1 &
    daemons+=($!)
  done
  for ((i = 0; i < 100; ++i)); do
    [ "$(sinfo -h -t idle -o %D 2> /dev/null)" = 2 ] && break
    sleep 0.2
  done
  [ "$(sinfo -h -t idle -o %D 2> /dev/null)" = 2 ] ||
    skip "Slurm does not start here: $(tail -n 1 "$slurm/slurmctld.log" 2>&1)"
  if mount -t tmpfs -o size=64k tmpfs "$work/scratch-two" 2> /dev/null; then
    mounted=$work/scratch-two
  else
    chmod 500 "$work/scratch-two"
  fi
}

# running WORKSPACE STAGE COUNT: at least COUNT tasks of the stage run.
running() {
  local job
  job=$(python3 -c 'import json, sys
print(json.load(open(sys.argv[1])).get(sys.argv[2], 0))' "$1/jobs.json" "$2")
  [ "$(squeue -h -r -t RUNNING -o %F | grep -c "^$job\$")" -ge "$3" ]
}
# says WORKSPACE PATTERN: the workspace's status table matches.
says() {
  "$script" status "$1" > "$work/table"
  grep -q "${@:2}" "$work/table"
}
# Number of commands in the logs of a stage's items.
num_runs() { cat "$1/logs/$2"-*.log | grep -c "^\\$ "; }
same_model() {
  local file
  for file in cameras images points3D; do
    cmp "$1/sparse/0/$file.bin" "$2/sparse/0/$file.bin" ||
      fail "the model of $2 is another one"
  done
}

# Photos: the second node has a full disk and is drained later; a matching task is
# cancelled, and the chain is submitted again.
check_photos() {
  local job
  photo_options
  touch "$hold/matches_importer"
  "$script" submit "$work/photos" "${options[@]}" \
    --scratch_path "$work/scratch-\$SLURMD_NODENAME" > "$work/log"
  grep -q 'Queued: features' "$work/log" || fail "$(cat "$work/log")"
  wait_for 200 'two matching tasks run' running "$work/photos" matches 2
  expect_error 'are running' submit "$work/photos"
  scontrol update NodeName=two State=DRAIN Reason=test
  job=$(squeue -h -r -t RUNNING -n adasfm-matches -o %i | head -n 1)
  scancel "$job"
  rm "$hold/matches_importer"
  wait_for 200 'the rest has stopped' says "$work/photos" '^Stopped'
  scontrol update NodeName=two State=RESUME
  "$script" submit "$work/photos" > "$work/log"
  if grep -q features "$work/log"; then fail 'what is done is queued again'; fi
  wait_for 200 'the photos are done' says "$work/photos" '^Finished'
  "$script" submit "$work/photos" > "$work/log"
  grep -q 'Nothing is left to do' "$work/log" ||
    fail 'submits what is finished'
  same_model "$work/photos-local" "$work/photos"
  grep -q 'No space left\|disk is full\|Permission denied' \
    "$work"/photos/logs/slurm-* || fail 'the full disk was not met'
  [ "$(num_runs "$work/photos" pairs)" = 1 ] || fail 'pairs were chosen twice'
}

# A database of 300 images: while the parts run, a task's process is killed and
# a node is lost; Slurm and the script send the tasks back to the queue.
check_database() {
  local victim
  touch "$hold/part"
  "$script" submit "$work/drive300" --database_path "$work/world/database.db" \
    --sensors_path "$work/world" --threads 1 \
    --mapper_options "${mapper_options[*]}" \
    --scratch_path "$work/scratch-one" > "$work/log"
  wait_for 200 'two parts run' running "$work/drive300" parts 2
  wait_for 200 'both have begun' sh -c \
    "[ \$(grep -ls running '$work'/drive300/state/parts/*.json | wc -l) = 2 ]"
  victim=$(squeue -h -r -t RUNNING -n adasfm-parts -w one -o %K)
  kill -9 "$(pgrep -f "task $work/drive300 parts $victim ")"
  scontrol update NodeName=two State=DOWN Reason=test
  wait_for 200 'both went back to the queue' sh -c \
    "[ \"\$(scontrol -o show job | grep 'JobName=adasfm-parts' | grep -c 'Restarts=1')\" -ge 2 ]"
  # The node may have come back by itself.
  scontrol update NodeName=two State=RESUME 2> /dev/null || true
  rm "$hold/part"
  wait_for 200 'the drive is done' says "$work/drive300" '^Finished'
  same_model "$work/plain" "$work/drive300"
  grep -q 'AdaSfmMapper.max_memory_gb' "$work"/drive300/logs/merge-*.log ||
    fail 'the merge does not know what memory it has'
  grep -q 'AdaSfmGlobal.max_memory_gb' "$work"/drive300/logs/global*.log ||
    fail 'the global stage does not know what memory it has'
  [ "$(num_runs "$work/drive300" global)" = 1 ] || fail 'the global stage ran twice'
  says "$work/drive300" -E '^parts +[0-9]+ +[0-9]+ +[0-9]+ ' ||
    fail 'the table has no parts'
}

mapper_options=(--AdaSfmPartition.max_part_size 60
  --AdaSfmPartition.max_num_images_undivided 60)
write_program
make_worlds
check_errors
run_references
start_slurm
check_photos
check_database
echo 'slurm: ok'
