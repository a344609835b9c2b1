#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Recordings of phones and handheld cameras, beside COLMAP's mappers.

Runs `adasfm_automatic_reconstructor` on each recording with its IMU and
without, from an initial time offset of 0, and COLMAP's mappers on the database
of the first run with the geometries as COLMAP verified them
(`adasfm_restorer`). Writes docs/results/handheld.md. The user provides clones
with the recordings (benchmarking/handheld.py). Needs only Python's standard
library.
"""

import argparse
import functools
import json
import os
import shutil
import sys

from benchmarking.figures import add_arguments, run_table
from benchmarking.handheld import RECORDINGS, prepare
from benchmarking.methods import log_options
from benchmarking.process import run
from photo_tables import attempt, outcome, peers_of, run_peer


def read_json(path):
  with open(path) as file:
    return json.load(file)


def knows_camera(source):
  with open(os.path.join(source, 'sensors.yaml')) as file:
    return 'intrinsics' in file.read()


def run_ours(source, folder, use_imu, args):
  log_path = folder + '.log'
  logs = ['image_times', 'imu', 'sensors'] if use_imu else (
      ['sensors'] if knows_camera(source) else [])
  usage = run([args.colmap, 'adasfm_automatic_reconstructor', '--image_path',
               os.path.join(source, 'images'), '--workspace_path', folder,
               *log_options(source, logs)], log_path)
  result = outcome(os.path.join(folder, 'sparse'), source, usage, args,
                   log_path)
  result['verdict'] = read_json(os.path.join(folder, 'sparse',
                                             'summary.json'))['verdict']
  if use_imu:
    priors = read_json(os.path.join(folder, 'database.db.priors.json'))
    result['priors'] = {name: priors[name] for name in (
        'timeshift_cam_imu_s', 'rotation_turning_deg', 'rotation_residual_deg',
        'rotation_visual_error_deg')}
  return result


def run_recording(name, args):
  top = os.path.join(args.output_path, name.replace(' ', '_'))
  shutil.rmtree(top, ignore_errors=True)
  source = os.path.join(top, 'source')
  record = {'set': name, 'photos': prepare(name, args.recordings_path, source),
            'methods': {}}
  methods = record['methods']
  workspace = os.path.join(top, 'with-imu')
  methods['one command, IMU'] = attempt(
      lambda: run_ours(source, workspace, True, args))
  methods['one command, photos alone'] = attempt(
      lambda: run_ours(source, os.path.join(top, 'without'), False, args))
  for i, (heading, (command, executable)) in enumerate(peers_of(args).items()):
    methods[heading] = attempt(lambda: run_peer(
        source, knows_camera(source), command, executable, workspace,
        os.path.join(top, 'peer-%d' % i), args))
  if not args.keep:
    shutil.rmtree(top)
  return record


def row(record, method, result):
  if 'error' in result or not result['images']:
    return '| %s | %s | no model%s | | | | | | |' % (
        record['set'], method,
        ': ' + result['error'] if 'error' in result else '')
  clock = differ = agree = verdict = ''
  if 'verdict' in result:
    verdict = result['verdict']['result']
    shares = [prior['share_contradicting']
              for prior in result['verdict'].get('priors', ())
              if prior['kind'] == 'rotation']
    agree = '%.0f %%' % (100 * (1 - shares[0])) if shares else ''
  if 'priors' in result:
    priors = result['priors']
    clock = '%.1f ms' % (1e3 * priors['timeshift_cam_imu_s'])
    differ = '%.3f of %.2f' % (priors['rotation_residual_deg'],
                               priors['rotation_turning_deg'])
  return '| %s | %s | %s of %d | %s | %s | %s | %s | %s | %.0f |' % (
      record['set'], method, ' + '.join(map(str, result['images'])),
      record['photos'], '{:,}'.format(result['points']), clock, differ, agree,
      verdict, result['cpu_s'])


def report(records, args):
  del args
  lines = ['| recording | method | images, each model | points of the largest '
           '| clock | gyroscope and pictures differ, deg a photo | rotations '
           'agree | verdict | CPU s |',
           '|---|---|---|---:|---:|---:|---:|---|---:|']
  lines += [row(record, method, result) for record in records
            for method, result in record['methods'].items()]
  return '\n'.join(lines) + '\n'


def parse_arguments():
  parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
  add_arguments(parser, __file__, 'handheld', 'adasfm-handheld')
  parser.set_defaults(timeout=None)
  parser.add_argument('--recordings_path', default='recordings',
                      help='folder of the clones: edge-slam-rgb-imu, '
                      'DM-VIO-dataset')
  parser.add_argument('--colmap4', default='',
                      help="COLMAP 4's program; without it it is left out")
  args = parser.parse_args()
  args.there = [name for name, folder in RECORDINGS.items()
                if os.path.isdir(os.path.join(args.recordings_path, folder))]
  for name in RECORDINGS:
    if name not in args.there:
      print('left out %s: not in %s' % (name, args.recordings_path),
            file=sys.stderr)
  if not args.there:
    parser.exit(0, 'no recordings: no table\n')
  return args


def main():
  args = parse_arguments()
  run_table({name: (list(peers_of(args)),
                    functools.partial(run_recording, name, args))
             for name in args.there}, report, args)


if __name__ == '__main__':
  sys.exit(main())
