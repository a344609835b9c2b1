#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Pairs that adasfm_global loses or wrongly keeps, world by world.

Imports the logs of worlds of the benchmark, runs `adasfm_global`, and counts
against the truth (benchmarking/pair_counts.py) what it left of the verified
pairs. Writes docs/results/pairs.md. Needs numpy.
"""

import argparse
import functools
import os
import shutil
import sys

from benchmarking.figures import add_arguments, run_table
from benchmarking.methods import make_coarse_model
from benchmarking.pair_counts import (FAR_M, MAX_DIRECTION_DEG,
                                      MAX_ROTATION_DEG, count_pairs)
from benchmarking.process import Failed
from benchmarking.sets import (KINDS, QUICK, REAL_SETS, is_world,
                               make_database)

COLUMNS = ('true', 'true_lost', 'right_lost', 'wrong', 'wrong_kept',
           'false', 'false_kept')
# Worlds, as nobody knows which pairs of photos are false. QUICK has not all
# kinds.
SETS = [name for name in REAL_SETS if name.startswith('world-')] + QUICK
SETS += [kind + '-500' for kind in KINDS
         if not any(name.startswith(kind) for name in QUICK)]


def run_set(name, args):
  folder = os.path.join(args.output_path, name)
  shutil.rmtree(folder, ignore_errors=True)
  os.makedirs(folder)
  record = {'set': name}
  try:
    source = make_database(name, folder, args)
    database, verified = (os.path.join(folder, base + '.db')
                          for base in ('database', 'verified'))
    shutil.copy(database, verified)
    make_coarse_model(folder, source, args, True, {})
    record['pairs'] = count_pairs(verified, database, source)
  except Failed as error:
    record['error'] = str(error)
  if not args.keep:
    shutil.rmtree(folder)
  return record


def report(records, args):
  del args
  lines = ['Written by `scripts/benchmark/pair_tables.py`. True: more than half '
           "of the pair's matches see one landmark; where the landmarks are not "
           'known, its images are at most %g m apart. Lost: without matches '
           'after `adasfm_global`. Right pose: the verified rotation errs by at '
           'most %g deg, the direction by at most %g deg (the best of the '
           "essential matrix's four poses counts). Of wrong pose, kept: with "
           'matches afterwards. False, kept: false before and after.' % (
               FAR_M, MAX_ROTATION_DEG, MAX_DIRECTION_DEG), '',
           '| set | true pairs | lost | lost, of right pose | of wrong pose | '
           'kept | false pairs | kept |', '|---' + '|---:' * 7 + '|']
  for record in records:
    cells = [record['set']]
    cells += ([str(record['pairs'][key]) for key in COLUMNS]
              if 'pairs' in record else [record['error']] + [''] * 6)
    lines.append('| %s |' % ' | '.join(cells))
  return '\n'.join(lines) + '\n'


def main():
  parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
  add_arguments(parser, __file__, 'pairs', 'adasfm-pairs')
  parser.set_defaults(timeout=None, seed=1)
  parser.add_argument('--data_path', default='../shared/data',
                      help='folder of the worlds of another generator')
  args = parser.parse_args()
  run_table({name: (None, functools.partial(run_set, name, args))
             for name in SETS if is_world(name) or
             os.path.isdir(os.path.join(args.data_path, name))}, report, args)


if __name__ == '__main__':
  sys.exit(main())
