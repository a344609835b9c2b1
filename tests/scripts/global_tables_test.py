# SPDX-License-Identifier: BSD-3-Clause
"""Tests of scripts/benchmark/global_tables.py."""

import argparse
import os
import sys
import unittest

SCRIPTS = os.path.join(os.path.dirname(os.path.abspath(__file__)), '..', '..',
                       'scripts', 'benchmark')
sys.path.insert(0, SCRIPTS)

import global_tables  # noqa: E402


def figures(rmse_m, images=10):
  return {'images': images, 'true_images': 10, 'rmse_m': rmse_m, 'scale': 1.02,
          'rotation_mean_deg': 0.1}


def pair_set(num_matches, num_true):
  return {'num_pairs': 4, 'num_false_pairs': 1, 'num_matches': num_matches,
          'num_true_matches': num_true, 'mean_inlier_ratio': 0.5,
          'inlier_ratio_histogram': [0, 1, 3, 0],
          'relative_pose_auc': [{'threshold_deg': 1.0, 'rotation_percent': 90.0,
                                 'translation_percent': 80.0}]}


class GlobalTablesTest(unittest.TestCase):

  def test_ablations_switch_one_option_off(self):
    self.assertEqual(global_tables.options_of('as it is'), [])
    self.assertEqual(global_tables.options_of('no loop gating'),
                     ['--AdaSfmGlobal.use_loop_gating', '0'])
    self.assertEqual(global_tables.options_of('without sensors'), [])

  def test_missing_images_and_large_errors_are_failures(self):
    self.assertFalse(global_tables.failed(figures(0.1)))
    self.assertTrue(global_tables.failed(figures(0.6)))
    self.assertTrue(global_tables.failed(figures(0.1, images=9)))
    self.assertTrue(global_tables.failed(None))

  def test_summary_counts_runs_without_a_model(self):
    records = [{'coarse': figures(e)} for e in (0.1, 0.3, 0.8)] + [{}]
    self.assertEqual(global_tables.summarise(records, 'coarse'),
                     '0.300 | 0.800 | 2.00 | 2')
    self.assertEqual(global_tables.summarise([{}], 'coarse'), '- | - | - | 1')

  def test_report_has_equal_columns_in_each_table(self):
    pairs = {'num_true_raw_matches': 100, 'verified': pair_set(100, 90),
             'kept_before': pair_set(95, 90), 'kept_after': pair_set(96, 95)}
    records = [{'world': 'w', 'variant': variant, 'coarse': figures(0.1),
                'final': figures(0.05), 'unsuspected': True}
               for variant in ('as it is', 'no loop gating')]
    records[0]['pairs'] = pairs
    args = argparse.Namespace(variants=['as it is', 'no loop gating'],
                              mapper_variants=['as it is'], sizes=[150],
                              seeds=[1], num_blackouts=1,
                              figures_path='/folder/figures.json')
    text = global_tables.report(records, args)
    table = []
    for line in text.split('\n') + ['']:
      if line.startswith('|'):
        table.append(line.count('|') - line.count(': R | t'))
      elif table:
        columns = [c for c in table[1:]]
        self.assertEqual(len(set(columns)), 1, text)
        table = []
    self.assertIn('| kept, refined | 4 | 1 | 96 | 98.96 | 95.00 | 50.0 |', text)
    self.assertIn('`figures.json`', text)
    self.assertIn('| @ 1 deg | 90.00 | 80.00 |', text)


if __name__ == '__main__':
  unittest.main()
