#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""The tables and figures of the AdaSfM paper (ICRA 2023) on our sets.

These are Table I's histograms of inlier ratios, tables in the form of Tables II
and III, the view graph with and without augmentation, merge trials with fixed
and adaptive thresholds, and match refinement on aliased, mirrored and hardly
textured pairs. COLMAP's mapper, the coarse model and AdaSfM in Tables II and
III are the runs of README's table (step readme of all.py); the histograms are
those of two_view_tables.py; everything else is run here. Writes
docs/results/paper.md and docs/images/paper_*. Needs numpy and matplotlib.
"""

import argparse
import functools
import json
import os
import shutil
import sys

from benchmarking import merge_trials, paper_pictures, paper_tables
from benchmarking.figures import add_arguments, run_table
from benchmarking.ledger import MixedVersions, make_stamp
from benchmarking.match_refinement import CASES, run_case, spec_of
from benchmarking.methods import make_coarse_model, run_method
from benchmarking.process import run
from benchmarking.sets import (REAL_SETS, add_features_argument, make_database,
                               set_features_path)
from benchmarking.view_graph import run_view_graph

# The world of the view graph and of the merge trials: fragments, perceptual
# aliasing, wheel slips.
WORLD = ['--num_images', '250', '--alias_ratio', '0.05', '--num_blackouts', '2',
         '--wheel_slips', '2']
# Sets without a run of hierarchical_mapper: COLMAP's mapper alone takes longer
# there than everything that this script runs.
TOO_LONG = ('world-kitti10-592',)


def make_world(args):
  """A folder with database.db, logs, truth, imported.db and global/0."""
  folder = os.path.join(args.output_path, 'world')
  if not os.path.exists(os.path.join(folder, 'imported.db')):
    shutil.rmtree(folder, ignore_errors=True)
    os.makedirs(folder)
    run([args.colmap, 'adasfm_synthesizer', '--output_path', folder] + WORLD,
        os.path.join(folder, 'run.log'))
    database = os.path.join(folder, 'database.db')
    shutil.copy(database, database + '.raw')
    make_coarse_model(folder, folder, args, True, {})
    os.rename(database, os.path.join(folder, 'imported.db'))
    os.rename(database + '.raw', database)
  return folder


def run_hierarchical(name, args):
  folder = os.path.join(args.output_path, name)
  os.makedirs(folder, exist_ok=True)
  source = make_database(name, folder, args)
  return run_method(name, 'hierarchical_mapper',
                    os.path.join(folder, 'hierarchical_mapper'), source,
                    args)[0]


def merge_row(level_m, seed, with_priors, args):
  return merge_trials.run_trial(level_m, seed, with_priors, make_world(args),
                                args)


def rows_of(args):
  rows = {'view graph': (WORLD, lambda: run_view_graph(make_world(args), args))}
  for case in CASES:
    rows['refinement, ' + case] = (spec_of(case),
                                   functools.partial(run_case, case, args))
  for with_priors in (False, True):
    for level_m in (0,) + merge_trials.LEVELS_M:
      for seed in merge_trials.SEEDS if level_m else (0,):
        rows['merge %g m, seed %d, %s priors' % (
            level_m, seed, 'with' if with_priors else 'without')] = (
                [WORLD, merge_trials.describe_disturbance()],
                functools.partial(merge_row, level_m, seed, with_priors, args))
  for name in args.hierarchical_sets:
    rows['hierarchical_mapper, ' + name] = (
        None, functools.partial(run_hierarchical, name, args))
  return rows


def read_figures(path):
  with open(path) as file:
    return json.load(file)


def check_version(benchmark, stamp, args):
  """Raises MixedVersions if README's table is of other sources or machine."""
  for key in ('sources', 'machine'):
    if benchmark['stamp'][key] != stamp[key]:
      raise MixedVersions('%s is of other %s: run the step readme first' % (
          os.path.basename(args.benchmark_path), key))


def report(records, args):
  benchmark = read_figures(args.benchmark_path)
  two_view = read_figures(args.two_view_path)
  check_version(benchmark, read_figures(args.figures_path)['stamp'], args)
  paper_pictures.draw_all(records, two_view, args)
  return paper_tables.page(records, benchmark, two_view, args)


def parse_arguments(words=None):
  parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
  add_arguments(parser, __file__, 'paper', 'adasfm-paper')
  results = os.path.join(parser.get_default('root'), 'benchmark', 'results')
  parser.add_argument('--data_path', default='../shared/data',
                      help='folder of the recordings')
  add_features_argument(parser)
  parser.add_argument('--hierarchical_sets', default=None,
                      help='sets, with commas, on which hierarchical_mapper is '
                      'run; default: all that are there but %s' %
                      ', '.join(TOO_LONG))
  parser.add_argument('--benchmark_path',
                      default=os.path.join(results, 'benchmark.json'),
                      help="figures of README's table")
  parser.add_argument('--two_view_path',
                      default=os.path.join(results, 'two_view.json'),
                      help='figures of two_view_tables.py')
  parser.add_argument('--images_path', default=os.path.join(
      parser.get_default('root'), 'docs', 'images'),
                      help='folder of the pictures')
  args = parser.parse_args(words)
  set_features_path(args)
  there = [name for name in REAL_SETS
           if os.path.isdir(os.path.join(args.data_path, name))]
  args.hierarchical_sets = (
      [name for name in there if name not in TOO_LONG]
      if args.hierarchical_sets is None else
      [name for name in args.hierarchical_sets.split(',') if name])
  for name in args.hierarchical_sets:
    if name not in there:
      parser.error('no such set: ' + name)
  args.world = WORLD
  args.peers, args.host_colmap, args.timeout, args.seed = {}, '', None, 1
  return args


def main():
  args = parse_arguments()
  try:
    if args.run:
      check_version(read_figures(args.benchmark_path), make_stamp(args.root),
                    args)
    run_table(rows_of(args), report, args)
  except MixedVersions as error:
    sys.exit('not written: %s' % error)


if __name__ == '__main__':
  main()
