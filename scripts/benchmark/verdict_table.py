#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Verdict against error: are models with the verdict "good" accurate?

Runs the chain on synthetic worlds: as they are, hard, and with faults that
users make. Writes a table of the verdict of adasfm_mapper beside the model's
error and two limits. A limit is the error of the mapper from the true poses:
the own limit uses the run's own imported data and priors (and the metric scale
that adasfm_global found by the accelerometer, if any), the unspoilt limit the
unspoilt data. Errors are in metres if the model is metric, else of the shape
(after a similarity). Fails if a model with the verdict "good" has
- an error above MAX_RATIO times its own limit, or no own limit, or
- a shape error above MAX_RATIO times the unspoilt limit's, since spoilt data
  may raise the own limit as well, or
- a scale error above MAX_SIGMAS of the relative sigma that the verdict states
  (`metric_sigma`). The unspoilt limit's scale error is another draw of that
  sigma, perhaps near zero, so its error in metres is printed, not judged by.
Also fails if a model with the verdict "failed", other than for lost images, has
an error within MAX_RATIO of the unspoilt limit, or passes the last two tests.
Needs only Python's standard library.
"""

import argparse
import collections
import functools
import json
import os
import random
import re
import shutil
import sqlite3
import subprocess
import sys

from benchmarking.figures import add_arguments, run_table
from benchmarking.limit import write_true_poses
from benchmarking.spoil import edit_rows, scale_wheels, shift_clocks, turn_camera
from benchmarking.spoil import cut_logs, scale_focal_length
from global_worlds import PLAIN, WORLDS, world

MAX_RATIO = 3.0
MAX_SIGMAS = 3.0
# Streets are driven once, so that the worlds fit into few images.
BASE = dict(PLAIN, alias_ratio=0, num_blackouts=1, blackout_images=6)
# Worlds with perceptual aliasing or longer blackouts have at least this many.
MIN_IMAGES_OF_LARGE = 200
LARGE = {'alias_ratio', 'blackout_images'}
# The first reason of a verdict "failed" that is not about the error.
LOST_IMAGES = re.compile(r'failed: \d+ of \d+ images are lost')
# Smallest limit that ratios are formed with, for short drives [m].
LEAST_LIMIT_M = 0.01


def set_value(folder, row, column, value):
  def change(rows):
    rows[row % len(rows)][column] = '%.9g' % value
    return rows
  edit_rows(folder, 'imu.csv', change)


def scale_imu(folder, columns, factor):
  edit_rows(folder, 'imu.csv', lambda rows: [
      [('%.9g' % (factor * float(value))) if i in columns else value
       for i, value in enumerate(row)] for row in rows])


def zero_samples(folder, begin, count):
  edit_rows(folder, 'imu.csv', lambda rows: [
      row[:1] + ['0'] * 6 if begin <= i < begin + count else row
      for i, row in enumerate(rows)])


def execute(folder, sql):
  database = sqlite3.connect(os.path.join(folder, 'database.db'))
  database.execute(sql)
  database.commit()
  database.close()


def lose_pairs(folder, share):
  execute(folder, 'DELETE FROM two_view_geometries WHERE pair_id / 2147483647 '
          '> %g * (SELECT COUNT(*) FROM images)' % share)


def exchange_times(folder):
  def change(rows):
    names = [row[1] for row in rows]
    random.Random(1).shuffle(names)
    return [[row[0], name] for row, name in zip(rows, names)]
  edit_rows(folder, 'times.csv', change)


FORCE = {'import': ['--force', '1']}
WRONG = {
    'one gyroscope sample of 17 rad/s': world(
        spoil=lambda w: set_value(w, 2000, 3, 17.0)),
    'one accelerometer sample of 1e4': world(
        spoil=lambda w: set_value(w, 1500, 5, 1e4)),
    'IMU zero for 0.5 s': world(spoil=lambda w: zero_samples(w, 1500, 100)),
    'accelerometer negative': world(
        spoil=lambda w: scale_imu(w, (4, 5, 6), -1.0)),
    'gyroscope twice, forced': world(
        spoil=lambda w: scale_imu(w, (1, 2, 3), 2.0), **FORCE),
    'wheels in km/h': world(spoil=lambda w: scale_wheels(w, 3.6)),
    'wheels negative': world(spoil=lambda w: scale_wheels(w, -1.0)),
    'wheel clock 0.5 s off': world(
        spoil=lambda w: shift_clocks(w, ('wheel.csv',), 500)),
    'wheel clock 3 s off': world(
        spoil=lambda w: shift_clocks(w, ('wheel.csv',), 3000)),
    'wheel clock 1 h off': world(
        spoil=lambda w: shift_clocks(w, ('wheel.csv',), 3.6e6)),
    'T_cam_imu 30 deg off, forced': world(
        spoil=lambda w: turn_camera(w, 30), **FORCE),
    'focal length 20 % off': world(spoil=lambda w: scale_focal_length(w, 1.2)),
    'pairs for two thirds, no sensors after': world(
        spoil=lambda w: (lose_pairs(w, 0.66),
                         cut_logs(w, ('imu.csv', 'wheel.csv'), 0.66, 2))),
    'pairs for a third, no sensors after': world(
        spoil=lambda w: (lose_pairs(w, 0.33),
                         cut_logs(w, ('imu.csv', 'wheel.csv'), 0.33, 2))),
    'no verified pairs': world(
        spoil=lambda w: execute(w, 'DELETE FROM two_view_geometries')),
    'times of other images, forced': world(spoil=exchange_times, **FORCE),
}


# Errors of a model: after a similarity [m], after a rigid alignment [m] (after a
# similarity if the model is not metric), scale (true metres per metre; None: not
# metric) and the stated relative sigma of the scale (None: not stated).
Errors = collections.namedtuple('Errors', 'shape_m metric_m scale sigma')


class Chain:
  def __init__(self, colmap, folder):
    self.colmap = colmap
    self.folder = folder

  def path(self, name):
    return os.path.join(self.folder, name)

  def call(self, command, *arguments):
    return subprocess.run([self.colmap, 'adasfm_' + command, *arguments],
                          capture_output=True, text=True)

  def importer(self, options):
    arguments = ['--database_path', self.path('database.db'),
                 '--image_times_path', self.path('times.csv'),
                 '--sensors_path', self.path('sensors.yaml')]
    for log in options['sensors']:
      arguments += ['--%s_path' % log.split('.')[0], self.path(log)]
    return self.call('prior_importer', *arguments, *options.get('import', []))

  def mapper(self, source, output, options):
    return self.call('mapper', '--database_path', self.path('database.db'),
                     '--input_path', self.path(source), '--output_path',
                     self.path(output), *options.get('mapper', []))

  def evaluate(self, output):
    self.call('evaluator', '--input_path', self.path(output),
              '--ground_truth_path', self.path('gt.txt'), '--json_path',
              self.path('evaluation.json'))
    with open(self.path('evaluation.json')) as file:
      return json.load(file)

  def errors(self, output):
    evaluation = self.evaluate(output)
    with open(self.path(output + '/summary.json')) as file:
      summary = json.load(file)
    shape = evaluation['sim3_least_squares']
    if not summary['is_metric']:
      return Errors(shape['translation_rmse_m'], shape['translation_rmse_m'],
                    None, None)
    return Errors(shape['translation_rmse_m'],
                  evaluation['se3_least_squares']['translation_rmse_m'],
                  shape['scale'], summary['verdict'].get('metric_sigma'))


def limit_of(chain, name):
  """Errors of the mapper from the true poses, with the database as it is; None
  without a model."""
  write_true_poses(chain.path('database.db'), chain.path('gt.txt'),
                   chain.path('truth'), matched_only=False)
  # The mapper's verdict may be "failed" although it writes a model.
  chain.mapper('truth', name, {})
  if not os.path.exists(chain.path(name + '/summary.json')):
    return None
  return chain.errors(name)


Run = collections.namedtuple('Run', 'result said errors own unspoilt',
                             defaults=(None, None, None))


def run_world(colmap, folder, options, images, seed):
  """Makes and maps one world; returns a Run."""
  shutil.rmtree(folder, ignore_errors=True)
  chain = Chain(colmap, folder)
  arguments = dict(BASE, **options['synthesizer'])
  if LARGE & set(options['synthesizer']):
    images = max(images, MIN_IMAGES_OF_LARGE)
  made = chain.call('synthesizer', '--output_path', folder, '--num_images',
                    str(images), '--seed', str(seed),
                    *(word for name, value in arguments.items()
                      for word in ('--' + name, str(value))))
  if made.returncode != 0:
    return Run('not made', made.stderr)
  imported = chain.importer(options)
  own = unspoilt = limit_of(chain, 'unspoilt')
  if options['spoil']:
    options['spoil'](folder)
    imported = chain.importer(options)
  if imported.returncode != 0:
    return Run('refused by the importer', imported.stderr, unspoilt=unspoilt)
  if options['spoil']:
    own = limit_of(chain, 'own')
  coarse = chain.call('global', '--database_path', chain.path('database.db'),
                      '--output_path', chain.path('g'),
                      *options.get('global', []))
  if coarse.returncode != 0:
    return Run('refused by adasfm_global', coarse.stderr, None, own, unspoilt)
  done = chain.mapper('g/0', 'm', options)
  try:
    with open(chain.path('m/summary.json')) as file:
      verdict = json.load(file)['verdict']
  except OSError:
    return Run('no model', done.stderr, None, own, unspoilt)
  errors = chain.errors('m')
  if errors.scale is not None and own and own.scale is None:
    # The metric scale from the accelerometer was added by adasfm_global, so the
    # limit must be computed after it.
    own = limit_of(chain, 'own_in_metres')
  return Run(verdict['result'], verdict['line'], errors, own, unspoilt)


def ratio(error_m, limit_m):
  return error_m / max(LEAST_LIMIT_M, limit_m)


def error_ratio(errors, limit):
  """Ratio of errors in metres if the model is metric, else of shape errors."""
  if errors.scale is None:
    return ratio(errors.shape_m, limit.shape_m)
  return ratio(errors.metric_m, limit.metric_m)


Judgement = collections.namedtuple('Judgement', 'own shape sigmas unspoilt wrong',
                                   defaults=(None, None, None, None, False))


def judge(run):
  """Ratios of the errors to both limits, and whether the verdict is wrong."""
  if run.errors is None or run.unspoilt is None:
    return Judgement()
  own = error_ratio(run.errors, run.own) if run.own else None
  unspoilt = error_ratio(run.errors, run.unspoilt)
  shape = ratio(run.errors.shape_m, run.unspoilt.shape_m)
  sigmas = (abs(run.errors.scale - 1.0) / run.errors.sigma
            if run.errors.sigma else None)
  is_right = shape <= MAX_RATIO and (sigmas or 0.0) <= MAX_SIGMAS
  wrong = (run.result == 'good' and
           (not is_right or own is None or own > MAX_RATIO) or
           run.result == 'failed' and not LOST_IMAGES.search(run.said) and
           (is_right or unspoilt <= MAX_RATIO))
  return Judgement(own, shape, sigmas, unspoilt, wrong)


def to_record(name, seed, run, folder):
  """The run as JSON, without paths of this machine."""
  said = (run.said.strip().splitlines() or [''])[-1]
  return dict(name=name, seed=seed, result=run.result,
              said=said.replace(folder + '/', ''), **{
      part: errors and errors._asdict()
      for part, errors in (('errors', run.errors), ('own', run.own),
                           ('unspoilt', run.unspoilt))})


def from_record(record):
  return Run(record['result'], record['said'],
             *(record[part] and Errors(**record[part])
               for part in ('errors', 'own', 'unspoilt')))


def table_row(record, run, judgement):
  numbers = ['-' if value is None else '%.3g' % value for value in (
      run.errors and run.errors.metric_m, run.own and run.own.metric_m,
      judgement.own, judgement.shape, judgement.sigmas,
      run.unspoilt and run.unspoilt.metric_m, judgement.unspoilt)]
  return '| %s | %d | %s%s | %s |' % (
      record['name'], record['seed'], run.result,
      ' (WRONG)' if judgement.wrong else '', ' | '.join(numbers))


def summary(rows):
  """Numbers of verdicts of each kind by the ratio of error to own limit."""
  lines = ['%d runs; wrong: %d; without a model: %d.' % (
      len(rows), sum(judgement.wrong for _, judgement in rows),
      sum(run.errors is None for run, _ in rows)), '',
           '| verdict | up to 1.5 own limits | 1.5 to 3 | above 3 |',
           '|---|---|---|---|']
  bounds = [(0.0, 1.5), (1.5, MAX_RATIO), (MAX_RATIO, float('inf'))]
  for result in ('good', 'doubtful', 'failed'):
    ratios = [judgement.own for run, judgement in rows
              if run.result == result and judgement.own is not None]
    lines.append('| %s | %s |' % (result, ' | '.join(
        str(sum(low < value <= high for value in ratios))
        for low, high in bounds)))
  return lines + ['', 'Good ones above %g unspoilt limits in metres: %d.' % (
      MAX_RATIO, sum(run.result == 'good' and
                     (judgement.unspoilt or 0) > MAX_RATIO
                     for run, judgement in rows))]


def report(records, args):
  runs = [from_record(record) for record in records]
  rows = [(run, judge(run)) for run in runs]
  args.num_wrong = sum(judgement.wrong for _, judgement in rows)
  return '\n'.join(summary(rows) + [
      '', '| world | seed | verdict | error [m] | own limit [m] | ratio | '
      'shape: ratio | metres: sigmas off | unspoilt limit [m] | ratio |',
      '|---|---|---|---|---|---|---|---|---|---|',
      *(table_row(record, *row) for record, row in zip(records, rows))]) + '\n'


def main():
  parser = argparse.ArgumentParser(
      description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
  add_arguments(parser, __file__, 'verdicts', 'adasfm-verdicts')
  parser.add_argument('--images', type=int, default=60)
  parser.add_argument('--seeds', type=int, nargs='+', default=[1, 2, 3])
  parser.add_argument('--only', default='', help='rows with this in the name')
  args = parser.parse_args()
  colmap = os.path.abspath(args.colmap)
  folder = os.path.join(os.path.abspath(args.output_path), 'world')

  def run(name, options, seed):
    result = run_world(colmap, folder, options, args.images, seed)
    shutil.rmtree(folder, ignore_errors=True)
    return to_record(name, seed, result, folder)

  def spec(options):
    needs_accelerometer = list(options['sensors']) == ['imu.csv']
    return [args.images] + ['own limit in metres'] * needs_accelerometer

  run_table({'%s %d' % (name, seed): (spec(options),
                                      functools.partial(run, name, options,
                                                        seed))
             for name, options in {**WORLDS, **WRONG}.items()
             if args.only in name for seed in args.seeds}, report, args)
  return 1 if args.num_wrong else 0


if __name__ == '__main__':
  sys.exit(main())
