# SPDX-License-Identifier: BSD-3-Clause
"""Tests of scripts/benchmark/benchmark.py. ADASFM_LAUNCHER: our `colmap`."""

import glob
import json
import math
import os
import re
import subprocess
import sys
import tempfile
import unittest

SCRIPTS = os.path.join(os.path.dirname(os.path.abspath(__file__)), '..', '..',
                       'scripts', 'benchmark')
sys.path.insert(0, SCRIPTS)

from benchmarking import sets, tables  # noqa: E402
from benchmarking.process import Failed, run  # noqa: E402
from benchmarking.trajectories import quaternion_product, rotate  # noqa: E402


def record(name, method, seconds, error_m=0.1):
  errors = {'translation_rmse_m': error_m, 'scale': 1.0}
  return {'set': name, 'method': method, 'seconds': seconds,
          'cpu_seconds': seconds, 'peak_mib': 100,
          'evaluation': {'num_images': 10, 'num_true_images': 10,
                         'num_points': 5, 'mean_track_length': 3.0,
                         'rmse_px': 0.5, 'sim3': errors,
                         'sim3_least_squares': errors,
                         'se3_least_squares': errors,
                         'orientation_median_deg': 0.01}}


class TablesTest(unittest.TestCase):

  def test_exponent_of_a_power_law(self):
    for power in (0.5, 1.0, 1.7):
      points = [(n, 3.0 * n ** power) for n in (250, 500, 1000, 4000)]
      self.assertAlmostEqual(tables.exponent(points), power)

  def test_the_middle_of_repeated_runs_counts(self):
    records = [record('clean-250', 'mapper', s) for s in (30.0, 10.0, 14.0)]
    records.append(dict(record('clean-250', 'mapper', 1.0), evaluation=None))
    middle = tables.middle_runs(records)[('clean-250', 'mapper')]
    self.assertEqual(middle['seconds'], 14.0)

  def test_ratios_are_those_to_the_limit_of_the_same_set(self):
    table = tables.long_table([record('clean-250', 'adasfm', 30.0, 0.12),
                               record('clean-250', 'limit', 10.0, 0.10),
                               record('clean-500', 'limit', 99.0, 9.0)])
    line = [l for l in table.splitlines() if '**AdaSfM**' in l][0]
    self.assertTrue(line.endswith('| 1.20 | 3.00 |'), line)

  def test_a_run_without_a_model_says_why(self):
    failed = dict(record('clean-250', 'mapper', 0.0), evaluation=None,
                  error='mapper took more than 5 s')
    table = tables.long_table([failed])
    self.assertIn('mapper took more than 5 s', table)
    columns = {line.count('|') for line in table.splitlines()}
    self.assertEqual(len(columns), 1, table)

  def test_ablations_have_a_line_per_variant_and_a_cell_per_set(self):
    records = [record('clean-250', 'adasfm', 30.0, 0.12),
               record('clean-250', 'adasfm_no_candidates', 20.0, 0.5),
               record('alias-300', 'adasfm', 9.0, 0.03),
               record('alias-300', 'mapper', 9.0, 50.0)]
    records[2]['coarse_evaluation'] = records[1]['evaluation']
    lines = tables.ablation_table(records).splitlines()
    self.assertEqual(len(lines), 4)
    self.assertIn('0.030 m (coarse 0.500), 9 s |', lines[2])
    self.assertEqual(lines[0], '| variant | clean-250 | alias-300 |')
    self.assertEqual(lines[3], '| adasfm_no_candidates | 10/10, 0.500 m, 20 s '
                               '| - |')
    self.assertEqual(tables.ablation_table(records[3:]), '')


class ProcessTest(unittest.TestCase):

  def test_usage_timeout_and_failure(self):
    with tempfile.NamedTemporaryFile() as log:
      usage = run([sys.executable, '-c',
                   'x = b"1" * 200 * 2 ** 20; print(len(x))'], log.name)
      self.assertGreater(usage.peak_mib, 200)
      with self.assertRaisesRegex(Failed, 'took more than'):
        run(['/bin/sleep', '60'], log.name, timeout=0.2)
      with self.assertRaisesRegex(Failed, 'ended with 3'):
        run([sys.executable, '-c', 'raise SystemExit(3)'], log.name)


class RotationTest(unittest.TestCase):

  def test_products_turn_in_the_right_order(self):
    half = math.sqrt(0.5)
    about_x, about_z = (half, half, 0, 0), (half, 0, 0, half)
    both = rotate(quaternion_product(about_z, about_x), (0, 1, 0))
    for value, expected in zip(both, rotate(about_z, (0, 0, 1))):
      self.assertAlmostEqual(value, expected)


class WholeBenchmarkTest(unittest.TestCase):

  def test_runs_of_a_small_world(self):
    launcher = os.environ.get('ADASFM_LAUNCHER')
    if not launcher:
      self.skipTest('ADASFM_LAUNCHER is not set')
    with tempfile.TemporaryDirectory() as folder:
      command = [sys.executable, os.path.join(SCRIPTS, 'benchmark.py'),
                 'clean-50', '--methods', 'adasfm,limit', '--colmap', launcher,
                 '--output_path', folder]
      result = subprocess.run(command, capture_output=True, text=True)
      self.assertEqual(result.returncode, 0, result.stderr)
      with open(os.path.join(folder, 'results.json')) as file:
        records = {r['method']: r for r in json.load(file)['records']}
      self.assertEqual(set(records), {'priors_only', 'adasfm_global', 'adasfm',
                                      'limit'})
      for method, r in records.items():
        self.assertEqual(r['evaluation']['num_images'], 50, method)
      # Keypoints of 0.5 px on tracks of ten images leave centimetres.
      for method in ('adasfm', 'limit'):
        self.assertLess(tables.sim3_error(records[method]), 0.1, method)
      with open(os.path.join(folder, 'results.md')) as file:
        self.assertIn('**AdaSfM**', file.read())

  def test_a_peer_runs_on_the_raw_and_on_the_cleaned_database(self):
    launcher = os.environ.get('ADASFM_LAUNCHER')
    if not launcher:
      self.skipTest('ADASFM_LAUNCHER is not set')
    with tempfile.TemporaryDirectory() as folder:
      # A peer that only prints the number of verified pairs in its database.
      peer = os.path.join(folder, 'peer')
      with open(peer, 'w') as file:
        file.write('#!%s\nimport sqlite3, sys\n'
                   'database = sys.argv[sys.argv.index("--database_path") + 1]\n'
                   'print("pairs", sqlite3.connect(database).execute('
                   '"SELECT COUNT(*) FROM two_view_geometries")'
                   '.fetchone()[0])\n' % sys.executable)
      os.chmod(peer, 0o755)
      command = [sys.executable, os.path.join(SCRIPTS, 'benchmark.py'),
                 'alias-100', '--methods', 'adasfm', '--colmap', launcher,
                 '--peer', 'raw=%s:count' % peer,
                 '--peer', 'clean=%s:count:cleaned' % peer,
                 '--output_path', folder]
      result = subprocess.run(command, capture_output=True, text=True)
      self.assertEqual(result.returncode, 0, result.stderr)
      pairs = {}
      for method in ('raw', 'clean'):
        with open(glob.glob(os.path.join(folder, 'runs-*', 'alias-100', method,
                                         'run.log'))[0]) as log:
          pairs[method] = int(re.search(r'pairs (\d+)', log.read()).group(1))
      self.assertLess(pairs['clean'], pairs['raw'])
      with open(os.path.join(folder, 'results.json')) as file:
        records = {r['method']: r for r in json.load(file)['records']}
      self.assertEqual(set(records['clean']['step_seconds']),
                       {'clean', 'count'})
      self.assertGreater(records['clean']['peak_mib'], 0)

  def test_an_unknown_set_or_method_is_refused(self):
    for arguments in (['nowhere-1'], ['clean-50', '--methods', 'magic'],
                      ['clean-50', '--peer', 'x']):
      result = subprocess.run(
          [sys.executable, os.path.join(SCRIPTS, 'benchmark.py')] + arguments,
          capture_output=True, text=True)
      self.assertEqual(result.returncode, 2, arguments)

  def test_quick_and_full_sets_are_known(self):
    for name in sets.QUICK + sets.FULL:
      self.assertTrue(sets.is_world(name), name)

  def test_worlds_shrink_and_do_not_grow(self):
    self.assertEqual(sets.shrink('alias-300', 100), 'alias-100')
    self.assertEqual(sets.shrink('clean-50', 100), 'clean-50')


if __name__ == '__main__':
  unittest.main()
