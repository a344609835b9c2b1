# SPDX-License-Identifier: BSD-3-Clause
"""Tests of the tables of photos, faults, forty seeds and verdicts, made from
given records."""

import argparse
import os
import struct
import sys
import tempfile
import unittest

SCRIPTS = os.path.join(os.path.dirname(os.path.abspath(__file__)), '..', '..',
                       'scripts', 'benchmark')
sys.path.insert(0, SCRIPTS)

import fault_tables  # noqa: E402
import photo_tables  # noqa: E402
import stress_worlds  # noqa: E402
import verdict_table  # noqa: E402
from benchmarking.process import Usage  # noqa: E402
from verdict_table import Errors, Run  # noqa: E402


class PhotosTest(unittest.TestCase):

  def test_a_row_has_what_there_is_of_all_models(self):
    temporary = tempfile.TemporaryDirectory()
    self.addCleanup(temporary.cleanup)
    folder = temporary.name
    for name, images, points in (('0', 7, 70), ('1', 9, 90)):
      os.mkdir(os.path.join(folder, name))
      for file, number in (('images.bin', images), ('points3D.bin', points)):
        with open(os.path.join(folder, name, file), 'wb') as stream:
          stream.write(struct.pack('<Q', number))
    result = photo_tables.outcome(folder, folder, Usage(1.0, 2.4, 100.0), None,
                                  None)
    self.assertEqual(result['images'], [9, 7])
    self.assertEqual(result['points'], 90)
    self.assertEqual(
        photo_tables.row('lund-29', 'm', result, 20),
        '| lund-29 | m | 9 + 7 of 20 | 90 | no truth |  | 2 | 100 |')

  def test_no_model_is_told(self):
    self.assertIn('no model: mapper ended with 1', photo_tables.row(
        'lund-29', 'm', {'error': 'mapper ended with 1'}, 20))


class FaultsTest(unittest.TestCase):

  def test_wrong_trials_are_counted_apart(self):
    lines = fault_tables.campaign_table(
        [{'campaign': 'kills', 'counts': {'killed': 198, 'WRONG': 2}}])
    self.assertTrue(lines[-1].endswith('| 200: 198 killed | 2 |'), lines[-1])

  def test_errors_are_set_against_the_clean_log(self):
    runs = [{'spoilt': name, 'seed': seed, 'named': seed,
             'errors': {'shape_m': 0.02 if name == 'nothing' else 0.03}}
            for name in fault_tables.SPOILT for seed in (7, 8)]
    lines = fault_tables.spoilt_table(runs)
    self.assertIn('| nothing | 0.020 m | 0.020 m | 7, 8 |', lines)
    self.assertIn('0.030 m, 1.50', lines[-1])

  def test_samples_that_warnings_name_are_counted(self):
    self.assertEqual(fault_tables.count_named('\n'.join((
        'd/imu.csv has 90 samples',
        'WARNING: d/imu.csv, line 9: 1 sample is a spike, far from 4; left out',
        'WARNING: d/imu.csv, lines 3-6: 4 samples repeat the same reading',
        'WARNING: d/imu.csv, lines 3-4: 20 samples are all zero (0.1 s)',
        'WARNING: d/imu.csv, line 7: first of 4 places where samples are '
        'missing, 25 of 90 in all (28 %)',
        'WARNING: d/wheel.csv, line 9: 1 sample is a spike'))), 50)


class SeedsTest(unittest.TestCase):

  def test_each_verdict_is_counted_and_worlds_not_made_too(self):
    world = {'alias_pair_ratio': 0.3, 'num_images_with_false_pairs': 9}
    records = [
        {'dial': 'parallel streets', 'seed': 1, 'world': world,
         'with': {'verdict': 'whole', 'rmse_m': 0.1}},
        {'dial': 'parallel streets', 'seed': 2, 'world': world,
         'with': {'verdict': 'BEYOND THE BAR, SILENT', 'rmse_m': 3.0}},
        {'dial': 'parallel streets', 'seed': 3, 'error': 'too many'}]
    text = stress_worlds.report_summary(records, argparse.Namespace(
        dials=['parallel streets'], seeds='1-3', runs='with'))
    self.assertIn('| imu+wheel | 1 | 0 | 0 | 1 | 1 | 1.550, 3.000 |', text)
    self.assertIn('without a word: 1 of 2 models', text)


class VerdictsTest(unittest.TestCase):

  def judge(self, metric_m, scale=1.0, shape_m=0.01):
    """Judges a model with the verdict "good", a stated scale sigma of 2 % and
    limits of 1 cm."""
    limit = Errors(0.01, 0.01, None, None)
    return verdict_table.judge(Run('good', '', Errors(
        shape_m, metric_m, scale, 0.02), limit, limit))

  def test_good_is_wrong_by_metres_shape_or_sigmas(self):
    self.assertFalse(self.judge(0.029).wrong)
    self.assertTrue(self.judge(0.031).wrong)
    self.assertTrue(self.judge(0.029, shape_m=0.031).wrong)
    self.assertTrue(self.judge(0.029, scale=1.08).wrong)


if __name__ == '__main__':
  unittest.main()
