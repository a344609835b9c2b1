#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""One world for each difficulty (dial): its figures and the resulting models.

Makes each dial's world with `adasfm_synthesizer` and reads the world's figures
from its world.json. Runs `adasfm_prior_importer`, `adasfm_global` and
`adasfm_mapper` on the world, or `adasfm_automatic_reconstructor` if the world
has photos, then the same without any log and importer. Compares all models with
the truth and writes a table of one row per dial and seed. A model is folded if
its camera centres err by more than a bar after a similarity; a folded model
must come with a warning. Needs numpy.
"""

import argparse
import collections
import functools
import json
import os
import shutil
import statistics
import sys

from benchmarking.dials import DIALS, MAX_DRIFT_WITHOUT_LOGS
from benchmarking.figures import (add_arguments, measure, run_table,
                                  world_folder)
from benchmarking.pair_counts import count_pairs
from benchmarking.process import Failed, run
from benchmarking.sets import camera_params

NOT_ABOUT_A_MODEL = ('are in no model', 'fall apart', 'is connected to another only',
                     'joins not made')


def read_warnings(log_path):
  with open(log_path, errors='replace') as file:
    return sorted({line.strip().split('WARNING: ')[1] for line in file
                   if 'WARNING: ' in line})


def list_models(folder):
  names = [name for name in os.listdir(folder) if name.isdigit()]
  return [os.path.join(folder, name) for name in sorted(names, key=int)]


def map_world(folder, logs, args):
  """Imports the logs and runs both commands; returns read_outcome()."""
  suffix = 'with' if logs else 'without'
  log_path = os.path.join(folder, suffix + '.log')
  database = os.path.join(folder, suffix + '.db')
  shutil.copy(os.path.join(folder, 'database.db'), database)
  if logs:
    arguments = [args.colmap, 'adasfm_prior_importer', '--database_path',
                 database, '--image_times_path',
                 os.path.join(folder, 'times.csv'), '--sensors_path',
                 os.path.join(folder, 'sensors.yaml')]
    for log in logs:
      arguments += ['--%s_path' % log, os.path.join(folder, log + '.csv')]
    run(arguments, log_path)
  coarse = os.path.join(folder, suffix + '-global')
  final = os.path.join(folder, suffix + '-sparse')
  usage = [run([args.colmap, 'adasfm_global', '--database_path', database,
                '--output_path', coarse], log_path)]
  if args.run_mapper:
    usage.append(run([args.colmap, 'adasfm_mapper', '--database_path', database,
                      '--input_path', coarse, '--output_path', final],
                     log_path))
  outcome = read_outcome(folder, coarse, final, log_path, usage, args)
  outcome['pairs'] = count_pairs(os.path.join(folder, 'database.db'), database,
                                 folder)
  return outcome


def map_photos(folder, logs, args):
  """Runs one command from photos to models; returns read_outcome()."""
  suffix = 'with' if logs else 'without'
  log_path = os.path.join(folder, suffix + '.log')
  workspace = os.path.join(folder, suffix)
  arguments = [args.colmap, 'adasfm_automatic_reconstructor', '--image_path',
               os.path.join(folder, 'images'), '--workspace_path', workspace,
               '--extractor', 'opencv', '--camera_model', 'PINHOLE',
               '--camera_params',
               camera_params(os.path.join(folder, 'sensors.yaml'))]
  if logs:
    arguments += ['--image_times_path', os.path.join(folder, 'times.csv'),
                  '--sensors_path', os.path.join(folder, 'sensors.yaml')]
  for log in logs:
    arguments += ['--%s_path' % log, os.path.join(folder, log + '.csv')]
  usage = [run(arguments, log_path)]
  return read_outcome(folder, os.path.join(workspace, 'coarse'),
                      os.path.join(workspace, 'sparse'), log_path, usage, args)


def read_outcome(folder, coarse, final, log_path, usage, args):
  models = [measure(path, folder, args, log_path)
            for path in list_models(final if args.run_mapper else coarse)]
  models = [model for model in models if model]
  with open(os.path.join(coarse, 'summary.json')) as file:
    summary = json.load(file)
  warnings = [text for text in read_warnings(log_path)
              if 'no sensor priors' not in text]
  if summary['segment_closures']['not_made']:
    warnings.append('joins not made')
  if any(model['unconfirmed_closures'] for model in summary['models']):
    warnings.append('unverified joins')
  return {'images': sum(model['images'] for model in models),
          'models': len(models),
          'rmse_m': max((model['rmse_m'] for model in models), default=None),
          'scale': models[0]['scale'] if models else None,
          'cpu_s': round(sum(u.cpu_seconds for u in usage), 1),
          'warnings': warnings}


def judge(outcome, bar_m, num_images):
  if 'error' in outcome:
    return outcome['error']
  if outcome['rmse_m'] is None:
    return 'no model'
  is_folded = outcome['rmse_m'] > bar_m
  # Warnings about images left out or models kept apart are not about the models
  # that exist.
  is_told = any(not any(words in text for words in NOT_ABOUT_A_MODEL)
                for text in outcome['warnings'])
  if is_folded:
    return 'beyond the bar, warned' if is_told else 'BEYOND THE BAR, SILENT'
  return 'whole' if outcome['images'] == num_images else 'right, incomplete'


def describe_failure(error, folder):
  """The last ERROR line of the logs, or the exception without one."""
  said = []
  for name in ('with.log', 'without.log'):
    path = os.path.join(folder, name)
    if os.path.exists(path):
      with open(path, errors='replace') as file:
        said += [line.strip() for line in file if line.startswith('ERROR: ')]
  return 'refused: ' + said[-1][len('ERROR: '):] if said else str(error)


def run_dial(name, seed, args):
  row = DIALS[name]
  folder = world_folder(name, seed, args)
  shutil.rmtree(folder, ignore_errors=True)
  os.makedirs(folder)
  record = {'dial': name, 'seed': seed, 'num_images': row['images']}
  arguments = [args.colmap, 'adasfm_synthesizer', '--output_path', folder,
               '--num_images', str(row['images']), '--seed', str(seed)]
  for option, value in row['options'].items():
    arguments += ['--' + option, str(value)]
  record['command'] = ' '.join(arguments[1:2] + arguments[4:])
  try:
    run(arguments, os.path.join(folder, 'world.log'))
  except Failed as error:
    record['error'] = str(error)
    return record
  with open(os.path.join(folder, 'world.json')) as file:
    record['world'] = json.load(file)
  drift_m = row['max_drift'] * record['world']['driven_m']
  for key, logs, bar_m in (('with', row['logs'], row['bar_m']),
                           ('without', (), max(row['bar_m'], drift_m))):
    if key not in args.runs.split(','):
      continue
    try:
      map_it = map_photos if 'render' in row['options'] else map_world
      record[key] = map_it(folder, logs, args)
    except Failed as error:
      record[key] = {'error': describe_failure(error, folder)}
    record[key]['bar_m'] = bar_m
    record[key]['verdict'] = judge(record[key], bar_m, row['images'])
  if not args.keep:
    shutil.rmtree(folder)
  return record


def format_figures(record):
  """The world's figures, or why there is no world."""
  world = record.get('world', {})
  return record.get('error', ', '.join(
      format_figure(key, world[key]) for key in DIALS[record['dial']]['figures']
      if key in world))


def count_silent(records):
  outcomes = [r[key] for r in records for key in ('with', 'without')
              if key in r]
  return 'Beyond the bar without a word: %d of %d models.' % (
      sum('SILENT' in o['verdict'] for o in outcomes), len(outcomes))


def format_pairs(pairs):
  """Lost true pairs (of right pose) of all, and kept false pairs of all."""
  if not pairs:
    return '-'
  return '%d (%d) of %d, %d of %d' % (
      pairs['true_lost'], pairs['right_lost'], pairs['true'],
      pairs['false_kept'], pairs['false'])


def cells(outcome):
  if not outcome:
    return ['', '', '', '']
  if 'error' in outcome or outcome['rmse_m'] is None:
    return ['-', '-', outcome['verdict'], '-']
  return ['%d' % outcome['images'] + (
      ' in %d models' % outcome['models'] if outcome['models'] > 1 else ''),
          '%.3f' % outcome['rmse_m'], outcome['verdict'],
          format_pairs(outcome.get('pairs'))]


def format_figure(name, value):
  name = name.replace('num_', '').replace('_ratio', '').replace('_', ' ')
  return '%s %.4g' % (name, value)


def report(records, args):
  lines = [
      'Written by `scripts/benchmark/stress_worlds.py --seeds %s`. '
      'Each row is one world: its dial with the value '
      'that `world.json` counted, then images and RMSE of camera centres after a '
      'similarity (the worst model where there are several), with the logs and '
      'without any. The bar is 0.5 m (lanes: 0.1 m, GNSS alone: 1 m) and, '
      'without logs, at least %g %% of the way. Warnings about images and parts that '
      'are left out do not count as warnings about a model. Pairs: true ones that '
      '`adasfm_global` left without matches (of those, with a pose within 1 deg and '
      '10 deg of direction), of all true ones; false ones that it kept, of all '
      'false ones, at most half of whose matches see one thing that stands still; '
      'not counted where photos are matched.' % (
          args.seeds, 100 * MAX_DRIFT_WITHOUT_LOGS), '',
      '| dial | seed | what the world has | images | m | verdict | pairs: true '
      'lost, false kept | images, no logs | m | verdict | pairs |',
      '|---|---|---|---|---|---|---|---|---|---|---|']
  for record in records:
    lines.append('| ' + ' | '.join(
        [record['dial'], str(record['seed']), format_figures(record)] +
        cells(record.get('with')) + cells(record.get('without'))) + ' |')
  return '\n'.join(lines + ['', count_silent(records)]) + '\n'


def summary_cells(outcomes):
  """Number of each verdict over all seeds, and the errors. Failed commands,
  runs without a model and worlds that could not be made count as refused."""
  verdicts = collections.Counter(o.get('verdict', 'not made')
                                 for o in outcomes)
  errors = sorted(o['rmse_m'] for o in outcomes if o.get('rmse_m') is not None)
  counts = [verdicts.pop(name, 0) for name in
            ('whole', 'right, incomplete', 'beyond the bar, warned',
             'BEYOND THE BAR, SILENT')]
  return [str(count) for count in counts] + [
      str(sum(verdicts.values())),
      '%.3f, %.3f' % (statistics.median(errors), errors[-1]) if errors else '-']


def report_summary(records, args):
  """A row for each dial and kind of run, over the seeds."""
  lines = ['Written by `scripts/benchmark/stress_worlds.py --summary 1 --seeds '
           '%s`: worlds whose models are whole, miss images, err by more than '
           'the bar with a warning about a model or without any word, and those '
           'refused or not made; then median and largest RMSE of camera centres '
           'after a similarity. Bars as in [stress_worlds.md](stress_worlds.md).' %
           args.seeds, '',
           '| dial | what the first world has | logs | whole | incomplete | '
           'beyond, warned | beyond, silent | refused | median, worst m |',
           '|---|---|---|---:|---:|---:|---:|---:|---|']
  for name in args.dials or DIALS:
    mine = [r for r in records if r['dial'] == name]
    for key, logs in (('with', '+'.join(DIALS[name]['logs'])),
                      ('without', 'none')):
      if key in args.runs.split(','):
        outcomes = [r if 'error' in r else r[key] for r in mine]
        lines.append('| %s |' % ' | '.join(
            [name, format_figures(mine[0]), logs] + summary_cells(outcomes)))
  return '\n'.join(lines + ['', count_silent(records)]) + '\n'


def parse_arguments():
  parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
  parser.add_argument('dials', nargs='*',
                      help='rows of the table; all when none is named')
  add_arguments(parser, __file__, 'stress_worlds', 'adasfm-stress-worlds')
  parser.add_argument('--seeds', default='1', help='as 1,2,5-8')
  parser.add_argument('--runs', default='with,without',
                      help='with logs, without, or both')
  parser.add_argument('--summary', type=int, default=0,
                      help='1: a row a dial with counts over the seeds')
  parser.add_argument('--run_mapper', type=int, default=1,
                      help='0: coarse models only')
  args = parser.parse_args()
  for name in args.dials:
    if name not in DIALS:
      parser.error('no such dial: %s; there are: %s' %
                   (name, '; '.join(DIALS)))
  return args


def list_seeds(text):
  seeds = []
  for part in text.split(','):
    first, _, last = part.partition('-')
    seeds += range(int(first), int(last or first) + 1)
  return seeds


def main():
  args = parse_arguments()
  run_table({'%s %d' % (name, seed):
             ([DIALS[name], args.runs, args.run_mapper],
              functools.partial(run_dial, name, seed, args))
             for name in args.dials or DIALS
             for seed in list_seeds(args.seeds)},
            report_summary if args.summary else report, args)


if __name__ == '__main__':
  sys.exit(main())
