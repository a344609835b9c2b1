#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""What coarse poses as candidates beside P3P buy where matches are poor.

Maps worlds with few or wrong matches in small parts, with and without
`--AdaSfmMapper.use_global_candidate`, on the same coarse model. Writes
docs/results/candidates.md.
"""

import argparse
import functools
import os
import shutil
import statistics
import sys

from benchmarking.figures import add_arguments, measure, run_table
from benchmarking.methods import SMALL_PARTS, log_options
from benchmarking.process import Failed, run

NUM_IMAGES = 300
SEEDS = range(1, 6)
# Name: (arguments of adasfm_synthesizer, whether its logs are imported).
WORLDS = {
    '`--outlier_ratio 0.8 --num_keypoints 400`, no logs': (
        ['--outlier_ratio', '0.8', '--num_keypoints', '400'], False),
    '`--num_keypoints 60 --num_neighbors 3 --spacing 2`, no logs': (
        ['--num_keypoints', '60', '--num_neighbors', '3', '--spacing', '2'],
        False),
    '`--pixel_noise 3 --num_keypoints 200`': (
        ['--pixel_noise', '3', '--num_keypoints', '200'], True),
    '`--blackout_images 8 --num_blackouts 6 --num_keypoints 100`': (
        ['--blackout_images', '8', '--num_blackouts', '6', '--num_keypoints',
         '100'], True),
}
VARIANTS = {'with': [], 'without': ['--AdaSfmMapper.use_global_candidate', '0']}


def run_world(name, seed, args):
  synthesizer, has_logs = WORLDS[name]
  key = list(WORLDS).index(name)
  folder = os.path.join(args.output_path, '%d-%d' % (key, seed))
  shutil.rmtree(folder, ignore_errors=True)
  os.makedirs(folder)
  log_path = os.path.join(folder, 'run.log')
  database = os.path.join(folder, 'database.db')
  coarse = os.path.join(folder, 'global')
  record = {'world': name, 'seed': seed}
  try:
    run([args.colmap, 'adasfm_synthesizer', '--output_path', folder,
         '--num_images', str(NUM_IMAGES), '--seed', str(seed)] + synthesizer,
        log_path)
    if has_logs:
      run([args.colmap, 'adasfm_prior_importer', '--database_path', database] +
          log_options(folder), log_path)
    run([args.colmap, 'adasfm_global', '--database_path', database,
         '--output_path', coarse], log_path)
  except Failed as error:
    record['error'] = str(error)
    return record
  for variant, options in VARIANTS.items():
    output = os.path.join(folder, variant)
    try:
      run([args.colmap, 'adasfm_mapper', '--database_path', database,
           '--input_path', os.path.join(coarse, '0'), '--output_path', output] +
          SMALL_PARTS + options, log_path)
      record[variant] = measure(output, folder, args, log_path)
    except Failed as error:
      record[variant] = {'error': str(error)}
  if not args.keep:
    shutil.rmtree(folder)
  return record


def cells(outcomes):
  """Fewest images, then median and largest error."""
  models = [o for o in outcomes if o and 'rmse_m' in o]
  if not models:
    return ['-', '-']
  errors = [m['rmse_m'] for m in models]
  images = '%d' % min(m['images'] for m in models)
  if len(models) < len(outcomes):
    images += ', %d failed' % (len(outcomes) - len(models))
  return [images, '%.3f, %.3f' % (statistics.median(errors), max(errors))]


def count_better(records):
  """Seeds in which a variant errs by more than 2 % less than the other."""
  pairs = [tuple(r[v]['rmse_m'] for v in VARIANTS) for r in records
           if all('rmse_m' in (r.get(v) or {}) for v in VARIANTS)]
  return '%d, %d' % (sum(a < 0.98 * b for a, b in pairs),
                     sum(b < 0.98 * a for a, b in pairs))


def report(records, args):
  del args
  lines = ['Written by `scripts/benchmark/candidate_tables.py`: worlds of %d '
           'images, seeds %d to %d, `%s`. Fewest images of a model; median and '
           'largest RMSE of camera centres after a similarity; seeds in which '
           'one errs by over 2 %% less than the other.' % (
               NUM_IMAGES, SEEDS[0], SEEDS[-1], ' '.join(SMALL_PARTS)), '',
           '| world | candidates: images | m | none: images | m | better with, '
           'without |', '|---|---:|---|---:|---|---|']
  for name in WORLDS:
    mine = [r for r in records if r['world'] == name]
    row = [name]
    for variant in VARIANTS:
      row += cells([r.get(variant) for r in mine])
    lines.append('| %s |' % ' | '.join(row + [count_better(mine)]))
  return '\n'.join(lines) + '\n'


def main():
  parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
  add_arguments(parser, __file__, 'candidates', 'adasfm-candidates')
  args = parser.parse_args()
  run_table({'%s %d' % (name, seed): (
      [NUM_IMAGES, *WORLDS[name], SMALL_PARTS],
      functools.partial(run_world, name, seed, args))
      for name in WORLDS for seed in SEEDS}, report, args)


if __name__ == '__main__':
  sys.exit(main())
