#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Prints options for the initial pair of COLMAP's mapper on a cleaned database.

  scripts/mapper_start.py DATABASE SUMMARY

DATABASE is the one that adasfm_global has cleaned, SUMMARY its summary.json.
Prints nothing if the mapper finds an initial pair itself, or if the verified
pairs form more than one part: an initial pair in options serves one model.
docs/guide/cleaner.md explains why the mapper may need the options.
"""

import argparse
import json
import sqlite3

from drop_weak_joins import MAX_NUM_IMAGES

MIN_NUM_IMAGES = 10  # of a model that COLMAP's mapper keeps


def count_parts(pairs):
  """Number of parts of at least MIN_NUM_IMAGES images that the pairs form."""
  part_of = {}
  for pair_id in pairs:
    first, second = divmod(pair_id, MAX_NUM_IMAGES)
    one = part_of.setdefault(first, {first})
    other = part_of.setdefault(second, {second})
    if one is not other:
      one |= other
      part_of.update((image, one) for image in other)
  parts = {id(part): len(part) for part in part_of.values()}
  return sum(size >= MIN_NUM_IMAGES for size in parts.values())


def options_of(start):
  """The options, from the `mapper_start` of a model's summary."""
  options = {'init_image_id1': start['image_id1'],
             'init_image_id2': start['image_id2'],
             'init_max_forward_motion': 1,
             # Half of the pair's parallax, so that its points pass, too.
             'init_min_tri_angle': round(min(start['parallax_deg'] / 2, 16), 3),
             # A second model would begin with the same pair.
             'multiple_models': 0}
  return ' '.join('--Mapper.%s %s' % item for item in options.items())


def main():
  parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
  parser.add_argument('database')
  parser.add_argument('summary')
  args = parser.parse_args()
  with open(args.summary) as file:
    starts = [model['mapper_start'] for model in json.load(file)['models']]
  pairs = [row[0] for row in sqlite3.connect(args.database).execute(
      'SELECT pair_id FROM two_view_geometries WHERE rows > 0')]
  if starts[0] and starts[0]['must_be_told'] and count_parts(pairs) == 1:
    print(options_of(starts[0]))


if __name__ == '__main__':
  main()
