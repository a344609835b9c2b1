# SPDX-License-Identifier: BSD-3-Clause
"""Matches of hard pairs before and after adasfm_global, against the truth.

Aliased places and images with few keypoints are worlds of the synthesizer with
landmarks, which define the true matches. The mirrored case has rendered photos:
in a bend the right half of each photo becomes the mirror image of its left
half, as a mirror beside the lens would show it; a match is true if it fits the
true poses and is not seen in the mirror.
"""

import os
import shutil
import sqlite3
import zlib

import numpy as np

from benchmarking.methods import (evaluate, list_models, make_coarse_model,
                                  run_mapper)
from benchmarking.pair_counts import (angle_deg, read_landmarks, read_pairs,
                                      read_true_poses, relative_pose)
from benchmarking.process import Failed, run
from benchmarking.sets import camera_params, extract_and_match

CASES = {
    'look-alike places': ['--num_images', '250', '--alias_ratio', '0.05',
                          '--num_blackouts', '2', '--wheel_slips', '2'],
    'little texture': ['--num_images', '250', '--num_blackouts', '4',
                       '--blackout_keypoints', '80', '--outlier_ratio', '0.7'],
    'mirrored': ['--num_images', '48', '--seed', '2', '--image_width', '640',
                 '--image_height', '400', '--render', '1'],
}
# The importer finds that gyroscope and mirrored photos contradict each other,
# and stops without --force.
IMPORT_OPTIONS = {'mirrored': {'import': ['--force', '1']}}
# A pair has little texture if one of its images has at most so many keypoints.
FEW_KEYPOINTS = 80
NUM_MIRRORED = 14
# Matches of photos are true up to this sum of the distances from both epipolar
# lines, as in adasfm_global [px].
MAX_EPIPOLAR_PX = 4.0


def spec_of(case):
  """What a row depends on."""
  return [CASES[case], IMPORT_OPTIONS.get(case), 'coarse model'] + {
      'little texture': [FEW_KEYPOINTS],
      'mirrored': [NUM_MIRRORED, MAX_EPIPOLAR_PX]}.get(case, [])


def make_case(case, args):
  folder = os.path.join(args.output_path, 'case-%s-%08x' % (
      case.replace(' ', '_'), zlib.crc32(repr(CASES[case]).encode())))
  if not os.path.exists(folder):
    temporary = folder + '.part'
    shutil.rmtree(temporary, ignore_errors=True)
    os.makedirs(temporary)
    log_path = os.path.join(args.output_path, 'make.log')
    run([args.colmap, 'adasfm_synthesizer', '--output_path', temporary] +
        CASES[case], log_path)
    if case == 'mirrored':
      names = mirror_photos(temporary)
      with open(os.path.join(temporary, 'mirrored.txt'), 'w') as file:
        file.write('\n'.join(names) + '\n')
      extract_and_match(temporary, os.path.join(temporary, 'database.db'), args,
                        log_path)
    os.rename(temporary, folder)
  return folder


def turn_deg(a, b):
  return angle_deg((np.trace(a.T @ b) - 1) / 2)


def sharpest_bend(truth, count):
  """Names of `count` consecutive images with the largest rotation from first to
  last."""
  names = sorted(truth)
  turns = [turn_deg(truth[names[k]][0], truth[names[k + count - 1]][0])
           for k in range(len(names) - count + 1)]
  first = int(np.argmax(turns))
  return names[first:first + count]


def mirror_photos(folder):
  """Mirrors the left half of the photos in the sharpest bend onto the right."""
  from matplotlib import pyplot
  names = sharpest_bend(read_true_poses(os.path.join(folder, 'gt.txt')),
                        NUM_MIRRORED)
  for name in names:
    path = os.path.join(folder, 'images', name)
    photo = pyplot.imread(path).copy()
    half = photo.shape[1] // 2
    photo[:, -half:] = photo[:, :half][:, ::-1]
    pyplot.imsave(path, photo, cmap='gray', vmin=0, vmax=1)
  return names


class Truth:
  """Which matches of a case's database are true, and which pairs are hard."""

  def __init__(self, case, folder):
    self.case, self.folder = case, folder
    self.poses = read_true_poses(os.path.join(folder, 'gt.txt'))
    connection = sqlite3.connect(os.path.join(folder, 'database.db'))
    names = dict(connection.execute('SELECT image_id, name FROM images'))
    self.points = {
        names[image_id]: np.frombuffer(data, np.float32).reshape(
            rows, columns)[:, :2].astype(float) if rows else np.zeros((0, 2))
        for image_id, rows, columns, data in connection.execute(
            'SELECT image_id, rows, cols, data FROM keypoints')}
    self.width, = connection.execute('SELECT width FROM cameras').fetchone()
    connection.close()
    self.landmarks, self.mirrored = None, set()
    if case == 'mirrored':
      with open(os.path.join(folder, 'mirrored.txt')) as file:
        self.mirrored = set(file.read().split())
      fx, fy, cx, cy = map(float, camera_params(os.path.join(
          folder, 'sensors.yaml')).split(',')[:4])
      self.calibration = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    else:
      self.landmarks = read_landmarks(os.path.join(folder, 'landmarks.txt'))

  def epipolar_errors(self, a, b, matches):
    r, t = relative_pose((a, b), self.poses)
    cross = np.array([[0, -t[2], t[1]], [t[2], 0, -t[0]], [-t[1], t[0], 0]])
    inverse = np.linalg.inv(self.calibration)
    f = inverse.T @ cross @ r @ inverse
    x1, x2 = (np.c_[self.points[n][matches[:, k]], np.ones(len(matches))]
              for k, n in enumerate((a, b)))
    lines2, lines1 = x1 @ f.T, x2 @ f
    residual = np.abs((x2 * lines2).sum(axis=1))
    return (residual / np.linalg.norm(lines2[:, :2], axis=1) +
            residual / np.linalg.norm(lines1[:, :2], axis=1))

  def are_true(self, a, b, matches):
    if self.landmarks is not None:
      ids1, ids2 = (self.landmarks[n][matches[:, k]]
                    for k, n in enumerate((a, b)))
      return (ids1 == ids2) & (ids1 >= 0)
    seen = self.epipolar_errors(a, b, matches) <= MAX_EPIPOLAR_PX
    for k, name in enumerate((a, b)):
      if name in self.mirrored:
        seen &= self.points[name][matches[:, k], 0] < self.width / 2
    return seen

  def is_hard(self, a, b, are_true):
    """Whether a verified pair is of the kind that the case is about."""
    if self.case == 'mirrored':
      return a in self.mirrored and b in self.mirrored
    if self.case == 'look-alike places':
      return 2 * are_true.sum() < len(are_true)
    return min(len(self.points[a]), len(self.points[b])) <= FEW_KEYPOINTS


def read_matches(database):
  """{(name, name): matches (N, 2)} of the verified pairs."""
  return {names: pair[0] for names, pair in read_pairs(database).items()}


def count(pairs, hard, truth):
  """Figures of the hard pairs, and of the others."""
  figures = {}
  for kind in ('hard', 'other'):
    chosen = [(pair, matches) for pair, matches in pairs.items()
              if (pair in hard) == (kind == 'hard')]
    figures[kind] = {
        'pairs': len(chosen), 'matches': sum(len(m) for _, m in chosen),
        'true': int(sum(truth.are_true(*p, m).sum() for p, m in chosen))}
  return figures


def map_with_colmap(database, folder, world, args):
  """COLMAP's mapper on the matches of a database: its models, largest first."""
  shutil.rmtree(folder, ignore_errors=True)
  os.makedirs(folder)
  shutil.copy(database, os.path.join(folder, 'database.db'))
  args.timeout = None
  try:
    output, _ = run_mapper('mapper', args.colmap, folder, world, args)
  except Failed:
    return []
  return list_models(output, os.path.join(world, 'gt.txt'), args,
                     os.path.join(folder, 'run.log'))


def example(before, after, hard, truth):
  """The kept hard pair that loses the most false matches. Its matches are text,
  each 'x1,y1,x2,y2,true'."""
  def false_ones(pair, matches):
    return int((~truth.are_true(*pair, matches)).sum())

  kept = [pair for pair in sorted(hard) if pair in after]
  if not kept:
    return None
  best = max(kept, key=lambda p: false_ones(p, before[p]) -
             false_ones(p, after[p]))
  record = {'names': list(best), 'photos': os.path.basename(truth.folder)}
  for key, pairs in (('before', before), ('after', after)):
    matches = pairs[best]
    x1, x2 = (truth.points[n][matches[:, k]] for k, n in enumerate(best))
    record[key] = ' '.join(
        '%.0f,%.0f,%.0f,%.0f,%d' % (*p, *q, good) for p, q, good in
        zip(x1, x2, truth.are_true(*best, matches)))
  return record


def run_case(case, args):
  world = make_case(case, args)
  folder = os.path.join(args.output_path, 'refine-' + case.replace(' ', '_'))
  shutil.rmtree(folder, ignore_errors=True)
  os.makedirs(folder)
  database = os.path.join(folder, 'database.db')
  shutil.copy(os.path.join(world, 'database.db'), database)
  truth = Truth(case, world)
  record = {'case': case, 'options': ' '.join(CASES[case])}
  try:
    before = read_matches(database)
    hard = {pair for pair, matches in before.items()
            if truth.is_hard(*pair, truth.are_true(*pair, matches))}
    record['before'] = count(before, hard, truth)
    record['mapper_before'] = map_with_colmap(
        database, os.path.join(folder, 'before'), world, args)
    args.timeout = None
    make_coarse_model(folder, world, args, True, IMPORT_OPTIONS.get(case, {}))
    coarse = evaluate(os.path.join(folder, 'global'),
                      os.path.join(world, 'gt.txt'), args,
                      os.path.join(folder, 'run.log'))
    record['coarse'] = [{'images': coarse['num_images'],
                         'rmse_m': coarse['sim3_least_squares']
                                   ['translation_rmse_m']}]
    after = read_matches(database)
    record['after'] = count(after, hard, truth)
    record['mapper_after'] = map_with_colmap(
        database, os.path.join(folder, 'after'), world, args)
    if case == 'mirrored':
      record['example'] = example(before, after, hard, truth)
  except Failed as error:
    record['error'] = str(error)
  if not args.keep:
    shutil.rmtree(folder)
  return record
