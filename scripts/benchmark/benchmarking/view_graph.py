# SPDX-License-Identifier: BSD-3-Clause
"""View graphs and coarse models of a world, with and without augmentation."""

import os
import shutil
import sqlite3

import numpy as np

from benchmarking.methods import evaluate, make_coarse_model
from benchmarking.models import centre_of, read_model
from benchmarking.pair_counts import MAX_PAIR_IMAGES, read_true_poses

VARIANTS = {'with': [], 'without': ['--AdaSfmGlobal.use_augmentation', '0']}


def pack(pairs):
  """Pairs of numbers as one short string of a JSON file."""
  return ' '.join('%d-%d' % tuple(pair) for pair in sorted(pairs))


def unpack(text):
  return [tuple(map(int, word.split('-'))) for word in text.split()]


def pack_points(points):
  return ' '.join('%.2f,%.2f' % tuple(point) for point in points)


def unpack_points(text):
  return np.array([[float(x) for x in word.split(',')]
                   for word in text.split()]).reshape(-1, 2)


def read_edges(database, names, sensors=False):
  """Verified pairs, or with sensors those of priors, as indices in names."""
  connection = sqlite3.connect(database)
  place = {image_id: names.index(name) for image_id, name in
           connection.execute('SELECT image_id, name FROM images')}
  if sensors:
    pairs = connection.execute('SELECT image_id1, image_id2 FROM '
                               'adasfm_relative_pose_priors').fetchall()
  else:
    pairs = [divmod(row[0], MAX_PAIR_IMAGES) for row in connection.execute(
        'SELECT pair_id FROM two_view_geometries WHERE rows > 0')]
  connection.close()
  return {tuple(sorted((place[a], place[b]))) for a, b in pairs}


def place_at_first_camera(poses, truth):
  """Centres from above, (N, 2), of a model moved so that its first camera has
  its true pose; the scale is the model's own."""
  names = sorted(name for name in poses if name in truth)
  rotation, translation = poses[names[0]]
  true_rotation, true_translation = truth[names[0]]
  turn = true_rotation.T @ rotation
  centres = np.array([centre_of(*poses[name]) for name in names])
  centres -= centre_of(rotation, translation)
  return (centre_of(true_rotation, true_translation) + centres @ turn.T)[:, :2]


def run_coarse(variant, world, args):
  """Makes the coarse models; (database, [figures of each])."""
  folder = os.path.join(args.output_path, 'view_graph-' + variant)
  shutil.rmtree(folder, ignore_errors=True)
  os.makedirs(folder)
  database = os.path.join(folder, 'database.db')
  shutil.copy(os.path.join(world, 'database.db'), database)
  make_coarse_model(folder, world, args, True, {'global': VARIANTS[variant]})
  truth_path = os.path.join(world, 'gt.txt')
  coarse, models = os.path.join(folder, 'global'), []
  for name in sorted((n for n in os.listdir(coarse) if n.isdigit()), key=int):
    path = os.path.join(coarse, name)
    figures = evaluate(path, truth_path, args, os.path.join(folder, 'run.log'))
    models.append({
        'images': figures['num_images'],
        'sim3_rmse_m': figures['sim3_least_squares']['translation_rmse_m'],
        'se3_rmse_m': figures['se3_least_squares']['translation_rmse_m'],
        'scale': figures['sim3_least_squares']['scale'],
        'centres': pack_points(place_at_first_camera(
            read_model(path), read_true_poses(truth_path)))})
  return database, models


def run_view_graph(world, args):
  """The record for the picture; world has database.db, logs and truth."""
  truth = read_true_poses(os.path.join(world, 'gt.txt'))
  names = sorted(truth)
  before = read_edges(os.path.join(world, 'database.db'), names)
  record = {'truth': pack_points([centre_of(*truth[n])[:2] for n in names])}
  for variant in VARIANTS:
    database, record[variant] = run_coarse(variant, world, args)
    if variant == 'with':
      kept = read_edges(database, names)
      record.update(visual=pack(kept), removed=pack(before - kept),
                    sensors=pack(read_edges(database, names, True)))
    if not args.keep:
      shutil.rmtree(os.path.dirname(database))
  return record
