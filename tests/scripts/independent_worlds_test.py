# SPDX-License-Identifier: BSD-3-Clause
"""Tests of scripts/benchmark/independent_worlds.py: the logs and keypoints of
its worlds agree with the truth, and the three commands map one."""

import json
import os
import sqlite3
import subprocess
import sys
import tempfile
import unittest
import unittest.mock

import numpy as np

SCRIPTS = os.path.join(os.path.dirname(os.path.abspath(__file__)), '..', '..',
                       'scripts', 'benchmark')
sys.path.insert(0, SCRIPTS)

import independent_worlds  # noqa: E402
from independent import files, images, motion, streets  # noqa: E402

LAUNCHER = os.environ.get('ADASFM_LAUNCHER')


def rotation_vector(rotation):
  w, *xyz = files.quaternion(rotation)
  return 2.0 * np.sign(w) * np.array(xyz)


def straight_drive(spoil):
  kind = {**independent_worlds.TOWN, 'spoil': spoil, 'num_slips': 0}
  polyline = np.array([[0.0, 0.0], [60.0, 0.0], [60.0, 40.0]])
  return kind, motion.drive(kind, polyline, 10.0, np.random.default_rng(3))


class IndependentWorldsTest(unittest.TestCase):

  def test_gyroscope_turns_as_the_machine_does(self):
    _, moved = straight_drive(0.0)
    wheel_from_imu = np.eye(4)
    wheel_from_imu[:3, :3] = motion.euler(0.1, -0.05, 0.2)
    t, gyro, _ = motion.imu_log(moved, wheel_from_imu, 0.0,
                                np.random.default_rng(1))
    still = t < motion.STANDSTILL_S - 0.1
    gyro = gyro - gyro[still].mean(0)
    rotation = np.eye(3)
    for rate in gyro[:-1]:
      angle = np.linalg.norm(rate) / 200
      axis = rate / np.linalg.norm(rate)
      k = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]],
                    [-axis[1], axis[0], 0]])
      rotation = rotation @ (np.eye(3) + np.sin(angle) * k +
                             (1 - np.cos(angle)) * k @ k)
    rows = np.round(t[[0, -1]] * motion.RATE_HZ).astype(int)
    begin, end = moved.rotation[rows] @ wheel_from_imu[:3, :3]
    error = rotation_vector(rotation.T @ begin.T @ end)
    # Bias estimated from 3 s of noise, applied over 10 s; six sigmas per axis.
    sigma = motion.GYRO_NOISE * np.sqrt(13.0 + 10.0**2 / 3.0)
    self.assertLess(np.abs(error).max(), 6.0 * sigma)
    self.assertGreater(np.linalg.norm(rotation_vector(begin.T @ end)), 1.0)

  def test_accelerometer_feels_gravity_and_the_bend(self):
    _, moved = straight_drive(0.0)
    t, _, force = motion.imu_log(moved, np.eye(4), 0.0,
                                 np.random.default_rng(1))
    rows = np.round(t * motion.RATE_HZ).astype(int)
    world = np.einsum('nij,nj->ni', moved.rotation[rows], force)
    gained = np.sum(world - [0, 0, motion.GRAVITY], axis=0) / 200
    velocity = np.gradient(moved.position, 1.0 / motion.RATE_HZ, axis=0)
    # Biases of 0.04 m/s^2, rotated with the machine.
    self.assertLess(np.abs(gained - velocity[rows[-1]] + velocity[rows[0]]).max(),
                    4.0 * 0.04 * t[-1])

  def test_wheels_are_as_fast_as_their_part_of_the_machine(self):
    kind, moved = straight_drive(1.0)
    t, wheels, _ = motion.wheel_log(moved, kind, np.random.default_rng(1))
    rows = np.round(t * motion.RATE_HZ).astype(int)
    for wheel, side, factor in ((0, 0.5, 1.012), (1, -0.5, 1.008)):
      hub = (moved.position +
             side * motion.TRACK_WIDTH_M * moved.rotation[:, :, 1])
      way = motion.lengths(hub)[rows]
      self.assertAlmostEqual(np.sum(wheels[:, wheel]) / 50 /
                             (factor * (way[-1] - way[0])), 1.0, delta=0.004)

  def test_lenses_agree_near_the_axis_and_bend_at_the_edge(self):
    for model, (_, params) in images.CAMERAS.items():
      points = np.array([[1e-4, 2e-4, 1.0], [0.7, 0.3, 1.0]])
      near, far = images.project(model, points)
      focal = params[0] if model == 'SIMPLE_RADIAL' else np.array(params[:2])
      center = np.array(params[1:3] if model == 'SIMPLE_RADIAL' else params[2:4])
      np.testing.assert_allclose(near, center + focal * points[0, :2], atol=1e-5)
      bend = np.abs(far - center - focal * points[1, :2]).max()
      self.assertEqual(bend > 1.0, model != 'PINHOLE')

  def test_walls_hide_what_is_behind_them(self):
    walls = np.array([[[5.0, -1.0], [5.0, 1.0]]])
    points = np.array([[10.0, 0.0], [4.0, 0.0], [10.0, 3.0], [-10.0, 0.0]])
    self.assertEqual(list(images.hidden(np.zeros(2), points, walls)),
                     [True, False, False, False])

  def test_streets_of_one_template_look_alike(self):
    kind = {**independent_worlds.TOWN, 'alias_classes': 0.5}
    junctions = np.array([[0.0, 0.0], [60.0, 0.0], [60.0, 50.0]])
    for share in (0.0, 0.7):
      landmarks, templates = streets.build_town(
          {**kind, 'alias_share': share}, junctions, [0, 1, 2],
          np.random.default_rng(1))
      self.assertEqual(templates, {(0, 1): 0, (1, 2): 0})
      twice = len(landmarks.looks) - len(np.unique(landmarks.looks))
      self.assertAlmostEqual(2.0 * twice / len(landmarks.looks), share**2,
                             delta=0.1)

  @unittest.skipUnless(LAUNCHER, 'needs the launcher')
  def test_three_commands_map_a_world(self):
    with tempfile.TemporaryDirectory() as folder:
      path = lambda name: os.path.join(folder, 'world', name)
      with unittest.mock.patch.object(sys, 'argv', [
          'x', '--output_path', path(''), '--num_images', '24', '--colmap',
          LAUNCHER, '--camera_model', 'SIMPLE_RADIAL']):
        independent_worlds.main()
      with open(path('world.json')) as file:
        self.assertEqual(json.load(file)['num_images'], 24)
      database = sqlite3.connect(path('database.db'))
      rows, = database.execute('SELECT COUNT(*) FROM keypoints').fetchone()
      database.close()
      self.assertEqual(rows, 24)
      for command, *arguments in (
          ('prior_importer', '--image_times_path', path('times.csv'),
           '--imu_path', path('imu.csv'), '--wheel_path', path('wheel.csv'),
           '--sensors_path', path('sensors.yaml')),
          ('global', '--output_path', path('g')),
          ('mapper', '--input_path', path('g/0'), '--output_path', path('m'))):
        subprocess.run([LAUNCHER, 'adasfm_' + command, '--database_path',
                        path('database.db'), *arguments], check=True,
                       capture_output=True)
      subprocess.run([LAUNCHER, 'adasfm_evaluator', '--input_path', path('m'),
                      '--ground_truth_path', path('gt.txt'), '--json_path',
                      path('e.json')], check=True, capture_output=True)
      with open(path('e.json')) as file:
        evaluation = json.load(file)
      self.assertEqual(evaluation['num_images'], 24)
      self.assertLess(
          evaluation['sim3_least_squares']['translation_rmse_m'], 0.1)


if __name__ == '__main__':
  unittest.main()
