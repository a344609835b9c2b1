# SPDX-License-Identifier: BSD-3-Clause
"""Names of COLMAP's options, which moved to other groups in newer versions."""

import re
import subprocess


def has_option(colmap, command, option):
  result = subprocess.run([colmap, command, '-h'], check=False, text=True,
                          capture_output=True)
  return '--%s ' % option in result.stdout + result.stderr


def version_of(colmap):
  """A program's version of COLMAP, as 4.2.1; '' if the program prints none. Our
  program prints its host's version."""
  result = subprocess.run([colmap, 'help'], check=False, text=True,
                          capture_output=True)
  match = re.search(r'COLMAP (\d+(?:\.\d+)+)', result.stdout + result.stderr)
  return match.group(1) if match else ''


def feature_groups(colmap):
  """The groups of use_gpu: of features, and of matching (since COLMAP 3.13
  FeatureExtraction and FeatureMatching)."""
  if has_option(colmap, 'feature_extractor', 'FeatureExtraction.use_gpu'):
    return 'FeatureExtraction', 'FeatureMatching'
  return 'SiftExtraction', 'SiftMatching'


def solver_group(colmap):
  """The group of max_num_iterations of bundle_adjuster (since COLMAP 4.0
  BundleAdjustmentCeres)."""
  group = 'BundleAdjustmentCeres'
  if has_option(colmap, 'bundle_adjuster', group + '.max_num_iterations'):
    return group
  return 'BundleAdjustment'
