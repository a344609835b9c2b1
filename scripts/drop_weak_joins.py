#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Removes the verified pairs that alone connect two parts of a scene.

  scripts/drop_weak_joins.py DATABASE [--min_num_matches N] [--min_num_images N]

Where a few pairs with few matches join two parts (across a tunnel, say), vision
does not determine the relative scale and position of the parts. COLMAP's
mappers use such pairs all the same: global_mapper then deforms a model of two
good halves by tens of metres. Without these pairs each part becomes a separate
model. adasfm_mapper needs no such step: sensors bridge the gap there.

Method: pairs join images in the order of their matches, most first (a maximum
spanning forest). When a pair joins two parts of at least --min_num_images
images and all pairs between both have fewer than --min_num_matches matches in
total, these pairs are deleted from two_view_geometries; `matches` keeps them.
"""

import argparse
import sqlite3

MAX_NUM_IMAGES = 2147483647  # of COLMAP's pair ids


def find_weak_joins(pairs, min_num_matches, min_num_images):
  """The ids of the pairs to leave out; pairs: {id: number of matches}."""
  part_of, parts = {}, {}
  for pair_id in pairs:
    for image in divmod(pair_id, MAX_NUM_IMAGES):
      part_of.setdefault(image, image)
      parts.setdefault(image, {image})
  # The pairs between each two parts.
  between = {image: {} for image in parts}
  for pair_id in pairs:
    first, second = divmod(pair_id, MAX_NUM_IMAGES)
    between[first].setdefault(second, set()).add(pair_id)
    between[second].setdefault(first, set()).add(pair_id)
  weak = set()
  for pair_id in sorted(pairs, key=lambda p: (-pairs[p], p)):
    large, small = (part_of[image] for image in divmod(pair_id, MAX_NUM_IMAGES))
    if large == small or pair_id in weak:
      continue
    joining = between[large][small]
    if (min(len(parts[large]), len(parts[small])) >= min_num_images and
        sum(pairs[p] for p in joining) < min_num_matches):
      weak |= joining
      del between[large][small], between[small][large]
      continue
    if len(parts[large]) < len(parts[small]):
      large, small = small, large
    for image in parts.pop(small):
      part_of[image] = large
      parts[large].add(image)
    for other, others in between.pop(small).items():
      del between[other][small]
      if other != large:
        between[large].setdefault(other, set()).update(others)
        between[other].setdefault(large, set()).update(others)
  return weak


def main():
  parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
  parser.add_argument('database')
  parser.add_argument('--min_num_matches', type=int, default=150,
                      help='between two parts that stay together')
  parser.add_argument('--min_num_images', type=int, default=10,
                      help='of a part that may be cut off')
  args = parser.parse_args()
  database = sqlite3.connect(args.database)
  with database:
    pairs = dict(database.execute(
        'SELECT pair_id, rows FROM two_view_geometries WHERE rows > 0'))
    weak = find_weak_joins(pairs, args.min_num_matches, args.min_num_images)
    database.executemany('DELETE FROM two_view_geometries WHERE pair_id = ?',
                         [(pair_id,) for pair_id in sorted(weak)])
  database.close()
  print('Left out %d of %d pairs, which alone joined parts' %
        (len(weak), len(pairs)))


if __name__ == '__main__':
  main()
