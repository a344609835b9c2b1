# SPDX-License-Identifier: BSD-3-Clause
"""Tests of scripts/clean_database.sh and scripts/drop_weak_joins.py.
ADASFM_LAUNCHER names our `colmap`."""

import json
import os
import sqlite3
import subprocess
import sys
import tempfile
import unittest

SCRIPTS = os.path.join(os.path.dirname(os.path.abspath(__file__)), '..', '..',
                       'scripts')
sys.path.insert(0, SCRIPTS)

from drop_weak_joins import MAX_NUM_IMAGES, find_weak_joins  # noqa: E402
from mapper_start import count_parts, options_of  # noqa: E402


def sequence(first, last, num_matches=100):
  """Each image with the next three."""
  return {i * MAX_NUM_IMAGES + j: num_matches
          for i in range(first, last + 1)
          for j in range(i + 1, min(last, i + 3) + 1)}


def pair(first, second):
  return first * MAX_NUM_IMAGES + second


class WeakJoinsTest(unittest.TestCase):

  def test_few_matches_between_two_parts_go(self):
    pairs = {**sequence(1, 20), **sequence(30, 60)}
    joins = {pair(19, 31): 33, pair(20, 31): 33, pair(20, 32): 19}
    pairs.update(joins)
    self.assertEqual(find_weak_joins(pairs, 150, 10), set(joins))

  def test_enough_matches_stay(self):
    pairs = {**sequence(1, 20), **sequence(30, 60)}
    pairs.update({pair(i, j): 30 for i in (18, 19, 20) for j in (30, 31, 32)})
    self.assertEqual(find_weak_joins(pairs, 150, 10), set())

  def test_small_parts_and_sparse_sequences_stay(self):
    pairs = {**sequence(1, 20), **sequence(30, 36)}
    pairs[pair(20, 30)] = 20
    self.assertEqual(find_weak_joins(pairs, 150, 10), set())
    self.assertEqual(find_weak_joins(sequence(1, 50, 40), 150, 10), set())


class MapperStartTest(unittest.TestCase):

  def test_parts_that_the_mapper_keeps_count(self):
    self.assertEqual(count_parts(sequence(1, 20)), 1)
    pairs = {**sequence(1, 20), **sequence(30, 60), **sequence(70, 75)}
    self.assertEqual(count_parts(pairs), 2)
    pairs[pair(20, 30)] = 20
    self.assertEqual(count_parts(pairs), 1)

  def test_the_pair_is_named_with_half_of_its_angle(self):
    start = {'image_id1': 22, 'image_id2': 30, 'parallax_deg': 3.0}
    self.assertEqual(
        options_of(start),
        '--Mapper.init_image_id1 22 --Mapper.init_image_id2 30 '
        '--Mapper.init_max_forward_motion 1 --Mapper.init_min_tri_angle 1.5 '
        '--Mapper.multiple_models 0')


class CleanDatabaseTest(unittest.TestCase):

  def setUp(self):
    self.launcher = os.environ.get('ADASFM_LAUNCHER')
    if not self.launcher:
      self.skipTest('ADASFM_LAUNCHER is not set')

  def call(self, *command):
    result = subprocess.run(command, capture_output=True, text=True,
                            env=dict(os.environ, COLMAP=self.launcher))
    self.assertEqual(result.returncode, 0, result.stdout + result.stderr)

  def test_false_pairs_go_and_the_original_stays(self):
    with tempfile.TemporaryDirectory() as folder:
      database = os.path.join(folder, 'database.db')
      cleaned = os.path.join(folder, 'cleaned.db')
      self.call(self.launcher, 'adasfm_synthesizer', '--output_path', folder,
                '--num_images', '100', '--alias_ratio', '0.05')
      with open(database, 'rb') as file:
        before = file.read()
      self.call(os.path.join(SCRIPTS, 'clean_database.sh'), database, cleaned,
                folder)
      with open(database, 'rb') as file:
        self.assertEqual(file.read(), before)

      def pairs(path):
        return {row[0] for row in sqlite3.connect(path).execute(
            'SELECT pair_id FROM two_view_geometries WHERE rows > 0')}
      raw, clean = pairs(database), pairs(cleaned)
      # False pairs are removed; true ones stay except some with few matches.
      self.assertTrue(clean < raw)
      self.assertGreater(len(clean), 0.85 * len(raw))
      self.assertTrue(os.path.isfile(cleaned + '.coarse/0/images.bin'))
      # COLMAP's mapper gets its initial pair, or finds one itself.
      with open(cleaned + '.coarse/summary.json') as file:
        start = json.load(file)['models'][0]['mapper_start']
      with open(cleaned + '.options') as file:
        self.assertEqual(bool(file.read()), start['must_be_told'])
      self.assertGreaterEqual(start['matches'], 100)
      # An existing copy is not overwritten.
      again = subprocess.run(
          [os.path.join(SCRIPTS, 'clean_database.sh'), database, cleaned],
          capture_output=True, text=True)
      self.assertEqual(again.returncode, 1)


if __name__ == '__main__':
  unittest.main()
