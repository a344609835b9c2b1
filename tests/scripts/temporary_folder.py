# SPDX-License-Identifier: BSD-3-Clause
"""A test case with a folder of its own."""

import os
import tempfile
import unittest


class FolderTest(unittest.TestCase):

  def setUp(self):
    temporary = tempfile.TemporaryDirectory()
    self.addCleanup(temporary.cleanup)
    self.folder = temporary.name

  def path(self, *names):
    return os.path.join(self.folder, *names)
