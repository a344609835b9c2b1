#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""What the three refinements of the coarse stage do on drives without logs.

Maps worlds of the second generator (independent_worlds.py), and worlds of
`adasfm_synthesizer` with few keypoints, without any log: as it is, and with
each of `--AdaSfmGlobal.refine_relative_poses`, `refine_translations` and
`refine_positions` off. Writes docs/results/refinements.md. Needs numpy.
"""

import argparse
import functools
import json
import os
import shutil
import subprocess
import sys

from benchmarking.figures import add_arguments, run_table, world_folder
from benchmarking.methods import list_models, run_adasfm
from benchmarking.process import Failed

NUM_IMAGES = 300
SEEDS = range(1, 4)
INDEPENDENT = ('clean', 'hole', 'alias', 'hard')
SPARSE = 'few keypoints'
FEW_KEYPOINTS = ['--num_keypoints', '60', '--num_neighbors', '3', '--spacing',
                 '2']
# Smaller models are not in the table [images].
MIN_NUM_IMAGES = 10
VARIANTS = {
    'as it is': [],
    'no refined relative poses': ['--AdaSfmGlobal.refine_relative_poses', '0'],
    'no refined translations': ['--AdaSfmGlobal.refine_translations', '0'],
    'no refined positions': ['--AdaSfmGlobal.refine_positions', '0'],
}


def make_world(kind, seed, folder, args):
  shutil.rmtree(folder, ignore_errors=True)
  if kind == SPARSE:
    os.makedirs(folder)
    command = [args.colmap, 'adasfm_synthesizer', *FEW_KEYPOINTS]
  else:
    command = [sys.executable, os.path.join(os.path.dirname(
        os.path.abspath(__file__)), 'independent_worlds.py'), '--kind', kind,
               '--colmap', args.colmap]
  subprocess.run(command + ['--output_path', folder, '--num_images',
                            str(NUM_IMAGES), '--seed', str(seed)], check=True,
                 stdout=subprocess.DEVNULL)


def map_world(world, folder, options, args):
  """Final models, the largest first, and the verdict; 'failed' without any."""
  shutil.rmtree(folder, ignore_errors=True)
  os.makedirs(folder)
  shutil.copy(os.path.join(world, 'database.db'), folder)
  try:
    output, _ = run_adasfm(folder, world, args, False, {'global': options})
  except Failed:
    return {'models': [], 'verdict': 'failed'}
  with open(os.path.join(output, 'summary.json')) as file:
    verdict = json.load(file)['verdict']['result']
  return {'models': list_models(output, os.path.join(world, 'gt.txt'), args,
                                os.path.join(folder, 'run.log')),
          'verdict': verdict}


def run_world(kind, seed, args):
  world = world_folder(kind, seed, args)
  make_world(kind, seed, world, args)
  record = {'world': kind, 'seed': seed, 'variants': {
      name: map_world(world, os.path.join(world, 'run'), options, args)
      for name, options in VARIANTS.items()}}
  if not args.keep:
    shutil.rmtree(world)
  return record


def cell(result):
  models = [m for m in result['models'] if m['images'] >= MIN_NUM_IMAGES]
  if not models:
    return 'none'
  return '%s: %.3f, %s' % ('+'.join(str(m['images']) for m in models),
                           max(m['rmse_m'] for m in models), result['verdict'])


def report(records, args):
  del args
  lines = ['Written by `scripts/benchmark/refinement_tables.py`. Worlds of %d '
           'images of `independent_worlds.py --kind`, and of '
           '`adasfm_synthesizer %s` (%s), all without logs. Images of the final '
           'models of at least %d, the largest RMSE of camera centres of one of '
           'them after a similarity, m, and the verdict.' % (
               NUM_IMAGES, ' '.join(FEW_KEYPOINTS), SPARSE, MIN_NUM_IMAGES), '',
           '| world | seed | %s |' % ' | '.join(VARIANTS),
           '|---|---:' + '|---' * len(VARIANTS) + '|']
  for record in records:
    lines.append('| %s | %d | %s |' % (
        record['world'], record['seed'],
        ' | '.join(cell(record['variants'][name]) for name in VARIANTS)))
  return '\n'.join(lines) + '\n'


def main():
  parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
  add_arguments(parser, __file__, 'refinements', 'adasfm-refinements')
  parser.set_defaults(timeout=None)
  args = parser.parse_args()
  args.colmap = os.path.abspath(args.colmap)
  run_table({'%s %d' % (kind, seed): (
      [NUM_IMAGES, FEW_KEYPOINTS, VARIANTS],
      functools.partial(run_world, kind, seed, args))
      for kind in INDEPENDENT + (SPARSE,) for seed in SEEDS}, report, args)


if __name__ == '__main__':
  sys.exit(main())
