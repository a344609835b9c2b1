# SPDX-License-Identifier: BSD-3-Clause
"""Tests of scripts/benchmark/sensor_errors.py."""

import argparse
import os
import sys
import unittest

SCRIPTS = os.path.join(os.path.dirname(os.path.abspath(__file__)), '..', '..',
                       'scripts', 'benchmark')
sys.path.insert(0, SCRIPTS)

import sensor_errors  # noqa: E402
from temporary_folder import FolderTest  # noqa: E402

IMU = [[1000000000 + 10000000 * k, 0.1, -0.2, 0.3, 1.0, 2.0, 9.81]
       for k in range(101)]
HEADERS = {'imu.csv': '#t,wx,wy,wz,ax,ay,az', 'wheel.csv': '#t,left,right',
           'times.csv': '#t,filename'}


class SpoilTest(FolderTest):

  def spoil(self, error):
    """{file: rows of numbers} after the error."""
    logs = {'imu.csv': IMU, 'wheel.csv': [[1000000000, 2.0, 3.0]],
            'times.csv': [[1500000000, 1.0], [1600000000, 2.0]]}
    for name, rows in logs.items():
      with open(os.path.join(self.folder, name), 'w') as file:
        file.write('\n'.join([HEADERS[name]] +
                             [','.join(map(str, row)) for row in rows]) + '\n')
    with open(os.path.join(self.folder, 'sensors.yaml'), 'w') as file:
      file.write('imu0:\n  update_rate: 100.0\n'
                 '  gyroscope_noise_density: 0.001\n'
                 '  accelerometer_noise_density: 0.01\n')
    change = sensor_errors.ERRORS[error]
    if change:
      change(self.folder)
    spoilt = {}
    for name in logs:
      with open(os.path.join(self.folder, name)) as file:
        spoilt[name] = [[float(value) for value in line.split(',')]
                        for line in file.read().splitlines()[1:]]
    return spoilt

  def test_each_error_changes_one_log(self):
    clean = self.spoil('none')
    for error in sensor_errors.ERRORS:
      with self.subTest(error):
        spoilt = self.spoil(error)
        changed = [name for name in clean if spoilt[name] != clean[name]]
        self.assertEqual(len(changed), 0 if error == 'none' else 1)

  def test_drift_grows_from_zero_to_the_end(self):
    rows = self.spoil('bias of the gyroscope drifts by 0.005 rad/s')['imu.csv']
    for share, row in ((0.0, rows[0]), (0.5, rows[50]), (1.0, rows[100])):
      for axis, rate in enumerate((0.1, -0.2, 0.3)):
        self.assertAlmostEqual(row[1 + axis], rate + 0.005 * share)
      self.assertEqual(row[4:], [1.0, 2.0, 9.81])

  def test_imu_is_thinned_to_the_rate_and_noise_has_its_size(self):
    self.assertEqual(len(self.spoil('IMU thinned to 20 Hz')['imu.csv']), 21)
    rows = self.spoil('IMU with four times its stated noise')['imu.csv']
    # Of 100 Hz: 0.01 rad/s times sqrt(15). 303 samples determine it to 4 %.
    square = sum((row[1 + axis] - rate) ** 2 for row in rows
                 for axis, rate in enumerate((0.1, -0.2, 0.3))) / 303
    self.assertAlmostEqual(square ** 0.5 / (0.01 * 15 ** 0.5), 1.0, delta=0.16)

  def test_scales_change_rates_or_accelerations(self):
    row = self.spoil('rates of the gyroscope 1 % too large')['imu.csv'][7]
    self.assertAlmostEqual(row[3], 0.303)
    self.assertEqual(row[6], 9.81)
    row = self.spoil('accelerations 2 % too large')['imu.csv'][7]
    self.assertEqual(row[3], 0.3)
    self.assertAlmostEqual(row[6], 1.02 * 9.81)


class ReportTest(unittest.TestCase):

  def test_row_has_errors_verdicts_and_sizes(self):
    args = argparse.Namespace(worlds=['a', 'b', 'c'])
    text = sensor_errors.report([{'error': 'late', 'worlds': {
        'a': {'rmse_m': 0.0314, 'scale': 0.99, 'good': True},
        'b': {'rmse_m': 0.5, 'scale': 1.001, 'good': False},
        'c': {'failure': 'no'}}}], args)
    self.assertIn('| late | 0.031 | 0.500 (?) | refused | 1.00, 0.10 % |', text)


if __name__ == '__main__':
  unittest.main()
