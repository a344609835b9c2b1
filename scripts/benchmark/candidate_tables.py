#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""What coarse poses as candidates beside P3P buy: time, and where matches are
poor.

Maps a clean world and worlds with few or wrong matches in small parts, with and
without `--AdaSfmMapper.use_global_candidate`, on the same coarse model. Writes
docs/results/candidates.md.
"""

import argparse
import functools
import os
import shutil
import statistics
import sys

from benchmarking.figures import (add_arguments, measure, run_table,
                                  world_folder)
from benchmarking.methods import SMALL_PARTS, make_coarse_model
from benchmarking.process import Failed, run
from global_without_sensors import summarise

NUM_IMAGES = 300
SEEDS = range(1, 6)
# Name: (arguments of adasfm_synthesizer, whether its logs are imported).
WORLDS = {
    'clean': ([], True),
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
  folder = world_folder(name, seed, args)
  shutil.rmtree(folder, ignore_errors=True)
  os.makedirs(folder)
  log_path = os.path.join(folder, 'run.log')
  record = {'world': name, 'seed': seed}
  try:
    run([args.colmap, 'adasfm_synthesizer', '--output_path', folder,
         '--num_images', str(NUM_IMAGES), '--seed', str(seed)] + synthesizer,
        log_path)
    make_coarse_model(folder, folder, args, has_logs, {})
    for variant, options in VARIANTS.items():
      output = os.path.join(folder, variant)
      usage = run([args.colmap, 'adasfm_mapper', '--database_path',
                   os.path.join(folder, 'database.db'), '--input_path',
                   os.path.join(folder, 'global', '0'), '--output_path',
                   output] + SMALL_PARTS + options, log_path)
      record[variant] = measure(output, folder, args, log_path)
      record[variant + '_cpu_s'] = usage.cpu_seconds
  except Failed as error:
    record['error'] = str(error)
  if not args.keep:
    shutil.rmtree(folder)
  return record


def count_better(records):
  """Seeds in which a variant errs by more than 2 % less than the other."""
  pairs = [tuple(r[variant]['rmse_m'] for variant in VARIANTS) for r in records
           if all(r.get(variant) for variant in VARIANTS)]
  return '%d, %d' % (sum(a < 0.98 * b for a, b in pairs),
                     sum(b < 0.98 * a for a, b in pairs))


def cpu_times(records):
  """Median CPU seconds of the mapper with and without candidates."""
  return ', '.join(
      '%.1f' % statistics.median(times) if times else '-'
      for times in ([r[variant + '_cpu_s'] for r in records
                     if variant + '_cpu_s' in r] for variant in VARIANTS))


def report(records, args):
  del args
  lines = ['Written by `scripts/benchmark/candidate_tables.py`: worlds of %d '
           'images, seeds %d to %d, `%s`. Fewest images of a model; RMSE of '
           'camera centres after a similarity; seeds in which one errs by over '
           '2 %% less than the other; median CPU seconds of the mapper.' % (
               NUM_IMAGES, SEEDS[0], SEEDS[-1], ' '.join(SMALL_PARTS)), '',
           '| world | candidates: images | median m | worst m | none: images | '
           'median m | worst m | better with, without | CPU s with, without |',
           '|---' + '|---:' * 6 + '|---|---|']
  for name in WORLDS:
    mine = [r for r in records if r['world'] == name]
    row = [name]
    for variant in VARIANTS:
      row += summarise(mine, variant)
    lines.append('| %s |' % ' | '.join(row + [count_better(mine),
                                              cpu_times(mine)]))
  lines += ['\n%(world)s, seed %(seed)d: %(error)s' % r for r in records
            if 'error' in r]
  return '\n'.join(lines) + '\n'


def main():
  parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
  add_arguments(parser, __file__, 'candidates', 'adasfm-candidates')
  parser.set_defaults(timeout=None)
  args = parser.parse_args()
  run_table({'%s %d' % (name, seed): (
      [NUM_IMAGES, *WORLDS[name], SMALL_PARTS],
      functools.partial(run_world, name, seed, args))
      for name in WORLDS for seed in SEEDS}, report, args)


if __name__ == '__main__':
  sys.exit(main())
