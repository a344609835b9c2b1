#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Do priors ever make the model worse, and is the adjustment honest?

Forty worlds with sensor models spoilt as real ones are: a standstill that is
not quite still, wheels that differ by 0.4 %, noise figures wrong by a factor of
three up or down. For each the final error with the priors in the adjustment and
without them, the limit (the same final refinement from the true poses, with and
without the priors), the chi-square of the priors and the keypoint sigma. Prints
a Markdown table and what was counted. Needs only Python's standard library.
"""

import argparse
import json
import math
import os
import re
import shutil
import sys

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
# The bars: with priors at most this share of the error without, and of the
# limit with the same priors.
MAX_OF_WITHOUT = 1.02
MAX_OF_LIMIT = 1.1


def ring(folder):
  """While it stands the machine turns by 0.5 mrad/s and rings at 3 Hz."""
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
    record[name] = chain.shape_error_m(name)
  summary = summary_of(chain, 'with')
  record['coarse'] = chain.shape_error_m('g/0')
  record['images'] = summary['num_images']
  record['keypoint_sigma_px'] = summary['keypoint_sigma_px']
  record['chi2'] = summary['prior_chi2_per_dof']
  return record


def main():
  parser = argparse.ArgumentParser(description=__doc__)
  parser.add_argument('colmap', help='our colmap')
  parser.add_argument('folder', help='for the worlds; removed one by one')
  parser.add_argument('--kinds', nargs='+', default=list(KINDS))
  parser.add_argument('--seeds', type=int, nargs='+', default=range(1, 9))
  args = parser.parse_args()
  records = []
  print('| world | images | coarse | with | without | limit | limit without | '
        'with / without | with / limit | chi2 | keypoint sigma |')
  print('|---|---|---|---|---|---|---|---|---|---|---|')
  for seed in args.seeds:
    for kind in args.kinds:
      record = run_world(os.path.abspath(args.colmap),
                         os.path.join(os.path.abspath(args.folder), 'world'),
                         kind, seed)
      name = '%s %d' % (kind, seed)
      if 'error' in record:
        print('| %s | %s |' % (name, record['error']), flush=True)
        continue
      records.append(record)
      record['of_without'] = record['with'] / record['without']
      record['of_limit'] = record['with'] / record['limit']
      print('| %s | %d/%d | %s | %.2f | %.3f |' % (
          name, record['images'], record['num_images'], ' | '.join(
              '%.3f' % record[key] for key in
              ('coarse', 'with', 'without', 'limit', 'limit_without',
               'of_without', 'of_limit')),
          record['chi2'], record['keypoint_sigma_px']), flush=True)
  count = lambda test: '%d of %d' % (sum(map(test, records)), len(records))
  print('\nwith at most %g of without: %s; at most %g of the limit: %s; '
        'chi-square within 0.8 to 1.25: %s' % (
            MAX_OF_WITHOUT, count(lambda r: r['of_without'] <= MAX_OF_WITHOUT),
            MAX_OF_LIMIT, count(lambda r: r['of_limit'] <= MAX_OF_LIMIT),
            count(lambda r: 0.8 <= r['chi2'] <= 1.25)))
  return 0


if __name__ == '__main__':
  sys.exit(main())
