#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Lists what was tested in which half hour, and the slowest tests.

  scripts/checks/test_times.py STEPS LOG...

STEPS holds a line `seconds<TAB>what` (seconds since 1970) for the beginning of
each step of scripts/test.sh; each LOG is ctest's
Testing/Temporary/LastTest.log, or LastTest.log.tmp if ctest was stopped.
Tests of an earlier run in these logs are not counted.
"""

import os
import pathlib
import re
import sys
import time

NUM_SLOWEST = 20
HALF_HOUR_S = 1800


class Test:

  def __init__(self, name, program, end_s, seconds):
    self.name = name
    self.program = program
    self.end_s = end_s
    self.seconds = seconds


def read_steps(path):
  with open(path) as file:
    rows = [line.rstrip('\n').split('\t') for line in file if '\t' in line]
  return [(int(seconds), what) for seconds, what in rows]


def seconds_of(minute):
  """Seconds since 1970 of `Nov 22 11:20 UTC`, which has no year: of the last
  such time, read as local time."""
  now = time.localtime()
  text = minute.rsplit(' ', 1)[0]
  for year in (now.tm_year, now.tm_year - 1):
    moment = time.strptime('%d %s' % (year, text), '%Y %b %d %H:%M')
    seconds = time.mktime(moment[:8] + (-1,))
    if seconds <= time.time() + 60:
      return seconds
  return 0


def read_tests(path):
  """The tests of a ctest log; the output of a test may contain any text."""
  build = pathlib.Path(path).absolute().parents[2].name
  tests, name, program, seconds = [], None, '', 0.0
  # While ctest runs, the log without .tmp is that of the run before.
  if os.path.exists(path + '.tmp'):
    path += '.tmp'
  with open(path, errors='replace') as file:
    for line in file:
      start = re.match(r'\d+/\d+ Test: (.*)', line)
      if start:
        name, program, seconds = start.group(1), '', 0.0
        continue
      if name is None:
        continue
      command = re.match(r'Command: "([^"]*)"', line)
      duration = re.match(r'Test time = +([\d.]+) sec', line)
      end = line.startswith('"%s" end time: ' % name) and line.split(
          'end time: ')[1].strip()
      if command and not program:
        program = command.group(1).rsplit('/', 1)[1]
      elif duration:
        seconds = float(duration.group(1))
      elif end:
        # For tests by scripts, the test's name tells what is tested.
        what = program if program.startswith('test_') else name
        tests.append(Test(name, '%s of %s' % (what, build), seconds_of(end),
                          seconds))
        name = None
  return tests


def describe_half_hours(steps, tests):
  begin_s = steps[0][0]
  halves = {}
  for start_s, what in steps:
    halves.setdefault((start_s - begin_s) // HALF_HOUR_S, []).append(
        '%3d min  %s' % ((start_s - begin_s) // 60, what))
  counts = {}
  for test in tests:
    half = int(max(0, test.end_s - begin_s) // HALF_HOUR_S)
    number, seconds = counts.get((half, test.program), (0, 0.0))
    counts[(half, test.program)] = number + 1, seconds + test.seconds
  for (half, program), (number, seconds) in sorted(counts.items()):
    halves.setdefault(half, []).append(
        '         %s: %d test%s, %.0f s' % (program, number,
                                           '' if number == 1 else 's', seconds))
  lines = []
  for half in sorted(halves):
    lines += ['Half hour %d:' % (half + 1)] + halves[half]
  return lines


def main():
  if len(sys.argv) < 3:
    sys.exit(__doc__)
  steps = read_steps(sys.argv[1])
  # The logs have whole minutes.
  tests = [test for path in sys.argv[2:] for test in read_tests(path)
           if test.end_s >= steps[0][0] - 60]
  print('\n'.join(describe_half_hours(steps, tests)))
  print('The slowest of %d tests:' % len(tests))
  for test in sorted(tests, key=lambda t: -t.seconds)[:NUM_SLOWEST]:
    print('%8.1f s  %s' % (test.seconds, test.name))


if __name__ == '__main__':
  main()
