#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Worlds in which single parts of the method count, with and without the part.

Makes each world, runs `adasfm_global` and `adasfm_mapper` as they are and with
one part switched off, compares the models with the truth, and writes a table:
one row a world and seed. Needs only Python's standard library.
"""

import argparse
import shutil
import sys

from benchmarking.figures import add_arguments, write_results
from benchmarking.process import Failed
from stress_worlds import (dial, describe_failure, list_seeds, make_world,
                           map_world)

PARTS_OF_50 = ['--AdaSfmPartition.max_num_images_undivided', '50',
               '--AdaSfmPartition.max_part_size', '50']


def ablation(world, off_global=(), off_mapper=(), mapper=()):
  return {'world': world, 'mapper': list(mapper),
          'off': {'global': list(off_global), 'mapper': list(off_mapper)}}


ABLATIONS = {
    'SDP start': ablation(
        dial((), 200, (), rotation_outliers=0.45),
        off_global=['--AdaSfmGlobal.use_sdp_start', '0']),
    'adaptive alignment': ablation(
        dial((), 200, gyro_drift=1e-3),
        off_mapper=['--AdaSfmAlign.adapt_threshold', '0'],
        mapper=PARTS_OF_50),
    'overlap of the parts': ablation(
        dial((), 200, num_blackouts=4, blackout_images=12,
             blackout_keypoints=14),
        off_mapper=['--AdaSfmPartition.min_overlap_ratio', '0'],
        mapper=PARTS_OF_50),
    'coarse candidates': ablation(
        dial((), 200, num_blackouts=4, blackout_images=12,
             blackout_keypoints=14),
        off_mapper=['--AdaSfmMapper.use_global_candidate', '0'],
        mapper=PARTS_OF_50),
    'match refinement': ablation(
        dial((), 150, moving_ratio=0.45),
        off_global=['--AdaSfmGlobal.refine_matches', '0']),
}


def run_ablation(name, seed, args):
  row = ABLATIONS[name]
  world = row['world']
  folder, record = make_world(name, world, seed, args)
  if 'error' in record:
    return record
  for key, off in (('on', {'global': [], 'mapper': []}), ('off', row['off'])):
    try:
      record[key] = map_world(folder, world['logs'], args, key, off['global'],
                              row['mapper'] + off['mapper'])
    except Failed as error:
      record[key] = {'error': describe_failure(error, folder, key)}
  if not args.keep:
    shutil.rmtree(folder)
  return record


def cell(outcome):
  if 'error' in outcome:
    return outcome['error']
  if outcome['rmse_m'] is None:
    return 'no model'
  models = ('' if outcome['models'] == 1
            else ' in %d models' % outcome['models'])
  return '%.3f m, %d images%s' % (outcome['rmse_m'], outcome['images'], models)


def report(records, args):
  lines = [
      '# Worlds for single parts', '',
      'Written by `scripts/benchmark/ablation_worlds.py --seeds %s` with version '
      '%s. Each row is one world, made by the options in the second column; '
      'RMSE of camera centres after a similarity, of the worst model where there '
      'are several, as it is and with the part switched off.' % (
          args.seeds, args.version or 'of the tree'), '',
      '| part | world | seed | switched off by | as it is | without the part |',
      '|---|---|---|---|---|---|']
  for record in records:
    off = ABLATIONS[record['dial']]['off']
    cells = ([record['error'], ''] if 'error' in record else
             [cell(record['on']), cell(record['off'])])
    lines.append('| %s | `%s` | %d | `%s` | %s |' % (
        record['dial'], record['command'].replace('adasfm_synthesizer ', ''),
        record['seed'], ' '.join(off['global'] + off['mapper']),
        ' | '.join(cells)))
  return '\n'.join(lines) + '\n'


def parse_arguments():
  parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
  parser.add_argument('parts', nargs='*',
                      help='rows of the table; all when none is named')
  add_arguments(parser, __file__, 'ablation_worlds', 'adasfm-ablation-worlds')
  parser.add_argument('--seeds', default='1-3', help='as 1,2,5-8')
  parser.add_argument('--run_mapper', type=int, default=1,
                      help='0: coarse models only')
  parser.add_argument('--version', default='', help='stands in the table')
  args = parser.parse_args()
  for name in args.parts:
    if name not in ABLATIONS:
      parser.error('no such part: %s; there are: %s' %
                   (name, '; '.join(ABLATIONS)))
  return args


def main():
  args = parse_arguments()
  records = []
  for name in args.parts or ABLATIONS:
    for seed in list_seeds(args.seeds):
      record = run_ablation(name, seed, args)
      records.append(record)
      print(name, seed, *([record['error']] if 'error' in record else
                          [cell(record['on']), '|', cell(record['off'])]),
            sep=' ', flush=True)
      write_results(records, report(records, args), args)


if __name__ == '__main__':
  sys.exit(main())
