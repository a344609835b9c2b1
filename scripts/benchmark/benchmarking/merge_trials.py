# SPDX-License-Identifier: BSD-3-Clause
"""The paper's merge trials: parts are aligned to disturbed coarse poses, with
fixed thresholds and with the adaptive threshold."""

import json
import os
import shutil

import numpy as np

from benchmarking.methods import SMALL_PARTS, evaluate
from benchmarking.models import centre_of, read_model, replace_poses
from benchmarking.pair_counts import rotation_matrix
from benchmarking.process import Failed, run

# Amplitudes of the disturbance [m], its seeds, and thresholds [m].
LEVELS_M = (0.2, 0.5, 1.0, 2.0)
SEEDS = (1, 2, 3)
THRESHOLDS = ('0.1', '1', '10', 'adaptive')
# Length of the runs of outlier images, and period of the bend, in images.
RUN_IMAGES = 4
BEND_IMAGES = 60
OUTLIER_SHARE = 0.15
OUTLIER_FACTOR = 10.0
DEG_PER_M = 1.0


def disturb(poses, sigma_m, seed):
  """Coarse poses with known errors, in order of the images' names.

  The errors of the centres are a bend with a period of BEND_IMAGES and an
  amplitude of sigma_m (z: 0.3 sigma_m), white noise of half of sigma_m per
  axis, and runs of RUN_IMAGES images, OUTLIER_SHARE of all, that lie
  OUTLIER_FACTOR times sigma_m aside. Rotations have noise of DEG_PER_M times
  sigma_m per axis.
  """
  generator = np.random.default_rng(seed)
  names = sorted(poses)
  centres = np.array([centre_of(*poses[name]) for name in names])
  phases = 2 * np.pi * np.arange(len(names)) / BEND_IMAGES
  shifts = sigma_m * np.stack(
      [np.sin(phases + offset)
       for offset in generator.uniform(0, 2 * np.pi, 3)], axis=1)
  shifts[:, 2] *= 0.3
  shifts += generator.normal(0, 0.5 * sigma_m, centres.shape)
  num_runs = int(round(OUTLIER_SHARE * len(names) / RUN_IMAGES))
  for k in generator.choice(len(names) // RUN_IMAGES, num_runs, replace=False):
    direction = generator.normal(size=3) * [1, 1, 0.2]
    shifts[k * RUN_IMAGES:(k + 1) * RUN_IMAGES] += (
        OUTLIER_FACTOR * sigma_m * direction / np.linalg.norm(direction))
  result = {}
  for name, centre in zip(names, centres + shifts):
    angle = np.radians(DEG_PER_M * sigma_m) * generator.normal(size=3)
    rotation = rotation_matrix([1.0, *(angle / 2)]) @ poses[name][0]
    result[name] = rotation, -rotation @ centre
  return result


def describe_disturbance():
  """What a row depends on besides level and seed."""
  return [RUN_IMAGES, BEND_IMAGES, OUTLIER_SHARE, OUTLIER_FACTOR, DEG_PER_M,
          SMALL_PARTS, list(THRESHOLDS)]


def options_of(threshold, with_priors):
  options = [] if with_priors else [
      '--AdaSfmMapper.use_priors_in_adjustment', '0']
  if threshold != 'adaptive':
    options += ['--AdaSfmAlign.adapt_threshold', '0',
                '--AdaSfmAlign.initial_threshold', threshold]
  return SMALL_PARTS + options


def summarise(output, world, args, log_path):
  """Figures of the parts in a mapper's summary, and the model's error."""
  with open(os.path.join(output, 'summary.json')) as file:
    summary = json.load(file)
  parts = summary['parts']
  evaluation = evaluate(output, os.path.join(world, 'gt.txt'), args, log_path)
  best = evaluation and evaluation['sim3_least_squares']
  return {'parts': len(parts), 'merged': sum(p['merged'] for p in parts),
          'inlier_ratios': [round(p['inlier_ratio'], 2) for p in parts],
          'thresholds_m': [round(p['threshold'], 2) for p in parts],
          'images': summary['num_images'],
          'coarse_images': len(summary['coarse_images']),
          'separator_rmse_m': round(summary['separator_rmse_before'], 3),
          'rmse_m': round(best['translation_rmse_m'], 4) if best else None,
          'verdict': summary['verdict']['result']}


def run_trial(level_m, seed, with_priors, world, args):
  """One disturbance with all thresholds; world has imported.db and global/."""
  folder = os.path.join(args.output_path, 'merge')
  shutil.rmtree(folder, ignore_errors=True)
  os.makedirs(folder)
  log_path = os.path.join(folder, 'run.log')
  coarse = os.path.join(folder, 'global')
  shutil.copytree(os.path.join(world, 'global', '0'), os.path.join(coarse, '0'))
  if level_m:
    replace_poses(os.path.join(coarse, '0'),
                  disturb(read_model(os.path.join(coarse, '0')), level_m, seed))
  coarse_error = evaluate(os.path.join(coarse, '0'),
                          os.path.join(world, 'gt.txt'), args, log_path)
  record = {'level_m': level_m, 'seed': seed, 'with_priors': with_priors,
            'coarse_rmse_m': round(coarse_error['sim3_least_squares']
                                   ['translation_rmse_m'], 3)}
  for threshold in THRESHOLDS:
    database = os.path.join(folder, 'database.db')
    shutil.copy(os.path.join(world, 'imported.db'), database)
    output = os.path.join(folder, threshold)
    try:
      run([args.colmap, 'adasfm_mapper', '--database_path', database,
           '--input_path', coarse, '--output_path', output] +
          options_of(threshold, with_priors), log_path)
      record[threshold] = summarise(output, world, args, log_path)
    except Failed as error:
      record[threshold] = {'error': str(error)}
  if not args.keep:
    shutil.rmtree(folder)
  return record
