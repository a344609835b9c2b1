# SPDX-License-Identifier: BSD-3-Clause
"""Builds the library that makes calls fail (shim.c)."""

import os
import subprocess


def build_shim(folder):
  source = os.path.join(os.path.dirname(os.path.abspath(__file__)), 'shim.c')
  shim = os.path.join(folder, 'shim.so')
  subprocess.run([os.environ.get('CC', 'cc'), '-shared', '-fPIC', '-O2', '-o',
                  shim, source], check=True)
  return shim
