#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Measures the coarse global stage and the effect of each of its steps.

Makes drives with perceptual aliasing, a blackout and wheel slips, runs
`adasfm_global` on them as it is and with single steps switched off, then
`adasfm_mapper`, and writes docs/results/global_results.md and the figures
behind it (benchmark/results/global_results.json). Verified pairs and matches
are compared with the truth before and after. Needs only Python's standard
library.
"""

import argparse
import functools
import json
import os
import shutil
import statistics

from benchmarking.figures import add_arguments, run_table
from benchmarking.methods import evaluate, log_options
from benchmarking.process import Failed, run

# Options of adasfm_global for each ablation.
VARIANTS = {
    'as it is': [],
    'no loop gating': ['use_loop_gating'],
    'no refinement of relative poses': ['refine_relative_poses'],
    'no refinement of translations': ['refine_translations'],
    'no augmentation': ['use_augmentation'],
    'no metric lengths (unit vectors)': ['use_metric_lengths'],
    'no second stage of positions': ['refine_positions'],
    'no priors in bundle adjustment': ['ba_use_priors'],
    'no match refinement': ['refine_matches'],
    'without sensors': None,
}
# A world has failed if its model lacks images or has a larger error.
MAX_ERROR_M = 0.5


def hard_options(args):
  return ['--alias_ratio', '0.05', '--num_blackouts', str(args.num_blackouts),
          '--wheel_slips', '2']


def options_of(variant):
  arguments = []
  for name in VARIANTS[variant] or []:
    arguments += ['--AdaSfmGlobal.' + name, '0']
  return arguments


def world_name(num_images, seed):
  return 'alias-%d-seed%d' % (num_images, seed)


def make_world(num_images, seed, args):
  """A folder with database.db (no priors) and imported.db (with them)."""
  folder = os.path.join(args.output_path, world_name(num_images, seed))
  os.makedirs(folder, exist_ok=True)
  log_path = os.path.join(folder, 'make.log')
  database = os.path.join(folder, 'database.db')
  if not os.path.exists(database):
    run([args.colmap, 'adasfm_synthesizer', '--output_path', folder,
         '--num_images', str(num_images), '--seed', str(seed)] +
        hard_options(args), log_path)
  imported = os.path.join(folder, 'imported.db')
  if not os.path.exists(imported):
    shutil.copy(database, imported + '.part')
    run([args.colmap, 'adasfm_prior_importer', '--database_path',
         imported + '.part'] + log_options(folder), log_path)
    os.rename(imported + '.part', imported)
  return folder


def shorten(evaluation):
  """The figures that the tables need; None without a model."""
  if not evaluation:
    return None
  return {'images': evaluation['num_images'],
          'true_images': evaluation['num_true_images'],
          'rmse_m': evaluation['sim3_least_squares']['translation_rmse_m'],
          'scale': evaluation['sim3']['scale'],
          'rotation_mean_deg': evaluation['sim3']['rotation_mean_deg']}


def evaluate_pairs(database, model, folder, args, log_path):
  json_path = os.path.join(os.path.dirname(database), 'pairs.json')
  run([args.colmap, 'adasfm_evaluator', '--input_path', model,
       '--ground_truth_path', os.path.join(folder, 'gt.txt'),
       '--database_path', database, '--landmarks_path',
       os.path.join(folder, 'landmarks.txt'), '--pairs_json_path', json_path],
      log_path)
  with open(json_path) as file:
    return json.load(file)


def run_variant(variant, folder, args):
  """One record: the coarse model, the final model, and the pairs."""
  run_folder = os.path.join(folder, variant.replace(' ', '_'))
  shutil.rmtree(run_folder, ignore_errors=True)
  os.makedirs(run_folder)
  log_path = os.path.join(run_folder, 'run.log')
  database = os.path.join(run_folder, 'database.db')
  source = 'database.db' if VARIANTS[variant] is None else 'imported.db'
  shutil.copy(os.path.join(folder, source), database)
  truth = os.path.join(folder, 'gt.txt')
  coarse = os.path.join(run_folder, 'global')
  record = {'world': os.path.basename(folder), 'variant': variant}
  try:
    usage = run([args.colmap, 'adasfm_global', '--database_path', database,
                 '--output_path', coarse] + options_of(variant), log_path)
    record['cpu_seconds'] = round(usage.cpu_seconds, 2)
    record['coarse'] = shorten(evaluate(os.path.join(coarse, '0'), truth, args,
                                        log_path))
    with open(os.path.join(coarse, 'summary.json')) as file:
      summary = json.load(file)
    model = summary['models'][0]
    record['unsuspected'] = (model['pairs_agree'] and
                             not model['unconfirmed_closures'] and
                             not summary['segment_closures']['by_vision'])
    if variant == 'as it is' and args.compare_pairs:
      record['pairs'] = evaluate_pairs(database, os.path.join(coarse, '0'),
                                       folder, args, log_path)
    if variant in args.mapper_variants:
      output = os.path.join(run_folder, 'model')
      run([args.colmap, 'adasfm_mapper', '--database_path', database,
           '--input_path', os.path.join(coarse, '0'), '--output_path', output],
          log_path)
      record['final'] = shorten(evaluate(output, truth, args, log_path))
  except Failed as error:
    record['error'] = str(error)
  if not args.keep:
    shutil.rmtree(run_folder)
  return record


def run_row(variant, num_images, seed, args):
  return run_variant(variant, make_world(num_images, seed, args), args)


def failed(figures):
  return (not figures or figures['images'] < figures['true_images'] or
          figures['rmse_m'] > MAX_ERROR_M)


def summarise(records, key):
  """Median and largest error, largest scale error, failures."""
  figures = [r.get(key) for r in records]
  errors = [f['rmse_m'] for f in figures if f]
  scales = [abs(f['scale'] - 1.0) for f in figures if f]
  if not errors:
    return '- | - | - | %d' % len(figures)
  return '%.3f | %.3f | %.2f | %d' % (
      statistics.median(errors), max(errors), 100.0 * max(scales),
      sum(failed(f) for f in figures))


def ablation_table(records, args):
  lines = ['| variant | coarse: median m | worst m | scale off % | failed |' +
           (' final: median m | worst m | scale off % | failed |'
            if args.mapper_variants else '') +
           ' wrong without a word |',
           '|---|---|---|---|---|' +
           ('---|---|---|---|' if args.mapper_variants else '') + '---|']
  for variant in args.variants:
    mine = [r for r in records if r['variant'] == variant]
    silent = sum(bool(r.get('unsuspected')) and
                 r['coarse']['rmse_m'] > MAX_ERROR_M for r in mine)
    columns = [variant, summarise(mine, 'coarse')]
    if variant in args.mapper_variants:
      columns.append(summarise(mine, 'final'))
    elif args.mapper_variants:
      columns.append(' | | | ')
    lines.append('| ' + ' | '.join(columns + [str(silent)]) + ' |')
  return lines


def world_table(records):
  """A line for each run of the variant 'as it is'."""
  lines = ['| world | images | coarse: m | scale off % | final: m | scale off % |'
           ' reported against it |', '|---|---|---|---|---|---|---|']
  for record in records:
    if record['variant'] != 'as it is':
      continue
    cells = [record['world']]
    coarse = record.get('coarse')
    cells.append('%d/%d' % (coarse['images'], coarse['true_images'])
                 if coarse else '-')
    for key in ('coarse', 'final'):
      figures = record.get(key)
      cells += (['%.3f' % figures['rmse_m'],
                 '%.2f' % (100.0 * abs(figures['scale'] - 1.0))]
                if figures else ['-', '-'])
    cells.append('no' if record.get('unsuspected') else 'yes')
    lines.append('| ' + ' | '.join(cells) + ' |')
  return lines


def mean(values):
  values = list(values)
  return sum(values) / len(values)


SETS = (('verified', 'as verified'), ('kept_before', 'kept, as verified'),
        ('kept_after', 'kept, refined'))


def match_table(pairs):
  lines = ['| pairs | number | false pairs | matches | precision % | recall % |'
           ' inlier ratio % |', '|---|---|---|---|---|---|---|']
  for key, name in SETS:
    lines.append('| %s | %d | %d | %d | %.2f | %.2f | %.1f |' % (
        name, sum(p[key]['num_pairs'] for p in pairs),
        sum(p[key]['num_false_pairs'] for p in pairs),
        sum(p[key]['num_matches'] for p in pairs),
        100 * sum(p[key]['num_true_matches'] for p in pairs) /
        max(1, sum(p[key]['num_matches'] for p in pairs)),
        100 * sum(p[key]['num_true_matches'] for p in pairs) /
        max(1, sum(p['num_true_raw_matches'] for p in pairs)),
        100 * mean(p[key]['mean_inlier_ratio'] for p in pairs)))
  return lines


def auc_table(pairs):
  lines = ['| AUC % | ' + ' | '.join('%s: R | t' % name for _, name in SETS) +
           ' |', '|---|' + '---|---|' * len(SETS)]
  thresholds = [a['threshold_deg']
                for a in pairs[0]['verified']['relative_pose_auc']]
  for k, threshold in enumerate(thresholds):
    cells = []
    for key, _ in SETS:
      for part in ('rotation_percent', 'translation_percent'):
        cells.append('%.2f' % mean(p[key]['relative_pose_auc'][k][part]
                                   for p in pairs))
    lines.append('| @ %g deg | ' % threshold + ' | '.join(cells) + ' |')
  return lines


def histogram_table(pairs):
  num_bins = len(pairs[0]['verified']['inlier_ratio_histogram'])
  lines = ['| inlier ratio | ' + ' | '.join(name for _, name in SETS) + ' |',
           '|---|' + '---|' * len(SETS)]
  totals = {key: [sum(p[key]['inlier_ratio_histogram'][k] for p in pairs)
                  for k in range(num_bins)] for key, _ in SETS}
  for k in range(num_bins):
    if any(totals[key][k] for key, _ in SETS):
      lines.append('| %.2f to %.2f | ' % (k / num_bins, (k + 1) / num_bins) +
                   ' | '.join(str(totals[key][k]) for key, _ in SETS) + ' |')
  return lines


def report(records, args):
  pairs = [r['pairs'] for r in records if 'pairs' in r]
  lines = ['Written by `scripts/benchmark/global_tables.py`; the runs behind it are in '
           '`%s`. Worlds: `adasfm_synthesizer %s`, %s images, '
           'seeds %s. Errors are the RMSE of camera centres after a '
           'similarity. A model that lacks images or errs by more than '
           '%.1f m has failed; it is wrong without a word when it errs by more and '
           'neither its pairs nor joins that nothing or vision alone confirms '
           'are reported against it.' % (
               os.path.basename(args.figures_path),
               ' '.join(hard_options(args)),
               ' and '.join(map(str, args.sizes)),
               ', '.join(map(str, args.seeds)), MAX_ERROR_M), '',
           '## What each step buys', '']
  lines += ablation_table(records, args)
  if 'as it is' in args.variants:
    lines += ['', '## World by world', '']
    lines += world_table(records)
  if pairs:
    lines += ['', '## Matches against the truth', '',
              'Recall is relative to the true ones among the raw matches.', '']
    lines += match_table(pairs)
    lines += ['', '## Relative poses', '',
              'Area under the recall curve of rotation R and direction of '
              "translation t (the paper's Table I; verified = NN+RANSAC).", '']
    lines += auc_table(pairs)
    lines += ['', '## Inlier ratios', '',
              'Number of pairs by the share of raw matches that are inliers.',
              '']
    lines += histogram_table(pairs)
  return '\n'.join(lines) + '\n'


def parse_arguments():
  parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
  add_arguments(parser, __file__, 'global_results',
                'adasfm-global-tables')
  parser.add_argument('--sizes', default='150,300', help='images of a world')
  parser.add_argument('--num_blackouts', type=int, default=1,
                      help='intervals without a keypoint')
  parser.add_argument('--compare_pairs', type=int, default=1,
                      help='0: leave out the tables of pairs and matches')
  parser.add_argument('--num_seeds', type=int, default=3,
                      help='worlds of each size (10: what the project claims)')
  parser.add_argument('--variants', default=','.join(VARIANTS),
                      help='any of: ' + ', '.join(VARIANTS))
  parser.add_argument('--mapper_variants', default=','.join(VARIANTS),
                      help='those that adasfm_mapper completes; "" for coarse '
                      'models only')
  args = parser.parse_args()
  args.sizes = [int(size) for size in args.sizes.split(',')]
  args.seeds = list(range(1, args.num_seeds + 1))
  args.variants = args.variants.split(',')
  args.mapper_variants = [v for v in args.mapper_variants.split(',') if v]
  for variant in args.variants + args.mapper_variants:
    if variant not in VARIANTS:
      parser.error('no such variant: ' + variant)
  return args


def main():
  args = parse_arguments()
  run_table({'%s %s' % (world_name(num_images, seed), variant):
             ([VARIANTS[variant], hard_options(args), args.compare_pairs,
               variant in args.mapper_variants],
              functools.partial(run_row, variant, num_images, seed, args))
             for seed in args.seeds for num_images in args.sizes
             for variant in args.variants}, report, args)


if __name__ == '__main__':
  main()
