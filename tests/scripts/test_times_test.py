# SPDX-License-Identifier: BSD-3-Clause
"""Tests of scripts/checks/test_times.py."""

import os
import subprocess
import sys
import tempfile
import time
import unittest

SCRIPT = os.path.join(os.path.dirname(os.path.abspath(__file__)), '..', '..',
                      'scripts', 'checks', 'test_times.py')

ENTRY = '''1/3 Testing: {name}
1/3 Test: {name}
Command: "/somewhere/{program}" "--gtest_filter={name}"
Directory: /somewhere
"{name}" start time: {end}
Output:
----------------------------------------------------------
{output}
<end of output>
Test time = {seconds:6.2f} sec
----------------------------------------------------------
Test Passed.
"{name}" end time: {end}
"{name}" time elapsed: 00:00:01
'''


def minute(seconds):
  return time.strftime('%b %d %H:%M %Z', time.localtime(seconds))


class TestTimesTest(unittest.TestCase):

  def report(self, folder, begin_s, entries, suffix=''):
    log = os.path.join(folder, 'build', 'Testing', 'Temporary', 'LastTest.log')
    os.makedirs(os.path.dirname(log), exist_ok=True)
    with open(log + suffix, 'w') as file:
      for name, program, at_s, seconds in entries:
        file.write(ENTRY.format(name=name, program=program, end=minute(at_s),
                                seconds=seconds,
                                output='Test time = 999.00 sec\nCommand: "/x"'))
    steps = os.path.join(folder, 'steps')
    with open(steps, 'w') as file:
      file.write('%d\tBuilding\n%d\tTesting\n' % (begin_s, begin_s + 1860))
    return subprocess.run([sys.executable, SCRIPT, steps, log], text=True,
                          capture_output=True, check=True).stdout

  def test_stopped_run(self):
    begin_s = int(time.time()) // 60 * 60
    with tempfile.TemporaryDirectory() as folder:
      self.report(folder, begin_s, [('A.Before', 'test_core', begin_s, 1.0)])
      text = self.report(folder, begin_s,
                         [('A.Done', 'test_core', begin_s, 1.0)], '.tmp')
    self.assertIn('A.Done', text)
    self.assertNotIn('A.Before', text)

  def test_half_hours_and_the_slowest(self):
    begin_s = int(time.time()) // 60 * 60 - 3600
    entries = [('A.Slow', 'test_core', begin_s + 600, 12.5),
               ('A.Late', 'test_core', begin_s + 2400, 1.0),
               ('documentation', 'python3', begin_s + 2400, 3.0),
               ('A.OfAnEarlierRun', 'test_core', begin_s - 300, 99.0)]
    entries += [('B.%02d' % i, 'test_global', begin_s + 2400, 0.1)
                for i in range(30)]
    with tempfile.TemporaryDirectory() as folder:
      text = self.report(folder, begin_s, entries)
    first, _, second = text.partition('Half hour 2:')
    self.assertIn('0 min  Building', first)
    self.assertIn('test_core of build: 1 test, 12 s', first)
    self.assertIn('31 min  Testing', second)
    self.assertIn('test_core of build: 1 test, 1 s', second)
    self.assertIn('test_global of build: 30 tests, 3 s', second)
    self.assertIn('documentation of build: 1 test, 3 s', second)
    self.assertNotIn('Earlier', text)
    slowest = text.partition('The slowest of 33 tests:\n')[2].splitlines()
    self.assertEqual(len(slowest), 20)
    self.assertEqual(slowest[0].split(), ['12.5', 's', 'A.Slow'])
    self.assertEqual(slowest[1].split(), ['3.0', 's', 'documentation'])


if __name__ == '__main__':
  unittest.main()
