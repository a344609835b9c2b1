# SPDX-License-Identifier: BSD-3-Clause
"""The table of growth: small sizes run often, exponents are of their means."""

import os
import sys
import tempfile
import unittest
from types import SimpleNamespace

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)),
                                '..', '..', 'scripts', 'benchmark'))
import growth  # noqa: E402


def record(num_images, seconds, megabytes):
  model = {'rmse_m': 0.02}
  return dict({step: {'cpu_s': seconds / 3, 'peak_mb': megabytes}
               for step in growth.STEPS}, num_images=num_images,
              num_pairs=12 * num_images, coarse=model, model=model)


class GrowthTest(unittest.TestCase):

  def test_small_sizes_run_before_and_after_each_large_one(self):
    self.assertEqual(growth.order_runs([500, 1000, 4000, 30000]),
                     [500, 1000, 4000, 500, 1000, 30000, 500, 1000])
    self.assertEqual(growth.order_runs([1000]), [1000])
    self.assertEqual(growth.order_runs([4000]), [4000])

  def test_runs_of_a_size_become_their_mean(self):
    with tempfile.TemporaryDirectory() as folder:
      args = SimpleNamespace(plot_path=os.path.join(folder, 'growth.svg'))
      text = growth.report(
          [record(1000, 20.0, 300), record(10000, 300.0, 1000),
           record(1000, 40.0, 200)], args)
      self.assertTrue(os.path.exists(args.plot_path))
    self.assertIn('| 1,000 | 12,000 | 10.0 s, 300 MB |', text)
    self.assertIn('| 30.0 s, 300 MB |', text)
    # A factor of ten for ten times the images; 3.33 for the memory.
    self.assertIn('1.00 of CPU time, 0.52 of memory, 1.00 of the number', text)
    self.assertIn('1,000 images 2 runs of 20.0 to 40.0 s', text)

  def test_single_runs_have_no_note(self):
    with tempfile.TemporaryDirectory() as folder:
      args = SimpleNamespace(plot_path=os.path.join(folder, 'growth.svg'))
      text = growth.report([record(1000, 20.0, 300)], args)
    self.assertNotIn('runs', text)
    self.assertNotIn('Exponents', text)


if __name__ == '__main__':
  unittest.main()
