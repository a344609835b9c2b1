#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Do priors ever make the model worse, and is their chi-square consistent?

Forty worlds have sensor errors as real drives do: a standstill with small
motion, wheels that differ by 0.4 %, stated noise wrong by a factor of three up
or down. For each world the table has the final error with the priors in the
adjustment and without them, the limit (the same final refinement from the true
poses, with and without the priors), the chi-square of the priors and the
keypoint sigma. Writes docs/results/estimator_seeds.md. Rows that are done are
not run again. Needs only Python's standard library.
"""

import argparse
import functools
import json
import math
import os
import re
import shutil
import sys

from benchmarking.figures import add_arguments, run_table
from benchmarking.limit import write_true_poses
from benchmarking.spoil import edit_calibration, edit_rows
from verdict_table import Chain

KINDS = {
    'clean': {},
    'aliased': {'alias_ratio': 0.05, 'wheel_slips': 2},
    'blackout': {'num_blackouts': 1, 'wheel_slips': 2},
    'sparse': {'num_neighbors': 3, 'num_keypoints': 150},
    'fisheye': {'camera_model': 'OPENCV_FISHEYE'},
}
SIZES = [200, 250, 300, 200, 250, 300, 400, 500]
WITHOUT = {'mapper': ['--AdaSfmMapper.use_priors_in_adjustment', '0']}
# Largest error with priors, as a ratio to the error without priors and to the
# limit with the same priors.
MAX_OF_WITHOUT = 1.02
MAX_OF_LIMIT = 1.1
CHI2_RANGE = (0.8, 1.25)


def ring(folder):
  """Adds to the gyroscope's z axis, in the first 3 s, a rate of 0.5 mrad/s and
  a decaying oscillation of 3 Hz."""
  def change(rows):
    begin = int(rows[0][0])
    for row in rows:
      t = (int(row[0]) - begin) * 1e-9
      if t < 3.0:
        rate = 5e-4 + 2e-3 * math.exp(-t) * math.cos(6.0 * math.pi * t)
        row[3] = '%.9g' % (float(row[3]) + rate)
    return rows
  edit_rows(folder, 'imu.csv', change)


def part_wheels(folder):
  edit_rows(folder, 'wheel.csv', lambda rows: [
      [row[0], '%.6f' % (1.002 * float(row[1])),
       '%.6f' % (0.998 * float(row[2]))] + row[3:] for row in rows])


def scale_noise_figures(folder, factor):
  edit_calibration(folder, lambda text: re.sub(
      r'((?:gyroscope|accelerometer)_(?:noise_density|random_walk)): (\S+)',
      lambda match: '%s: %g' % (match.group(1),
                                factor * float(match.group(2))), text))


def summary_of(chain, output):
  with open(chain.path(output + '/summary.json')) as file:
    return json.load(file)


def shape_error_m(chain, model):
  return chain.evaluate(model)['sim3_least_squares']['translation_rmse_m']


def run_world(colmap, folder, kind, seed):
  shutil.rmtree(folder, ignore_errors=True)
  chain = Chain(colmap, folder)
  arguments = dict(KINDS[kind], num_images=SIZES[(seed - 1) % len(SIZES)],
                   seed=seed)
  chain.call('synthesizer', '--output_path', folder,
             *(word for name, value in arguments.items()
               for word in ('--' + name, str(value))))
  ring(folder)
  part_wheels(folder)
  scale_noise_figures(folder, 3.0 if seed % 2 else 1.0 / 3.0)
  chain.importer({'sensors': ['imu.csv', 'wheel.csv']})
  chain.call('global', '--database_path', chain.path('database.db'),
             '--output_path', chain.path('g'))
  write_true_poses(chain.path('database.db'), chain.path('gt.txt'),
                   chain.path('truth'), matched_only=False)
  record = {'kind': kind, 'seed': seed, 'num_images': arguments['num_images']}
  for name, source, options in (('with', 'g/0', {}), ('without', 'g/0', WITHOUT),
                                ('limit', 'truth', {}),
                                ('limit_without', 'truth', WITHOUT)):
    done = chain.mapper(source, name, options)
    if done.returncode != 0:
      record['error'] = done.stderr.strip().splitlines()[-1]
      return record
    record[name] = shape_error_m(chain, name)
  summary = summary_of(chain, 'with')
  record['coarse'] = shape_error_m(chain, 'g/0')
  record['images'] = summary['num_images']
  record['keypoint_sigma_px'] = summary['keypoint_sigma_px']
  record['chi2'] = summary['prior_chi2_per_dof']
  shutil.rmtree(folder)
  return record


def cells(record):
  if 'error' in record:
    return [record['error']] + 9 * ['']
  figures = [record[key] for key in ('coarse', 'with', 'without', 'limit',
                                     'limit_without')]
  figures += [record['with'] / record['without'],
              record['with'] / record['limit']]
  return (['%d/%d' % (record['images'], record['num_images'])] +
          ['%.3f' % figure for figure in figures] +
          ['%.2f' % record['chi2'], '%.3f' % record['keypoint_sigma_px']])


def report(records, args):
  lines = [
      'Written by `scripts/benchmark/estimator_seeds.py --kinds %s --seeds %s`. '
      'Errors are the RMSE of camera centres after a similarity [m]: of the '
      'coarse model, of the final one with the priors in its adjustment and '
      'without, and of the same refinement from the true poses. Odd seeds state '
      'the noise of the IMU three times too large, even ones three times too '
      'small.' % (
          ' '.join(args.kinds), ' '.join(map(str, args.seeds))), '',
      '| world | images | coarse | with | without | limit | limit without | '
      'with / without | with / limit | chi-square | keypoint sigma [px] |',
      '|---|---|---|---|---|---|---|---|---|---|---|']
  lines += ['| %s %d | %s |' % (record['kind'], record['seed'],
                                ' | '.join(cells(record)))
            for record in records]
  done = [record for record in records if 'error' not in record]
  def count(test):
    return '%d of %d' % (sum(map(test, done)), len(records))
  lines += ['', 'With priors at most %g of the error without: %s; at most %g of '
            'the limit with them: %s; chi-square within %g to %g: %s.' % (
                MAX_OF_WITHOUT,
                count(lambda r: r['with'] <= MAX_OF_WITHOUT * r['without']),
                MAX_OF_LIMIT,
                count(lambda r: r['with'] <= MAX_OF_LIMIT * r['limit']),
                *CHI2_RANGE,
                count(lambda r: CHI2_RANGE[0] <= r['chi2'] <= CHI2_RANGE[1]))]
  return '\n'.join(lines) + '\n'


def main():
  parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
  add_arguments(parser, __file__, 'estimator_seeds', 'adasfm-estimator-seeds')
  parser.add_argument('--kinds', nargs='+', default=list(KINDS), choices=KINDS)
  parser.add_argument('--seeds', type=int, nargs='+', default=range(1, 9))
  args = parser.parse_args()
  colmap = os.path.abspath(args.colmap)
  folder = os.path.join(os.path.abspath(args.output_path), 'world')
  run_table({'%s %d' % (kind, seed):
             (KINDS[kind], functools.partial(run_world, colmap, folder, kind,
                                             seed))
             for seed in args.seeds for kind in args.kinds}, report, args)
  return 0


if __name__ == '__main__':
  sys.exit(main())
