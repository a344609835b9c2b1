# SPDX-License-Identifier: BSD-3-Clause
"""Tests of scripts/benchmark/session_tables.py and how it cuts drives."""

import os
import sqlite3
import sys
import unittest

SCRIPTS = os.path.join(os.path.dirname(os.path.abspath(__file__)), '..', '..',
                       'scripts', 'benchmark')
sys.path.insert(0, SCRIPTS)

import session_tables as tables  # noqa: E402
from benchmarking import drives  # noqa: E402
from benchmarking.spoil import rotation_about  # noqa: E402
from temporary_folder import FolderTest  # noqa: E402

SECOND_NS = 10**9
NAMES = ['a', 'b', 'c', 'd']


def record(models, num_images=100, **others):
  return {'set': 240, 'cut': 'one', 'num_images': num_images, 'turned_deg': [],
          'final': [{'images': n, 'rmse_m': e} for n, e in models],
          'coarse': [{'images': n, 'rmse_m': e} for n, e in models], **others}


class Folder(FolderTest):

  def write(self, name, lines):
    with open(self.path(name), 'w') as file:
      file.write('\n'.join(lines) + '\n')


class LogsTest(Folder):

  def setUp(self):
    super().setUp()
    # An image every 10 s from 5 s on, a sample every second from 0 s on.
    self.write('times.csv', ['#'] + ['%d,%s' % ((5 + 10 * k) * SECOND_NS, name)
                                     for k, name in enumerate(NAMES)])
    for name in drives.LOGS:
      self.write(name, ['#'] + ['%d,1' % (k * SECOND_NS) for k in range(60)])
    self.write('sensors.yaml', ['cam0:'])

  def seconds(self, *names):
    with open(self.path(*names)) as file:
      times = [int(line.split(',')[0]) for line in file.read().split()[1:]]
    return [times[0] / SECOND_NS, times[-1] / SECOND_NS]

  def test_logs_go_on_for_a_second_and_begin_with_the_source(self):
    drives.copy_logs(self.folder, self.path('s0'), ['a', 'b'])
    drives.copy_logs(self.folder, self.path('s1'), ['c', 'd'])
    for name in drives.LOGS:
      self.assertEqual(self.seconds('s0', name), [0, 16])
      self.assertEqual(self.seconds('s1', name), [24, 36])
    self.assertEqual(self.seconds('s1', 'times.csv'), [25, 35])

  def test_drives_begin_together(self):
    drives.copy_logs(self.folder, self.path('s0'), ['a', 'b'])
    drives.copy_logs(self.folder, self.path('s1'), ['c', 'd'])
    drives.begin_together([self.path('s0'), self.path('s1')])
    self.assertEqual(self.seconds('s0', 'times.csv'), [5, 15])
    self.assertEqual(self.seconds('s1', 'times.csv'), [5, 15])
    self.assertEqual(self.seconds('s1', 'imu.csv'), [4, 16])


class DatabaseTest(Folder):

  def setUp(self):
    super().setUp()
    connection = sqlite3.connect(self.path('database.db'))
    connection.executescript(
        'CREATE TABLE cameras (camera_id INTEGER PRIMARY KEY, model INTEGER);'
        'CREATE TABLE images (image_id INTEGER, name TEXT, camera_id INTEGER);'
        'CREATE TABLE keypoints (image_id INTEGER);'
        'CREATE TABLE descriptors (image_id INTEGER);'
        'CREATE TABLE matches (pair_id INTEGER, rows INTEGER);'
        'CREATE TABLE two_view_geometries (pair_id INTEGER, rows INTEGER);'
        'INSERT INTO cameras VALUES (1, 7)')
    for image_id, name in enumerate(NAMES, 1):
      connection.execute('INSERT INTO images VALUES (?, ?, 1)',
                         (image_id, name))
      connection.execute('INSERT INTO keypoints VALUES (?)', (image_id,))
      for other in range(image_id + 1, len(NAMES) + 1):
        for table in ('matches', 'two_view_geometries'):
          connection.execute('INSERT INTO %s VALUES (?, 20)' % table, (
              image_id * drives.MAX_NUM_IMAGES + other,))
    connection.commit()
    connection.close()

  def select(self, text):
    connection = sqlite3.connect(self.path('database.db'))
    rows = connection.execute(text).fetchall()
    connection.close()
    return rows

  def pairs(self, table):
    return [divmod(pair, drives.MAX_NUM_IMAGES)
            for pair, in self.select('SELECT pair_id FROM ' + table)]

  def test_images_and_pairs_of_one_drive_are_kept(self):
    drives.keep_images(self.path('database.db'), ['a', 'c'])
    self.assertEqual(self.select('SELECT name FROM images'), [('a',), ('c',)])
    self.assertEqual(self.select('SELECT * FROM keypoints'), [(1,), (3,)])
    for table in ('matches', 'two_view_geometries'):
      self.assertEqual(self.pairs(table), [(1, 3)])

  def test_pairs_between_drives_are_kept_and_cameras_differ(self):
    drives.keep_pairs_between(self.path('database.db'),
                              {'s0/': ['a', 'c'], 's1/': ['b', 'd']})
    self.assertEqual(
        self.select('SELECT name, camera_id FROM images'),
        [('s0/a', 2), ('s1/b', 3), ('s0/c', 2), ('s1/d', 3)])
    self.assertEqual(self.select('SELECT * FROM cameras'), [(2, 7), (3, 7)])
    between = [(1, 2), (1, 4), (2, 3), (3, 4)]
    for table in ('matches', 'two_view_geometries'):
      self.assertEqual(self.pairs(table), between)
    self.assertEqual(drives.count_pairs_between(self.path('database.db')), 4)


class CutTest(unittest.TestCase):

  def test_every_image_is_in_one_drive(self):
    names = list(range(161))
    for cut in tables.CUTS.values():
      parts = cut.split(names)
      self.assertEqual(sorted(sum(parts, [])), names)
    first, second = tables.take_in_turn(names)
    self.assertEqual(sorted(first + second), names)
    self.assertEqual(first[-1], 98)
    self.assertEqual(second[:2], [61, 63])

  def test_a_rotation_keeps_its_axis(self):
    axis = (1.0, -2.0, 0.5)
    rotation = rotation_about(axis, 60)
    for row, value in zip(rotation, axis):
      self.assertAlmostEqual(sum(r * a for r, a in zip(row, axis)), value)
    # 1 + 2 cos(60 deg)
    self.assertAlmostEqual(sum(rotation[i][i] for i in range(3)), 2.0)
    turned = rotation_about((0, 0, 1), 90)
    self.assertAlmostEqual(turned[1][0], 1.0)


class ReportTest(unittest.TestCase):

  def test_images_of_models_are_named_unless_one_has_all(self):
    text = tables.drives_table([
        record([(100, 0.02)]), record([(60, 46.2), (40, 0.01)]),
        record([(99, 0.02)]), record([], error='adasfm_mapper ended with 1')])
    for cells in ('1 | 0.020 m | 0.020 m',
                  '2 of 60, 40 images | 46.2, 0.010 m | 46.2, 0.010 m',
                  '1 of 99 images | 0.020 m | 0.020 m',
                  'adasfm_mapper ended with 1 | - | -'):
      self.assertIn('| 240 images | one drive | %s |' % cells, text)


if __name__ == '__main__':
  unittest.main()
