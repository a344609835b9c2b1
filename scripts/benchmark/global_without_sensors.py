#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Without sensors: AdaSfM beside `colmap mapper` on the same matches.

Makes worlds, clean ones and some with perceptual aliasing, runs `adasfm_global`
and `adasfm_mapper` without priors, and `colmap mapper`, and writes
docs/results/global_without_sensors.md and the figures behind it
(benchmark/results/global_without_sensors.json). Needs only Python's standard
library.
"""

import argparse
import functools
import json
import os
import shutil
import statistics

from benchmarking.figures import (add_arguments, measure, run_table,
                                  world_folder)
from benchmarking.methods import fixed_intrinsics
from benchmarking.process import Failed, run

# Arguments of adasfm_synthesizer.
WORLDS = {
    'clean': [],
    'fisheye': ['--camera_model', 'OPENCV_FISHEYE'],
    'straight road': ['--trajectory', 'straight'],
    'look-alikes': ['--alias_ratio', '0.05'],
    'look-alikes and two blackouts': ['--alias_ratio', '0.05',
                                      '--num_blackouts', '2'],
}
# A model with a larger error is folded or bent.
MAX_ERROR_M = 1.0


def run_ours(folder, args, record):
  log_path = os.path.join(folder, 'run.log')
  database = os.path.join(folder, 'database.db')
  coarse = os.path.join(folder, 'global')
  run([args.colmap, 'adasfm_global', '--database_path', database,
       '--output_path', coarse], log_path)
  with open(os.path.join(coarse, 'summary.json')) as file:
    summary = json.load(file)
  models = summary['models']
  record['coarse'] = [measure(os.path.join(coarse, str(k)), folder, args,
                              log_path) for k in range(len(models))]
  by_vision = bool(summary['segment_closures']['by_vision'])
  record['suspected'] = [by_vision or not model['pairs_agree'] or
                         bool(model['unconfirmed_closures']) for model in models]
  output = os.path.join(folder, 'model')
  run([args.colmap, 'adasfm_mapper', '--database_path', database,
       '--input_path', os.path.join(coarse, '0'), '--output_path', output],
      log_path)
  record['final'] = measure(output, folder, args, log_path)


def run_host(folder, args, record):
  output = os.path.join(folder, 'host')
  os.makedirs(output)
  log_path = os.path.join(folder, 'host.log')
  run([args.host_colmap or args.colmap, 'mapper', '--database_path',
       os.path.join(folder, 'host.db'), '--image_path', folder,
       '--output_path', output] + fixed_intrinsics('Mapper.ba_'), log_path)
  record['mapper'] = measure(output, folder, args, log_path)


def run_world(name, seed, args):
  folder = world_folder(name, seed, args)
  shutil.rmtree(folder, ignore_errors=True)
  os.makedirs(folder)
  record = {'world': name, 'seed': seed}
  try:
    run([args.colmap, 'adasfm_synthesizer', '--output_path', folder,
         '--num_images', str(args.num_images), '--seed', str(seed)] +
        WORLDS[name], os.path.join(folder, 'make.log'))
    shutil.copy(os.path.join(folder, 'database.db'),
                os.path.join(folder, 'host.db'))
    run_ours(folder, args, record)
    run_host(folder, args, record)
  except Failed as error:
    record['error'] = str(error)
  if not args.keep:
    shutil.rmtree(folder)
  return record


def largest(record, key):
  models = record.get(key)
  return models[0] if isinstance(models, list) and models else models


def summarise(records, key):
  """Least images, median and largest error."""
  models = [largest(record, key) for record in records]
  errors = [model['rmse_m'] for model in models if model]
  if not errors:
    return ['-', '-', '-']
  return ['%d/%d' % min((model['images'], model['true_images'])
                        for model in models if model),
          '%.3f' % statistics.median(errors), '%.3f' % max(errors)]


def ratio_to_mapper(records):
  """Least, median and largest ratio of our final error to the mapper's."""
  ratios = [r['final']['rmse_m'] / r['mapper']['rmse_m'] for r in records
            if r.get('final') and r.get('mapper')]
  if not ratios:
    return '-'
  return '%.3f (%.3f to %.3f)' % (statistics.median(ratios), min(ratios),
                                  max(ratios))


def count_folded(records):
  """Numbers of folded coarse models, and of those without a warning."""
  folded = silent = 0
  for record in records:
    for model, suspected in zip(record.get('coarse', []),
                                record.get('suspected', [])):
      if model and model['rmse_m'] > MAX_ERROR_M:
        folded += 1
        silent += not suspected
  return folded, silent


def report(records, args):
  lines = ['Written by `scripts/benchmark/global_without_sensors.py`; the runs behind it are '
           'in `%s`. Worlds of %d images by `adasfm_synthesizer`, seeds %s; '
           'the same database for all, fixed intrinsics, the logs not imported. '
           'Errors are the RMSE of camera centres after a similarity, of the '
           'largest model; images are those of the world with the fewest. The '
           'ratio is our final error over that of `colmap mapper`: median, '
           'least and largest. Folded: '
           'coarse models, of any size, that err by more than %g m.' % (
               os.path.basename(args.figures_path), args.num_images,
               ', '.join(map(str, args.seeds)), MAX_ERROR_M), '',
           '| world | coarse: images | median m | worst m | final: images | '
           'median m | worst m | `colmap mapper`: images | median m | worst m | '
           'ratio | folded | without a word |', '|---' * 13 + '|']
  for name in args.worlds:
    mine = [record for record in records if record['world'] == name]
    if not mine:
      continue
    cells = [name]
    for key in ('coarse', 'final', 'mapper'):
      cells += summarise(mine, key)
    lines.append('| ' + ' | '.join(
        cells + [ratio_to_mapper(mine)] +
        [str(n) for n in count_folded(mine)]) + ' |')
  lines += ['', '| world | seed | final: m | `colmap mapper`: m |',
            '|---|---|---|---|']
  for record in records:
    cells = [record['world'], str(record['seed'])]
    for key in ('final', 'mapper'):
      model = record.get(key)
      cells.append('%.3f' % model['rmse_m'] if model else '-')
    lines.append('| ' + ' | '.join(cells) + ' |')
  return '\n'.join(lines) + '\n'


def parse_arguments():
  parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
  parser.add_argument('worlds', nargs='*', metavar='world',
                      help='any of: %s; all when none is named' %
                      ', '.join(WORLDS))
  add_arguments(parser, __file__, 'global_without_sensors',
                'adasfm-without-sensors')
  parser.add_argument('--num_images', type=int, default=250)
  parser.add_argument('--seeds', default='1,2,3,4,5,6,7,8')
  parser.add_argument('--host_colmap', default='',
                      help="the COLMAP whose mapper is compared; default: "
                      "the launcher's")
  args = parser.parse_args()
  args.seeds = [int(seed) for seed in args.seeds.split(',')]
  args.worlds = args.worlds or list(WORLDS)
  for name in args.worlds:
    if name not in WORLDS:
      parser.error('no such world: %s; there are: %s' %
                   (name, '; '.join(WORLDS)))
  return args


def main():
  args = parse_arguments()
  run_table({'%s %d' % (name, seed):
             ([WORLDS[name], args.num_images, args.host_colmap],
              functools.partial(run_world, name, seed, args))
             for name in args.worlds for seed in args.seeds}, report, args)


if __name__ == '__main__':
  main()
