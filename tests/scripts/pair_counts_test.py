# SPDX-License-Identifier: BSD-3-Clause
"""Tests of scripts/benchmark/benchmarking/pair_counts.py."""

import os
import sqlite3
import struct
import sys
import tempfile
import unittest

import numpy as np

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)),
                                '..', '..', 'scripts', 'benchmark'))

from benchmarking import pair_counts  # noqa: E402

# Cameras that look along z and stand on the x axis, x by name [m].
CENTERS = {'a': 0.0, 'b': 1.0, 'c': 2.0, 'far': 100.0}
IDENTITY = (1.0, 0.0, 0.0, 0.0)


def turned(angle_deg):
  half = np.radians(angle_deg) / 2
  return (np.cos(half), 0.0, np.sin(half), 0.0)


def direction(angle_deg):
  angle = np.radians(angle_deg)
  return (-np.cos(angle), np.sin(angle), 0.0)


class PairCountsTest(unittest.TestCase):

  def setUp(self):
    self._folder = tempfile.TemporaryDirectory()
    self.folder = self._folder.name
    with open(os.path.join(self.folder, 'gt.txt'), 'w') as file:
      file.write('# name q t\n')
      for name, x in CENTERS.items():
        file.write('%s 1 0 0 0 %g 0 0\n' % (name, -x))

  def tearDown(self):
    self._folder.cleanup()

  def write(self, name, pairs):
    """pairs: {(name, name): (qvec, tvec, matches[, E])}; returns the path."""
    path = os.path.join(self.folder, name)
    database = sqlite3.connect(path)
    database.execute('CREATE TABLE images (image_id INTEGER, name TEXT)')
    database.execute('CREATE TABLE two_view_geometries (pair_id INTEGER, '
                     'rows INTEGER, data BLOB, E BLOB, qvec BLOB, tvec BLOB)')
    ids = {image: i + 1 for i, image in enumerate(CENTERS)}
    database.executemany('INSERT INTO images VALUES (?, ?)',
                         [(i, image) for image, i in ids.items()])
    for (first, second), (qvec, tvec, matches, *essential) in pairs.items():
      database.execute(
          'INSERT INTO two_view_geometries VALUES (?, ?, ?, ?, ?, ?)',
          (2147483647 * ids[first] + ids[second], len(matches),
           np.array(matches, dtype=np.uint32).tobytes(),
           struct.pack('<9d', *essential[0].flat) if essential else None,
           qvec and struct.pack('<4d', *qvec),
           tvec and struct.pack('<3d', *tvec)))
    database.commit()
    database.close()
    return path

  def count(self, verified, cleaned):
    return pair_counts.count_pairs(self.write('verified.db', verified),
                                   self.write('cleaned.db', cleaned),
                                   self.folder)

  def test_distance_tells_false_pairs_without_landmarks(self):
    matches = [(0, 0)]
    pairs = {('a', 'b'): (IDENTITY, direction(0), matches),
             ('a', 'far'): (IDENTITY, direction(0), matches),
             ('b', 'far'): (IDENTITY, direction(0), matches)}
    kept = {key: pairs[key] for key in [('a', 'b'), ('b', 'far')]}
    self.assertEqual(self.count(pairs, kept), {
        'true': 1, 'true_lost': 0, 'right_lost': 0, 'wrong': 0, 'wrong_kept': 0,
        'false': 2, 'false_kept': 1})

  def test_only_lost_pairs_of_right_pose_count_as_right(self):
    matches = [(0, 0)]
    poses = {('a', 'b'): (turned(0.5), direction(5)),
             ('a', 'c'): (turned(2.0), direction(0)),
             ('b', 'c'): (IDENTITY, direction(15))}
    pairs = {key: (*pose, matches) for key, pose in poses.items()}
    counts = self.count(pairs, {})
    self.assertEqual((counts['true_lost'], counts['right_lost']), (3, 1))

  def test_pairs_of_wrong_pose_count_as_kept_with_matches(self):
    matches = [(0, 0)]
    pairs = {('a', 'b'): (IDENTITY, direction(0), matches),
             ('a', 'c'): (turned(4.0), direction(0), matches),
             ('b', 'c'): (IDENTITY, direction(40), matches)}
    kept = {key: pairs[key] for key in [('a', 'b'), ('a', 'c')]}
    counts = self.count(pairs, kept)
    self.assertEqual((counts['wrong'], counts['wrong_kept'],
                      counts['true_lost'], counts['right_lost']), (2, 1, 1, 0))

  def test_a_pair_without_a_pose_is_lost_and_not_of_right_pose(self):
    for pose in ((None, None), (IDENTITY, (0.0, 0.0, 0.0))):
      with self.subTest(pose=pose):
        for name in ('verified.db', 'cleaned.db'):
          if os.path.exists(os.path.join(self.folder, name)):
            os.remove(os.path.join(self.folder, name))
        counts = self.count({('a', 'b'): (*pose, [(0, 0)])}, {})
        self.assertEqual((counts['true_lost'], counts['right_lost']), (1, 0))

  def test_the_best_pose_of_an_essential_matrix_counts(self):
    matches = [(0, 0)]
    pairs = {}
    for names, angle in ((('a', 'b'), 0.5), (('a', 'c'), 4.0)):
      x, y, z = direction(5)
      cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
      essential = -3 * cross @ pair_counts.rotation_matrix(
          np.array(turned(angle)))
      pairs[names] = (None, None, matches, essential)
    counts = self.count(pairs, {})
    self.assertEqual((counts['true'], counts['right_lost'], counts['wrong']),
                     (2, 1, 1))

  def test_landmarks_tell_false_pairs_nearby(self):
    with open(os.path.join(self.folder, 'landmarks.txt'), 'w') as file:
      file.write('a 7 8 -1\nb 7 8 -1\nc 9 8 -1\n')
    matches = [(0, 0), (1, 1), (2, 2)]
    pair = IDENTITY, direction(0), matches
    counts = self.count({('a', 'b'): pair, ('a', 'c'): pair},
                        {('a', 'c'): (IDENTITY, direction(0), [(1, 1)])})
    # One of three matches of a and c is true; after refinement only it remains.
    self.assertEqual(counts, {'true': 1, 'true_lost': 1, 'right_lost': 1,
                              'wrong': 0, 'wrong_kept': 0, 'false': 1,
                              'false_kept': 0})


if __name__ == '__main__':
  unittest.main()
