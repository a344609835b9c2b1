# SPDX-License-Identifier: BSD-3-Clause
"""Counts wrong decisions of adasfm_global on the pairs of a world with truth.

These are true pairs that it rejects and false pairs that it keeps. A pair is
true if more than half of its verified matches see one landmark; in a world
without landmarks, if its images are at most FAR_M apart. The pose of a true
pair is right if its rotation errs by at most MAX_ROTATION_DEG and, from
MIN_BASELINE_M on, its direction by at most MAX_DIRECTION_DEG. A true pair is
lost if the cleaned database has no matches of it, true or false. A false pair
is kept if it has matches there and is still false by the same rule.
"""

import os
import sqlite3
import struct

import numpy as np

MAX_PAIR_IMAGES = 2147483647  # COLMAP's pair ids
FAR_M = 45.0
MAX_ROTATION_DEG = 1.0
MAX_DIRECTION_DEG = 10.0
MIN_BASELINE_M = 0.2


def rotation_matrix(qvec):
  w, x, y, z = qvec / np.linalg.norm(qvec)
  return np.array([
      [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
      [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
      [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


def read_true_poses(path):
  """{name: (R, t)} of gt.txt, cam_from_world."""
  poses = {}
  with open(path) as file:
    for line in file:
      words = line.split()
      if words and not line.startswith('#'):
        values = np.array(words[1:8], dtype=float)
        poses[words[0]] = rotation_matrix(values[:4]), values[4:]
  return poses


def read_landmarks(path):
  """{name: ids by keypoint} of landmarks.txt, or {} when there is none."""
  if not os.path.exists(path):
    return {}
  with open(path) as file:
    rows = [line.split() for line in file if not line.startswith('#')]
  return {row[0]: np.array(row[1:], dtype=int) for row in rows if row}


def read_pairs(database_path):
  """{(name, name): (matches, qvec or None, tvec or None)} of verified pairs."""
  database = sqlite3.connect('file:%s?mode=ro' % database_path, uri=True)
  names = dict(database.execute('SELECT image_id, name FROM images'))
  pairs = {}
  for pair_id, data, qvec, tvec in database.execute(
      'SELECT pair_id, data, qvec, tvec FROM two_view_geometries '
      'WHERE rows > 0'):
    ids = pair_id // MAX_PAIR_IMAGES, pair_id % MAX_PAIR_IMAGES
    if not all(image_id in names for image_id in ids):
      continue
    matches = np.frombuffer(data, dtype=np.uint32).reshape(-1, 2)
    has_pose = bool(qvec) and bool(tvec) and any(struct.unpack('<3d', tvec))
    pairs[names[ids[0]], names[ids[1]]] = (
        matches, np.array(struct.unpack('<4d', qvec)) if has_pose else None,
        np.array(struct.unpack('<3d', tvec)) if has_pose else None)
  database.close()
  return pairs


def relative_pose(names, poses):
  """cam2_from_cam1."""
  (rotation1, t1), (rotation2, t2) = (poses[name] for name in names)
  rotation = rotation2 @ rotation1.T
  return rotation, t2 - rotation @ t1


def is_true(names, matches, poses, landmarks):
  if all(name in landmarks for name in names):
    seen = [landmarks[name][matches[:, k]] for k, name in enumerate(names)]
    return 2 * np.sum((seen[0] == seen[1]) & (seen[0] >= 0)) > len(matches)
  _, translation = relative_pose(names, poses)
  return bool(np.linalg.norm(translation) <= FAR_M)


def angle_deg(cosine):
  return np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))


def is_pose_right(names, qvec, tvec, poses):
  rotation, translation = relative_pose(names, poses)
  difference = rotation_matrix(qvec) @ rotation.T
  if angle_deg((np.trace(difference) - 1.0) / 2.0) > MAX_ROTATION_DEG:
    return False
  baseline = np.linalg.norm(translation)
  return baseline < MIN_BASELINE_M or angle_deg(
      tvec @ translation / (np.linalg.norm(tvec) * baseline)
  ) <= MAX_DIRECTION_DEG


def count_pairs(verified_path, cleaned_path, folder):
  """Counts pairs of a world's database as verified and as adasfm_global left it
  (cleaned); folder has gt.txt and, in synthesized worlds, landmarks.txt."""
  poses = read_true_poses(os.path.join(folder, 'gt.txt'))
  landmarks = read_landmarks(os.path.join(folder, 'landmarks.txt'))
  verified = read_pairs(verified_path)
  cleaned = read_pairs(cleaned_path)
  counts = dict.fromkeys(
      ('true', 'true_lost', 'right_lost', 'false', 'false_kept'), 0)
  for names, (matches, qvec, tvec) in verified.items():
    if not all(name in poses for name in names):
      continue
    if not is_true(names, matches, poses, landmarks):
      counts['false'] += 1
      if names in cleaned and not is_true(names, cleaned[names][0], poses,
                                          landmarks):
        counts['false_kept'] += 1
      continue
    counts['true'] += 1
    if names not in cleaned:
      counts['true_lost'] += 1
      if qvec is not None and is_pose_right(names, qvec, tvec, poses):
        counts['right_lost'] += 1
  return counts
