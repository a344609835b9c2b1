# SPDX-License-Identifier: BSD-3-Clause
"""Tests of scripts/benchmark/global_without_sensors.py."""

import argparse
import os
import sys
import unittest

SCRIPTS = os.path.join(os.path.dirname(os.path.abspath(__file__)), '..', '..',
                       'scripts', 'benchmark')
sys.path.insert(0, SCRIPTS)

import global_without_sensors as tables  # noqa: E402


def figures(rmse_m, images=10):
  return {'images': images, 'true_images': 10, 'rmse_m': rmse_m, 'scale': 1.0}


def record(coarse, suspected, final, mapper):
  return {'world': 'clean', 'seed': 1, 'coarse': [figures(e) for e in coarse],
          'suspected': suspected, 'final': figures(final),
          'mapper': figures(mapper)}


class GlobalWithoutSensorsTest(unittest.TestCase):

  def test_every_model_of_a_run_can_be_folded(self):
    records = [record([0.1, 5.0], [False, True], 0.1, 0.1),
               record([0.1, 7.0], [True, False], 0.1, 0.1), {'error': 'x'}]
    self.assertEqual(tables.count_folded(records), (2, 1))

  def test_the_largest_model_counts(self):
    records = [record([0.1, 5.0], [False, False], 0.2, 0.1),
               dict(record([0.3], [False], 0.1, 0.4), final=figures(0.1, 7))]
    self.assertEqual(tables.summarise(records, 'coarse'),
                     ['10/10', '0.200', '0.300'])
    self.assertEqual(tables.summarise(records, 'final')[0], '7/10')
    self.assertEqual(tables.ratio_to_mapper(records), '1.125 (0.250 to 2.000)')
    self.assertEqual(tables.summarise([{}], 'mapper'), ['-', '-', '-'])

  def test_report_has_equal_columns_in_each_table(self):
    args = argparse.Namespace(worlds=['clean', 'fisheye'], num_images=10,
                              seeds=[1], figures_path='/folder/figures.json')
    text = tables.report([record([0.1], [False], 0.1, 0.1)], args)
    self.assertNotIn('/folder', text)
    for table in text.split('\n\n')[2:]:
      columns = {line.count('|') for line in table.strip().split('\n')
                 if line.startswith('|')}
      self.assertEqual(len(columns), 1, table)


if __name__ == '__main__':
  unittest.main()
