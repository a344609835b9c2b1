#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""What do errors of the sensors do that no calibration states?

Spoils logs and calibrations of worlds of another generator, runs the three
commands with their defaults and measures the final models. Writes
docs/results/sensor_errors.md. Rows that are done are not run again.
"""

import argparse
import functools
import math
import os
import re
import shutil
import sys

from benchmarking import spoil
from benchmarking.figures import add_arguments, run_table
from verdict_table import Chain

WORLDS = ['world-clean-300', 'world-hard-400', 'world-alias-300',
          'world-kitti10-592']
FILES = ['database.db', 'sensors.yaml', 'imu.csv', 'wheel.csv', 'times.csv',
         'gt.txt']


def imu_figure(folder, name):
  """What the calibration states of the IMU."""
  with open(os.path.join(folder, 'sensors.yaml')) as file:
    text = file.read()
  return float(re.search(r'imu0:.*?\b%s: *(\S+)' % name, text,
                         re.DOTALL).group(1))


def add_noise(folder, factor):
  """Makes the IMU's noise this many times what is stated."""
  added = math.sqrt((factor ** 2 - 1) * imu_figure(folder, 'update_rate'))
  spoil.add_imu_noise(
      folder, added * imu_figure(folder, 'gyroscope_noise_density'),
      added * imu_figure(folder, 'accelerometer_noise_density'))


def thin_imu(folder, rate_hz):
  spoil.keep_every(folder, 'imu.csv',
                   round(imu_figure(folder, 'update_rate') / rate_hz))


ERRORS = {
    'none': None,
    'rates of the gyroscope 1 % too large':
        lambda folder: spoil.scale_rates(folder, 1.01),
    'rates of the gyroscope 3 % too large':
        lambda folder: spoil.scale_rates(folder, 1.03),
    'bias of the gyroscope drifts by 0.001 rad/s':
        lambda folder: spoil.drift_gyroscope(folder, 0.001),
    'bias of the gyroscope drifts by 0.005 rad/s':
        lambda folder: spoil.drift_gyroscope(folder, 0.005),
    'camera 9 ms late':
        lambda folder: spoil.shift_clocks(folder, ['times.csv'], 9),
    'camera 30 ms late':
        lambda folder: spoil.shift_clocks(folder, ['times.csv'], 30),
    'times of the images err by 3 ms (1 sigma)':
        lambda folder: spoil.jitter_times(folder, 'times.csv', 0.003),
    'wheels 50 ms late':
        lambda folder: spoil.shift_clocks(folder, ['wheel.csv'], 50),
    'wheels 5 % too long': lambda folder: spoil.scale_wheels(folder, 1.05),
    'accelerations 2 % too large':
        lambda folder: spoil.scale_accelerations(folder, 1.02),
    'IMU with four times its stated noise': lambda folder: add_noise(folder, 4),
    'IMU thinned to 20 Hz': lambda folder: thin_imu(folder, 20),
}


def run_world(colmap, source, folder, change):
  """{error in m, scale, verdict}, or {failure}."""
  shutil.rmtree(folder, ignore_errors=True)
  os.makedirs(folder)
  for name in FILES:
    shutil.copy(os.path.join(source, name), folder)
  if change:
    change(folder)
  chain = Chain(colmap, folder)
  done = chain.importer({'sensors': ['imu.csv', 'wheel.csv']})
  if done.returncode == 0:
    done = chain.call('global', '--database_path', chain.path('database.db'),
                      '--output_path', chain.path('coarse'))
  if done.returncode != 0:
    return {'failure': done.stderr.strip().splitlines()[-1]}
  done = chain.mapper('coarse', 'sparse', {})
  best = chain.evaluate('sparse/0')['sim3_least_squares']
  return {'rmse_m': best['translation_rmse_m'], 'scale': best['scale'],
          'good': 'Verdict: good' in done.stdout + done.stderr}


def run_row(colmap, args, folder, error):
  worlds = {name: run_world(colmap, os.path.join(args.data_path, name), folder,
                            ERRORS[error]) for name in args.worlds}
  shutil.rmtree(folder)
  return {'error': error, 'worlds': worlds}


def cell(world):
  if 'failure' in world:
    return 'refused'
  return '%.3f%s' % (world['rmse_m'], '' if world['good'] else ' (?)')


def report(records, args):
  lines = ['| error | %s | size off by |' % ' | '.join(args.worlds),
           '|---|%s' % ('---|' * (len(args.worlds) + 1))]
  for record in records:
    worlds = [record['worlds'][name] for name in args.worlds]
    sizes = [abs(world['scale'] - 1.0) for world in worlds if 'scale' in world]
    lines.append('| %s | %s | %s |' % (
        record['error'], ' | '.join(map(cell, worlds)),
        ', '.join('%.2f' % (100.0 * size) for size in sizes) + ' %'
        if sizes else ''))
  return '\n'.join(lines) + '\n'


def main():
  parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
  add_arguments(parser, __file__, 'sensor_errors', 'adasfm-sensor-errors')
  parser.add_argument('--data_path', default='../shared/data',
                      help='folder of the worlds')
  parser.add_argument('--worlds', nargs='+', default=WORLDS)
  args = parser.parse_args()
  colmap = os.path.abspath(args.colmap)
  folder = os.path.join(os.path.abspath(args.output_path), 'world')
  run_table({error: ({'worlds': args.worlds},
                     functools.partial(run_row, colmap, args, folder, error))
             for error in ERRORS}, report, args)
  return 0


if __name__ == '__main__':
  sys.exit(main())
