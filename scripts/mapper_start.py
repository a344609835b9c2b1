#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Prints the options with which COLMAP's mapper begins well on a cleaned database.

  scripts/mapper_start.py DATABASE SUMMARY

DATABASE is the one that adasfm_global has cleaned, SUMMARY its summary.json.
Prints nothing where the mapper finds a beginning itself, or where the verified
pairs hold more than one part together: a pair named by options serves one model.
docs/guide/cleaner.md says why it may have to be told.
"""

import argparse
import json
import sqlite3

from drop_weak_joins import MAX_NUM_IMAGES

MIN_NUM_IMAGES = 10  # of a model that COLMAP's mapper keeps


def count_parts(pairs):
  """How many parts of MIN_NUM_IMAGES images the ids of pairs join."""
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
  """Of the `mapper_start` of a model's summary."""
  options = {'init_image_id1': start['image_id1'],
             'init_image_id2': start['image_id2'],
             'init_max_forward_motion': 1,
             # Half of the pair's: its points are to pass too.
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
