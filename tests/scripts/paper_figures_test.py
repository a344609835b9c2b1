# SPDX-License-Identifier: BSD-3-Clause
"""Tests of scripts/benchmark/paper_figures.py."""

import argparse
import json
import os
import struct
import subprocess
import sys
import tempfile
import unittest

import numpy as np

SCRIPTS = os.path.join(os.path.dirname(os.path.abspath(__file__)), '..', '..',
                       'scripts', 'benchmark')
sys.path.insert(0, SCRIPTS)

import paper_figures  # noqa: E402
from benchmarking import (match_refinement, merge_trials, models,  # noqa: E402
                          paper_tables, view_graph)
from benchmarking.ledger import Ledger, make_stamp  # noqa: E402
from benchmarking.pair_counts import rotation_matrix  # noqa: E402
from benchmarking.pages import write_table  # noqa: E402
from temporary_folder import FolderTest  # noqa: E402


def random_rotation(generator):
  return rotation_matrix(generator.normal(size=4))


def drive(num_images):
  """Poses along x, looking in random directions."""
  generator = np.random.default_rng(1)
  poses = {}
  for k in range(num_images):
    rotation = random_rotation(generator)
    poses['%04d.png' % k] = rotation, -rotation @ np.array([1.5 * k, 0, 0])
  return poses


def write_images(path, poses):
  """An images.bin whose images see two points each."""
  with open(path, 'wb') as file:
    file.write(struct.pack('<Q', len(poses)))
    for k, (name, (rotation, translation)) in enumerate(poses.items()):
      file.write(struct.pack('<I7dI', k + 1, *models.quaternion_of(rotation),
                             *translation, 1))
      file.write(name.encode() + b'\0' + struct.pack('<Q', 2))
      file.write(struct.pack('<ddqddq', 1, 2, 3, 4, 5, -1))


class ModelsTest(unittest.TestCase):

  def test_quaternions_and_rotations_agree(self):
    generator = np.random.default_rng(2)
    for _ in range(20):
      rotation = random_rotation(generator)
      self.assertAlmostEqual(np.linalg.det(rotation), 1.0)
      np.testing.assert_allclose(
          rotation_matrix(models.quaternion_of(rotation)), rotation,
          atol=1e-12)

  def test_replaced_poses_are_read_again_and_points_stay(self):
    with tempfile.TemporaryDirectory() as folder:
      poses = drive(5)
      path = os.path.join(folder, 'images.bin')
      write_images(path, poses)
      size = os.path.getsize(path)
      moved = {name: (r, t + 1.0) for name, (r, t) in poses.items()}
      models.replace_poses(folder, moved)
      self.assertEqual(os.path.getsize(path), size)
      for name, (rotation, translation) in models.read_model(folder).items():
        np.testing.assert_allclose(rotation, moved[name][0], atol=1e-12)
        np.testing.assert_allclose(translation, moved[name][1], atol=1e-12)
      with open(path, 'rb') as file:
        self.assertTrue(file.read().endswith(
            struct.pack('<ddqddq', 1, 2, 3, 4, 5, -1)))


class MergeTrialsTest(unittest.TestCase):

  def shifts(self, level_m, seed=1):
    poses = drive(240)
    moved = merge_trials.disturb(poses, level_m, seed)
    return np.array([models.centre_of(*moved[n]) - models.centre_of(*poses[n])
                     for n in sorted(poses)])

  def test_a_disturbance_is_as_large_as_it_says(self):
    np.testing.assert_allclose(self.shifts(0.0), 0, atol=1e-12)
    for seed in merge_trials.SEEDS:
      sizes = np.linalg.norm(self.shifts(1.0, seed), axis=1)
      aside = np.mean(sizes > 0.6 * merge_trials.OUTLIER_FACTOR)
      self.assertAlmostEqual(aside, merge_trials.OUTLIER_SHARE, delta=0.01)
      self.assertTrue(0.7 < np.median(sizes) < 2.5, np.median(sizes))
    np.testing.assert_allclose(2 * self.shifts(1.0), self.shifts(2.0),
                               atol=1e-9)
    self.assertTrue(np.any(self.shifts(1.0, 1) != self.shifts(1.0, 2)))

  def test_a_fixed_threshold_does_not_adapt(self):
    self.assertNotIn('--AdaSfmAlign.adapt_threshold',
                     merge_trials.options_of('adaptive', True))
    fixed = merge_trials.options_of('0.1', False)
    self.assertEqual(fixed[fixed.index('--AdaSfmAlign.initial_threshold') + 1],
                     '0.1')
    self.assertIn('--AdaSfmMapper.use_priors_in_adjustment', fixed)


class ViewGraphTest(unittest.TestCase):

  def test_packed_values_come_back(self):
    self.assertEqual(view_graph.unpack(view_graph.pack({(3, 4), (0, 12)})),
                     [(0, 12), (3, 4)])
    np.testing.assert_allclose(view_graph.unpack_points(
        view_graph.pack_points([[1.234, -5], [0, 2]])), [[1.23, -5], [0, 2]])
    self.assertEqual(view_graph.unpack(''), [])
    self.assertEqual(view_graph.unpack_points('').shape, (0, 2))

  def test_a_model_is_placed_at_its_first_camera(self):
    truth = drive(6)
    generator = np.random.default_rng(3)
    turn, shift, scale = random_rotation(generator), np.array([1, 2, 3]), 0.5
    moved = {}
    for name, (rotation, translation) in truth.items():
      centre = scale * turn @ models.centre_of(rotation, translation) + shift
      moved[name] = rotation @ turn.T, -rotation @ turn.T @ centre
    placed = view_graph.place_at_first_camera(moved, truth)
    expected = np.array([[scale * 1.5 * k, 0] for k in range(6)])
    np.testing.assert_allclose(placed, expected, atol=1e-9)


class MatchRefinementTest(unittest.TestCase):

  def truth(self, case):
    truth = match_refinement.Truth.__new__(match_refinement.Truth)
    truth.case, truth.width, truth.mirrored = case, 640, {'b', 'c'}
    truth.landmarks = None
    return truth

  def test_landmarks_tell_true_matches(self):
    truth = self.truth('look-alike places')
    truth.landmarks = {'a': np.array([5, 6, -1]), 'b': np.array([6, 5, -1])}
    matches = np.array([[0, 1], [1, 1], [2, 2]])
    are_true = truth.are_true('a', 'b', matches)
    np.testing.assert_array_equal(are_true, [True, False, False])
    self.assertTrue(truth.is_hard('a', 'b', are_true))
    self.assertFalse(truth.is_hard('a', 'b', are_true[:1]))

  def test_matches_of_photos_fit_the_true_poses_outside_the_mirror(self):
    truth = self.truth('mirrored')
    truth.calibration = np.array([[400., 0, 320], [0, 400, 200], [0, 0, 1]])
    angle = np.radians(10) / 2
    turn = rotation_matrix([np.cos(angle), 0, np.sin(angle), 0])
    truth.poses = {'a': (np.eye(3), np.zeros(3)),
                   'b': (turn, np.array([0.3, 0.1, -1.0]))}
    world = np.array([[-3., 1, 9], [-4, -2, 12], [3, 1, 8], [-2, 2, 10]])
    truth.points = {}
    for name, (rotation, translation) in truth.poses.items():
      seen = (world @ rotation.T + translation) @ truth.calibration.T
      truth.points[name] = seen[:, :2] / seen[:, 2:]
    truth.points['b'][3, 1] += 20
    matches = np.array([[k, k] for k in range(4)])
    np.testing.assert_allclose(
        truth.epipolar_errors('a', 'b', matches)[:3], 0, atol=1e-9)
    in_mirror = truth.points['b'][2, 0] >= 320
    self.assertTrue(in_mirror)
    np.testing.assert_array_equal(truth.are_true('a', 'b', matches),
                                  [True, True, False, False])
    self.assertTrue(truth.is_hard('b', 'c', None))
    self.assertFalse(truth.is_hard('a', 'b', None))

  def test_the_sharpest_bend_is_found(self):
    poses = {}
    for k in range(12):
      angle = np.radians(min(max(k - 5, 0), 3) * 20) / 2
      poses['%02d' % k] = (rotation_matrix(
          [np.cos(angle), 0, 0, np.sin(angle)]), np.zeros(3))
    self.assertEqual(match_refinement.sharpest_bend(poses, 4),
                     ['05', '06', '07', '08'])


def run_of(name, method):
  errors = {'translation_rmse_m': 0.1, 'translation_mean_m': 0.08,
            'translation_median_m': 0.07, 'rotation_mean_deg': 0.4,
            'rotation_median_deg': 0.3, 'scale': 1.0}
  return {'set': name, 'method': method, 'seconds': 10.0, 'cpu_seconds': 15.0,
          'evaluation': {'num_images': 49, 'num_true_images': 51,
                         'num_points': 12345, 'mean_track_length': 5.5,
                         'rmse_px': 0.5, 'orientation_median_deg': 0.2,
                         'sim3_least_squares': errors}}


def trial(level_m, seed, with_priors, factor=1.0):
  outcome = {'parts': 6, 'merged': 4, 'inlier_ratios': [0.8] * 6,
             'thresholds_m': [0.3] * 6, 'images': 250, 'coarse_images': 32,
             'separator_rmse_m': 0.1, 'verdict': 'good'}
  record = {'level_m': level_m, 'seed': seed, 'with_priors': with_priors,
            'coarse_rmse_m': level_m}
  for k, threshold in enumerate(merge_trials.THRESHOLDS):
    record[threshold] = dict(outcome, rmse_m=factor * (0.5 - 0.1 * k) * seed)
  return record


def all_records():
  def model(centres):
    return {'images': 3, 'sim3_rmse_m': 0.1, 'se3_rmse_m': 2.0, 'scale': 1.5,
            'centres': centres}

  counts = {'hard': {'pairs': 4, 'matches': 80, 'true': 20},
            'other': {'pairs': 6, 'matches': 100, 'true': 99}}
  gone = dict(counts, hard={'pairs': 0, 'matches': 0, 'true': 0})
  return {
      'view graph': {'truth': '0,0 1,0 2,1', 'visual': '0-1', 'sensors': '0-1 1-2',
                     'removed': '0-2', 'with': [model('0,0 1,0 2,1')],
                     'without': [model('0,0 1,0'), model('2,1')]},
      'refinement, look-alike places': {
          'case': 'look-alike places', 'options': '--num_images 9',
          'before': counts, 'after': gone, 'mapper_after': [],
          'coarse': [{'images': 9, 'rmse_m': 0.013}],
          'mapper_before': [{'images': 3, 'rmse_m': 44.0},
                            {'images': 2, 'rmse_m': 0.1}]},
      'refinement, little texture': {
          'case': 'little texture', 'options': '--num_images 8',
          'error': 'mapper ended with 1'},
      'refinement, mirrored': {
          'case': 'mirrored', 'options': '--render 1', 'before': counts,
          'after': counts, 'mapper_before': [], 'mapper_after': [],
          'coarse': [],
          'example': {'names': ['no.png', 'photo.png'], 'photos': 'gone',
                      'before': '1,2,3,4,0',
                      'after': ''}}}


class PageTest(FolderTest):

  def fill(self, benchmark_stamp=None):
    """Rows of all kinds, and the figures of the other steps."""
    stamp = make_stamp(os.path.join(SCRIPTS, '..', '..'))
    os.makedirs(self.path('out'))
    os.makedirs(self.path('data', 'kitti01-51'))
    ledger = Ledger(self.path('out', 'rows.jsonl'), stamp)
    args = paper_figures.parse_arguments(self.options())
    records = all_records()
    for key in paper_figures.rows_of(args):
      if key.startswith('merge'):
        level, seed = (float(key.split()[1]), int(key.split()[4].strip(',')))
        record = trial(level, seed, ' with priors' in key)
      elif key.startswith('hierarchical'):
        record = run_of('kitti01-51', 'hierarchical_mapper')
      else:
        record = records[key]
      ledger.run(key, lambda: [record])
    self.write('benchmark.json', {
        'stamp': benchmark_stamp or stamp, 'rows': [
            {'key': m, 'date': '2026-11-24', 'records': [run_of(name, m)]}
            for m in ('mapper', 'adasfm_global', 'adasfm', 'colmap4_mapper')
            for name in ('kitti01-51', 'kitti06-51', 'blackout-250')]})
    pairs = {'mean_inlier_ratio': 0.9, 'inlier_ratio_histogram': [0, 0, 1, 30],
             'relative_pose_auc': [{'threshold_deg': 0.5,
                                    'rotation_percent': 59.5,
                                    'translation_percent': 28.8}]}
    self.write('two_view.json', {'stamp': stamp, 'rows': [
        {'date': '2026-11-22', 'records': [
            {'set': 'rendered-60',
             'pairs': {'verified': pairs, 'kept_after': pairs}}]}]})
    write_table(self.path('page.md'), 'page', 'nothing')

  def write(self, name, content):
    with open(self.path(name), 'w') as file:
      json.dump(content, file)

  def options(self):
    return ['--run', '0', '--output_path', self.path('out'), '--data_path',
            self.path('data'), '--table_path', self.path('page.md'),
            '--figures_path', self.path('figures.json'), '--images_path',
            self.path('images'), '--benchmark_path',
            self.path('benchmark.json'), '--two_view_path',
            self.path('two_view.json')]

  def draw(self):
    return subprocess.run(
        [sys.executable, os.path.join(SCRIPTS, 'paper_figures.py'),
         *self.options()], capture_output=True, text=True)

  def test_the_page_has_all_tables_and_pictures(self):
    self.fill()
    result = self.draw()
    self.assertEqual(result.returncode, 0, result.stderr)
    with open(self.path('page.md')) as file:
      text = file.read()
    for line in (
        '| @ 0.5 deg | 59.50 | 28.80 | 59.50 | 28.80 |',
        '| kitti01-51 | COLMAP 3.8 hierarchical_mapper | 49 of 51 | 12,345 | '
        '5.50 | 0.50 | 10.0 | 15.0 |',
        '| kitti01-51 | 51 | 49 | 0.400 | 0.300 | 0.080 | 0.070 | 0.200 | 49 | '
        '0.400 | 0.300 | 0.080 | 0.070 | 0.200 |',
        '| verified pairs only | 2 | 3, 3 | 0.100, 0.100 |',
        '| 0.5 | 0.50 | adaptive | 12 of 18 | 32 | 0.80 | 0.3 | '
        '0.10 (0.10 to 0.10) | '
        '0.400 (0.200 to 0.600) | 0.400 (0.200 to 0.600) |',
        '| look-alike places | look-alike places | after | 0 | - | - | 0.0 | '
        'no model | 9 images, 0.013 m |',
        '3 + 2 images, 44.000, 0.100 m', 'mapper ended with 1'):
      self.assertIn(line, text)
    self.assertIn('not been run on kitti06-51', text)
    self.assertNotIn('blackout-250', text)
    self.assertNotIn(self.folder, text)
    for name in ('paper_inlier_ratios.svg', 'paper_view_graph.png',
                 'paper_merge_trials.svg'):
      size = os.path.getsize(self.path('images', name))
      self.assertTrue(0 < size < 150000, (name, size))
      self.assertIn('../images/' + name, text)
    # A picture of matches needs the photos.
    self.assertIn('left out the picture of matches', result.stdout)
    table = []
    for line in text.split('\n') + ['']:
      if line.startswith('|'):
        table.append(line.count('|'))
      elif table:
        self.assertEqual(len(set(table)), 1, text)
        table = []

  def test_equal_records_give_equal_pictures(self):
    self.fill()
    contents = []
    for _ in range(2):
      self.assertEqual(self.draw().returncode, 0)
      contents.append([])
      for name in sorted(os.listdir(self.path('images'))):
        with open(self.path('images', name), 'rb') as file:
          contents[-1].append(file.read())
    self.assertEqual(*contents)

  def test_runs_of_another_version_are_refused(self):
    self.fill({'sources': 'older', 'machine': 'm'})
    result = self.draw()
    self.assertEqual(result.returncode, 1, result.stdout)
    self.assertIn('run the step readme first', result.stderr)

  def test_the_smallest_error_is_named(self):
    records = [trial(level, seed, with_priors) for seed in (1, 2)
               for level in merge_trials.LEVELS_M
               for with_priors in (False, True)]
    self.assertIn('without priors: adaptive at 0.2 m, 0.5 m',
                  paper_tables.best_thresholds(records))


if __name__ == '__main__':
  unittest.main()
