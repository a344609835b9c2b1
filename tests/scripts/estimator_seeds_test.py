# SPDX-License-Identifier: BSD-3-Clause
"""Tests of scripts/benchmark/estimator_seeds.py."""

import argparse
import os
import stat
import sys
import tempfile
import unittest
import unittest.mock

SCRIPTS = os.path.join(os.path.dirname(os.path.abspath(__file__)), '..', '..',
                       'scripts', 'benchmark')
sys.path.insert(0, SCRIPTS)

import estimator_seeds  # noqa: E402

# Writes the files that the real commands would write: a world of two samples,
# summaries, and an error that differs between the models.
LAUNCHER = '''#!%s
import json, os, sys
value = dict(zip(sys.argv[2::2], sys.argv[3::2]))
def write(path, text):
  os.makedirs(os.path.dirname(path), exist_ok=True)
  with open(path, 'w') as file:
    file.write(text)
if sys.argv[1] == 'adasfm_synthesizer':
  folder = value['--output_path'] + '/'
  write(folder + 'imu.csv', '#t\\n0,0,0,0,0,0,9.81\\n5000000000,0,0,0,0,0,9.81\\n')
  write(folder + 'wheel.csv', '#t\\n0,1,1\\n5000000000,1,1\\n')
  write(folder + 'sensors.yaml', 'gyroscope_noise_density: 0.001\\n')
elif sys.argv[1] == 'adasfm_mapper':
  write(value['--output_path'] + '/summary.json', json.dumps(
      {'num_images': 200, 'keypoint_sigma_px': 0.5, 'prior_chi2_per_dof': 1.0}))
elif sys.argv[1] == 'adasfm_evaluator':
  name = os.path.basename(value['--input_path'])
  error = {'0': 0.04, 'with': 0.02, 'without': 0.1, 'limit': 0.02,
           'limit_without': 0.1}[name]
  write(value['--json_path'], json.dumps(
      {'sim3_least_squares': {'translation_rmse_m': error}}))
''' % sys.executable


def record(error_m=0.02, chi2=1.0):
  return {'kind': 'clean', 'seed': 1, 'num_images': 200, 'images': 200,
          'coarse': 0.04, 'with': error_m, 'without': 0.1, 'limit': 0.02,
          'limit_without': 0.1, 'chi2': chi2, 'keypoint_sigma_px': 0.5}


class EstimatorSeedsTest(unittest.TestCase):

  def test_world_is_run_from_the_coarse_model_and_from_the_truth(self):
    with tempfile.TemporaryDirectory() as folder:
      launcher = os.path.join(folder, 'colmap')
      with open(launcher, 'w') as file:
        file.write(LAUNCHER)
      os.chmod(launcher, os.stat(launcher).st_mode | stat.S_IXUSR)
      with unittest.mock.patch.object(estimator_seeds, 'write_true_poses'):
        self.assertEqual(
            estimator_seeds.run_world(launcher, os.path.join(folder, 'world'),
                                      'clean', 1), record())

  def test_report_counts_what_keeps_the_bars(self):
    args = argparse.Namespace(kinds=['clean'], seeds=[1])
    text = estimator_seeds.report(
        [record(), record(error_m=0.2), record(chi2=1.3),
         {'kind': 'clean', 'seed': 2, 'error': 'ERROR: no model'}], args)
    self.assertIn('1.02 of the error without: 2 of 4;', text)
    self.assertIn('1.1 of the limit with them: 2 of 4;', text)
    self.assertIn('within 0.8 to 1.25: 2 of 4.', text)
    rows = [line for line in text.splitlines() if line.startswith('|')]
    self.assertEqual({row.count('|') for row in rows}, {12})


if __name__ == '__main__':
  unittest.main()
