#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Some faults of each campaign of scripts/checks/faults.sh, and faults that
once caused errors."""

import errno
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import unittest

CHECKS = os.path.join(os.path.dirname(os.path.abspath(__file__)), '..', '..',
                      'scripts', 'checks')
sys.path.insert(0, CHECKS)

from faulting.shim import build_shim
from faulting.trials import count_calls, inject
from faulting.world import Process, World, digests

COMMANDS = ['adasfm_synthesizer', 'adasfm_prior_importer', 'adasfm_global',
            'adasfm_mapper']


class ChecksTest(unittest.TestCase):

  def setUp(self):
    self.folder = tempfile.mkdtemp(prefix='adasfm-faults-test-')

  def tearDown(self):
    shutil.rmtree(self.folder)

  def test_durations_in_a_log_do_not_count(self):
    path = os.path.join(self.folder, 'features.log')
    found = []
    for text in ('Elapsed time: 0.015 [minutes]', 'Elapsed time: 0.017'):
      with open(path, 'w') as file:
        file.write(text)
      found.append(digests(self.folder))
    self.assertEqual(*found)
    os.remove(path)
    self.assertNotEqual(digests(self.folder), found[0])

  def test_a_limit_of_files_leaves_what_is_said(self):
    outcome = Process('/bin/sh', self.folder, '-c', [
        'yes "disk I/O error" | head -n 9999 >&2; echo "ERROR: full" >&2; '
        'exit 1'], limits=[(resource.RLIMIT_FSIZE, 100)]).wait()
    self.assertFalse(outcome.require_answer())


class FaultsTest(unittest.TestCase):

  @classmethod
  def setUpClass(cls):
    cls.folder = tempfile.mkdtemp(prefix='adasfm-faults-test-')
    cls.world = World(os.environ['ADASFM_LAUNCHER'], cls.folder, COMMANDS)
    cls.shim = build_shim(cls.folder)
    cls.counts = {command: count_calls(cls.world, cls.shim, command)
                  for command in COMMANDS}

  @classmethod
  def tearDownClass(cls):
    shutil.rmtree(cls.folder)

  def inject(self, command, kind, shares, error, keep=''):
    """Injects a fault at each share of the command's calls of that kind;
    returns whether any of them made the command fail."""
    failed = False
    for share in shares:
      call = 1 + int(share * self.counts[command][kind])
      outcome = inject(self.world, self.shim, command, '%s:%d:%d%s' %
                       (kind, call, error, keep))
      failed = failed or outcome.code != 0
    return failed

  def test_synthesizer_notices_what_its_database_has_not(self):
    # Writes near the end move COLMAP's write-ahead log into the database.
    self.assertTrue(self.inject('adasfm_synthesizer', 'write',
                                (0.3, 0.86, 0.9, 0.98), errno.ENOSPC))

  def test_synthesizer_replaces_what_it_left(self):
    self.assertTrue(self.inject('adasfm_synthesizer', 'rename',
                                (0.0, 0.25, 0.45, 0.65), errno.EACCES))

  def test_disk_stays_full(self):
    for command in COMMANDS[1:]:
      self.assertTrue(self.inject(command, 'write', (0.5,), errno.ENOSPC,
                                  ':keep'))

  def test_short_of_memory(self):
    # The mapper does not skip a part, but fails.
    self.assertTrue(self.inject('adasfm_mapper', 'memory',
                                (0.2, 0.35, 0.5, 0.65), errno.ENOMEM))

  def test_no_threads(self):
    for command in COMMANDS[2:]:
      for call in (1, 3):
        outcome = inject(self.world, self.shim, command,
                         'thread:%d:%d:keep' % (call, errno.EAGAIN))
        self.assertTrue(outcome.code == 0 or 'threads' in outcome.error,
                        outcome)

  def test_short_campaign(self):
    done = subprocess.run(
        [sys.executable, os.path.join(CHECKS, 'faults.py'),
         os.environ['ADASFM_LAUNCHER'], '--seconds', '15', '--seed', '7'],
        capture_output=True, text=True)
    self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
    for campaign in ('kills', 'injections', 'limits', 'twice', 'files'):
      self.assertIn(campaign + ': ', done.stdout)


if __name__ == '__main__':
  unittest.main()
