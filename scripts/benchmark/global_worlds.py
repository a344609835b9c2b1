#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Other worlds and worse sensors: where does the coarse global stage fail?

Makes drives with perceptual aliasing, blackouts and wheel slips, spoils their
logs, calibration or database (clocks, extrinsics, noise, rates, holes, focal
length), runs the importer, `adasfm_global` and `adasfm_mapper` on them, and
writes docs/results/global_worlds.md and the figures behind it
(benchmark/results/global_worlds.json). Needs only Python's standard library.
"""

import argparse
import functools
import json
import os
import shutil

from benchmarking.figures import (add_arguments, measure, run_table,
                                  world_folder)
from benchmarking.process import Failed, run
from benchmarking.spoil import (add_imu_noise, cut_logs, forget_focal_length,
                                keep_every, scale_focal_length, scale_wheels,
                                shift_clocks, shift_gyroscope,
                                turn_camera, turn_wheels)

BOTH = ('imu.csv', 'wheel.csv')
REFINE = {'global': ['--AdaSfmGlobal.ba_refine_focal_length', '1'],
          'mapper': ['--AdaSfmMapper.refine_focal_length', '1']}


def world(synthesizer=None, spoil=None, sensors=BOTH, images=200, **options):
  """One row: options of the synthesizer beyond the plain ones, what is done to
  its output, the logs that are imported, and options by command."""
  options.update(synthesizer=synthesizer or {}, spoil=spoil, sensors=sensors,
                 images=images)
  return options


SHIFT = {'import': ['--AdaSfmPriors.estimate_time_shift', '1']}
WORLDS = {
    'plain': world(),
    'straight road': world({'trajectory': 'straight'}),
    'fisheye': world({'camera_model': 'OPENCV_FISHEYE'}),
    'three neighbours matched': world({'num_neighbors': 3}),
    'two neighbours, 120 keypoints, 40 % outliers': world(
        {'num_neighbors': 2, 'num_keypoints': 120, 'outlier_ratio': 0.4}),
    '10 % look-alikes': world({'alias_ratio': 0.1}),
    '20 % look-alikes': world({'alias_ratio': 0.2}),
    '20 % look-alikes, straight': world(
        {'alias_ratio': 0.2, 'trajectory': 'straight'}),
    'blackouts of 30 images': world({'blackout_images': 30}),
    'one blackout of 60 images': world(
        {'blackout_images': 60, 'num_blackouts': 1}),
    'eight blackouts of 8 images': world(
        {'blackout_images': 8, 'num_blackouts': 8}),
    'eight slips': world({'wheel_slips': 8}),
    'keypoints of 1 px': world({'pixel_noise': 1.0}),
    'keypoints of 2 px': world({'pixel_noise': 2.0}),
    '60 % outliers': world({'outlier_ratio': 0.6}),
    'no standstill': world({'standstill': 0}),
    'gyroscope 2 deg/s off': world(
        spoil=lambda w: shift_gyroscope(w, (0.02, -0.015, 0.03))),
    'IMU noise x 7, not declared': world(
        spoil=lambda w: add_imu_noise(w, 0.05, 0.5)),
    'IMU of 50 Hz': world(spoil=lambda w: keep_every(w, 'imu.csv', 4)),
    'wheels of 10 Hz': world(spoil=lambda w: keep_every(w, 'wheel.csv', 5)),
    'clocks 20 ms apart': world(spoil=lambda w: shift_clocks(w, BOTH, 20)),
    'clocks 50 ms apart, estimated': world(
        spoil=lambda w: shift_clocks(w, BOTH, 50), **SHIFT),
    'wheels 50 ms late': world(
        spoil=lambda w: shift_clocks(w, ('wheel.csv',), 50)),
    'T_imu_wheel 3 deg off': world(spoil=lambda w: turn_wheels(w, 3, 2)),
    'T_cam_imu 1 deg off': world(spoil=lambda w: turn_camera(w, 1)),
    'T_cam_imu 3 deg off': world(spoil=lambda w: turn_camera(w, 3)),
    'wheels 3 % too long': world(spoil=lambda w: scale_wheels(w, 1.03)),
    'focal length 1 % too long': world(
        spoil=lambda w: scale_focal_length(w, 1.01)),
    'focal length 2 % too short': world(
        spoil=lambda w: scale_focal_length(w, 0.98)),
    'focal length 1 % too long, not marked as known': world(
        spoil=lambda w: (scale_focal_length(w, 1.01), forget_focal_length(w))),
    'focal length 2 % too short, refined': world(
        spoil=lambda w: scale_focal_length(w, 0.98), **REFINE),
    'IMU without wheels, no blackout': world(
        {'num_blackouts': 0}, sensors=('imu.csv',)),
    'IMU without wheels': world(sensors=('imu.csv',)),
    'wheels without IMU': world(sensors=('wheel.csv',)),
    'wheels end half-way': world(
        spoil=lambda w: cut_logs(w, ('wheel.csv',), 0.5, 2)),
    'wheels end half-way, no blackout': world(
        {'num_blackouts': 0},
        spoil=lambda w: cut_logs(w, ('wheel.csv',), 0.5, 2)),
    'all logs end half-way': world(spoil=lambda w: cut_logs(w, BOTH, 0.5, 2)),
    'all logs begin half-way': world(
        spoil=lambda w: cut_logs(w, BOTH, -1, 0.5)),
    'all logs end half-way, no blackout': world(
        {'num_blackouts': 0}, spoil=lambda w: cut_logs(w, BOTH, 0.5, 2)),
    'logs with a hole of 3 s': world(
        spoil=lambda w: cut_logs(w, BOTH, 0.5, 0.575)),
    'wheels with a hole of 5 s': world(
        spoil=lambda w: cut_logs(w, ('wheel.csv',), 0.4, 0.525)),
    'images 3.7 m apart': world({'spacing': 3.7, 'num_neighbors': 6}),
    'images 7 m apart': world({'spacing': 7, 'num_neighbors': 4}, images=150),
    'images 0.5 m and 0.8 s apart': world(
        {'spacing': 0.5, 'image_interval': 0.8, 'alias_ratio': 0}),
    'images 3 m and 1 s apart': world(
        {'spacing': 3, 'image_interval': 1, 'num_neighbors': 6}),
}
PLAIN = {'alias_ratio': 0.05, 'num_blackouts': 2, 'wheel_slips': 2}
# A model with a larger error must come with a warning.
MAX_ERROR_M = 0.5


def read_warnings(log_path):
  folder = os.path.dirname(log_path) + os.sep
  with open(log_path, errors='replace') as file:
    return [line.strip().replace(folder, '') for line in file
            if 'WARNING: ' in line]


def run_commands(row, folder, args, record):
  log_path = os.path.join(folder, 'run.log')
  database = os.path.join(folder, 'database.db')
  arguments = [args.colmap, 'adasfm_synthesizer', '--output_path', folder,
               '--num_images', str(row['images']), '--seed',
               str(record['seed'])]
  for name, value in {**PLAIN, **row['synthesizer']}.items():
    arguments += ['--' + name, str(value)]
  run(arguments, log_path)
  if row['spoil']:
    row['spoil'](folder)
  arguments = [args.colmap, 'adasfm_prior_importer', '--database_path',
               database, '--force', '1']
  files = {'image_times': 'times.csv', 'sensors': 'sensors.yaml'}
  files.update({name.split('.')[0]: name for name in row['sensors']})
  for option, file in files.items():
    arguments += ['--%s_path' % option, os.path.join(folder, file)]
  run(arguments + row.get('import', []), log_path)
  coarse = os.path.join(folder, 'global')
  run([args.colmap, 'adasfm_global', '--database_path', database,
       '--output_path', coarse] + row.get('global', []), log_path)
  record['warnings'] = read_warnings(log_path)
  with open(os.path.join(coarse, 'summary.json')) as file:
    summary = json.load(file)
  model = summary['models'][0]
  record['joins_not_made'] = len(summary['segment_closures']['not_made'])
  record['converged'] = model['pairs_agree']
  record['unconfirmed_closures'] = len(model['unconfirmed_closures'])
  record['coarse'] = measure(os.path.join(coarse, '0'), folder, args, log_path)
  if args.run_mapper:
    output = os.path.join(folder, 'model')
    run([args.colmap, 'adasfm_mapper', '--database_path', database,
         '--input_path', os.path.join(coarse, '0'), '--output_path', output] +
        row.get('mapper', []), log_path)
    record['final'] = measure(output, folder, args, log_path)


def run_world(name, seed, args):
  folder = world_folder(name, seed, args)
  shutil.rmtree(folder, ignore_errors=True)
  os.makedirs(folder)
  record = {'world': name, 'seed': seed, 'warnings': []}
  try:
    run_commands(WORLDS[name], folder, args, record)
  except Failed as error:
    record['error'] = str(error)
  if not args.keep:
    shutil.rmtree(folder)
  return record


def cells(figures_of_model):
  if not figures_of_model:
    return ['-', '-', '-']
  return ['%d/%d' % (figures_of_model['images'],
                     figures_of_model['true_images']),
          '%.3f' % figures_of_model['rmse_m'],
          '%.2f' % (100.0 * (figures_of_model['scale'] - 1.0))]


def describe(record):
  """The errors and warnings of the commands about the result, in short."""
  said = []
  if 'error' in record:
    said.append(record['error'])
  if not record.get('converged', True):
    said.append('contradicts vision')
  if record.get('unconfirmed_closures'):
    said.append('unverified joins')
  if record.get('joins_not_made'):
    said.append('joins not made')
  for key, word in (('contradict each other', 'sensors against vision'),
                    ('agree on a focal', 'focal length'),
                    ('vision alone confirms', 'joined by vision alone'),
                    ('camera-IMU rotation is', 'camera-IMU rotation'),
                    ('time offset that differs', 'time shift'),
                    ('did not converge', 'smoother did not converge'),
                    ('gaps of more', 'hole in the log')):
    if any(key in warning for warning in record['warnings']):
      said.append(word)
  return ', '.join(said)


def report(records, args):
  lines = ['Written by `scripts/benchmark/global_worlds.py`; the runs behind it are in '
           '`%s`. Each world is `adasfm_synthesizer %s` with what its '
           'name says. Errors are the RMSE of camera centres after a similarity; '
           'scale is not known without wheels.' % (
               os.path.basename(args.figures_path),
               ' '.join('--%s %s' % item for item in PLAIN.items())), '',
           '| world | seed | images | coarse: m | scale off % |' +
           (' images | final: m | scale off % |' if args.run_mapper else '') +
           ' said against it |',
           '|---|---|---|---|---|' +
           ('---|---|---|' if args.run_mapper else '') + '---|']
  for record in records:
    row = [record['world'], str(record['seed'])] + cells(record.get('coarse'))
    if args.run_mapper:
      row += cells(record.get('final'))
    lines.append('| ' + ' | '.join(row + [describe(record)]) + ' |')
  silent = sum(bool(r.get('coarse')) and r['coarse']['rmse_m'] > MAX_ERROR_M
               and not describe(r) for r in records)
  lines += ['', 'Coarse models that err by more than %.1f m without a word: %d '
            'of %d.' % (MAX_ERROR_M, silent, len(records))]
  return '\n'.join(lines) + '\n'


def parse_arguments():
  parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
  parser.add_argument('worlds', nargs='*',
                      help='rows of the table; all when none is named')
  add_arguments(parser, __file__, 'global_worlds',
                'adasfm-global-worlds')
  parser.add_argument('--seeds', default='1,2')
  parser.add_argument('--run_mapper', type=int, default=1,
                      help='0: coarse models only')
  args = parser.parse_args()
  args.seeds = [int(seed) for seed in args.seeds.split(',')]
  for name in args.worlds:
    if name not in WORLDS:
      parser.error('no such world: %s; there are: %s' %
                   (name, '; '.join(WORLDS)))
  return args


def main():
  args = parse_arguments()
  run_table({'%s %d' % (name, seed):
             ([WORLDS[name]['synthesizer'], args.run_mapper],
              functools.partial(run_world, name, seed, args))
             for name in args.worlds or WORLDS for seed in args.seeds},
            report, args)


if __name__ == '__main__':
  main()
