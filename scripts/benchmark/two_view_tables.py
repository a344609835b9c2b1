#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Relative poses of photos: COLMAP's RANSAC, and after the coarse stage.

Tables and inlier histograms in the form of the paper's Table I, on SIFT
features of real and rendered photos, which COLMAP extracts, matches and
verifies. They cover all pairs as COLMAP verified them, the pairs that
`adasfm_global` keeps, and the kept pairs with the matches and poses that it
writes. Writes docs/results/two_view.md. Needs only Python's standard library.
"""

import argparse
import functools
import json
import os
import shutil
import sys

from benchmarking.figures import add_arguments, run_table
from benchmarking.methods import make_coarse_model
from benchmarking.process import Failed, run
from benchmarking.sets import (REAL_SETS, add_features_argument, copy_features,
                               extract_and_match, set_features_path)
from global_tables import SETS, auc_table, histogram_table

RENDERED = 'rendered-60'


def make_photos(name, args):
  """The folder of photos, logs and truth."""
  if name != RENDERED:
    return os.path.join(args.data_path, name)
  folder = os.path.join(args.output_path, name + '-photos')
  if not os.path.exists(folder):
    temporary = folder + '.part'
    shutil.rmtree(temporary, ignore_errors=True)
    os.makedirs(temporary)
    run([args.colmap, 'adasfm_synthesizer', '--output_path', temporary,
         '--num_images', name.split('-')[1], '--render', '1'],
        os.path.join(args.output_path, 'make.log'))
    os.rename(temporary, folder)
  return folder


def run_set(name, args):
  source = make_photos(name, args)
  folder = os.path.join(args.output_path, name)
  shutil.rmtree(folder, ignore_errors=True)
  os.makedirs(folder)
  log_path = os.path.join(folder, 'run.log')
  record = {'set': name}
  try:
    database = os.path.join(folder, 'database.db')
    if name == RENDERED:
      extract_and_match(source, database, args, log_path)
    else:
      copy_features(name, source, database, args, log_path)
    make_coarse_model(folder, source, args, True, {})
    json_path = os.path.join(folder, 'pairs.json')
    run([args.colmap, 'adasfm_evaluator', '--input_path',
         os.path.join(folder, 'global', '0'), '--ground_truth_path',
         os.path.join(source, 'gt.txt'), '--database_path', database,
         '--pairs_json_path', json_path], log_path)
    with open(json_path) as file:
      record['pairs'] = json.load(file)
  except Failed as error:
    record['error'] = str(error)
  return record


def count_table(records):
  lines = ['| photos | ' + ' | '.join('%s: pairs | matches | inlier ratio %%' %
                                      name for _, name in SETS) + ' |',
           '|---|' + '---|---|---|' * len(SETS)]
  for record in records:
    cells = ['%d | %d | %.1f' % (pairs['num_pairs'], pairs['num_matches'],
                                 100 * pairs['mean_inlier_ratio'])
             for pairs in (record['pairs'][key] for key, _ in SETS)]
    lines.append('| %s | %s |' % (record['set'], ' | '.join(cells)))
  return lines


def report(records, args):
  del args
  failed = [r for r in records if 'error' in r]
  records = [r for r in records if 'pairs' in r]
  lines = ['Written by `scripts/benchmark/two_view_tables.py`: 2,000 SIFT '
           'features a photo, sequential matching with overlap 8 and '
           'verification by COLMAP 3.8. As verified: its matches, and poses from '
           'its essential matrices, estimated anew where these do not fit '
           'the matches. Kept, refined: what `adasfm_global` leaves in the '
           'database.', ''] + count_table(records)
  for record in failed:
    lines += ['', '%s: %s' % (record['set'], record['error'])]
  for record in records:
    lines += ['', '## ' + record['set'], '',
              'Area under the recall curve of rotation R and direction of '
              'translation t.', ''] + auc_table([record['pairs']])
    lines += ['', 'Number of pairs by the share of raw matches that are '
              'inliers.', ''] + histogram_table([record['pairs']])
  return '\n'.join(lines) + '\n'


def parse_arguments():
  parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
  add_arguments(parser, __file__, 'two_view', 'adasfm-two-view')
  photos = [n for n in REAL_SETS if n.startswith('kitti')]
  parser.set_defaults(timeout=None)
  parser.add_argument('sets', nargs='*', help='any of: %s; default: all that '
                      'are there' % ', '.join(photos + [RENDERED]))
  parser.add_argument('--data_path', default='../shared/data',
                      help='folder of the real photos')
  add_features_argument(parser)
  args = parser.parse_args()
  set_features_path(args)
  args.sets = args.sets or [RENDERED] + [
      n for n in photos if os.path.isdir(os.path.join(args.data_path, n))]
  for name in args.sets:
    if name != RENDERED and not os.path.isdir(os.path.join(args.data_path,
                                                           name)):
      parser.error('no such set: ' + name)
  return args


def main():
  args = parse_arguments()
  run_table({name: (None, functools.partial(run_set, name, args))
             for name in args.sets}, report, args)


if __name__ == '__main__':
  sys.exit(main())
