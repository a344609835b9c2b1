# SPDX-License-Identifier: BSD-3-Clause
"""Counts wrong decisions of adasfm_global on the pairs of a world with truth.

These are true pairs that it rejects and false pairs that it keeps. A pair is
true if more than half of its verified matches see one landmark; in a world
without landmarks, if its images are at most FAR_M apart. The pose of a true
pair is right if its rotation errs by at most MAX_ROTATION_DEG and, from
MIN_BASELINE_M on, its direction by at most MAX_DIRECTION_DEG. Where only an
essential matrix is stored, the best of its four poses counts. A true pair is
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


def poses_of_essential_matrix(essential):
  """[(R, t)] of the four poses, Hartley and Zisserman, result 9.19."""
  u, _, v = np.linalg.svd(essential)
  turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
  rotations = [u @ w @ v for w in (turn, turn.T)]
  return [(rotation * np.sign(np.linalg.det(rotation)), sign * u[:, 2])
          for rotation in rotations for sign in (1.0, -1.0)]


def stored_poses(essential, qvec, tvec):
  """The possible [(R, t)] of a pair by its blobs; [] without any."""
  if qvec and tvec and any(struct.unpack('<3d', tvec)):
    return [(rotation_matrix(np.array(struct.unpack('<4d', qvec))),
             np.array(struct.unpack('<3d', tvec)))]
  if essential and any(struct.unpack('<9d', essential)):
    return poses_of_essential_matrix(
        np.array(struct.unpack('<9d', essential)).reshape(3, 3))
  return []


def read_pairs(database_path):
  """{(name, name): (matches, [(R, t)])} of verified pairs."""
  database = sqlite3.connect('file:%s?mode=ro' % database_path, uri=True)
  names = dict(database.execute('SELECT image_id, name FROM images'))
  pairs = {}
  for pair_id, data, *pose in database.execute(
      'SELECT pair_id, data, E, qvec, tvec FROM two_view_geometries '
      'WHERE rows > 0'):
    ids = pair_id // MAX_PAIR_IMAGES, pair_id % MAX_PAIR_IMAGES
    if not all(image_id in names for image_id in ids):
      continue
    matches = np.frombuffer(data, dtype=np.uint32).reshape(-1, 2)
    pairs[names[ids[0]], names[ids[1]]] = matches, stored_poses(*pose)
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


def is_pose_right(names, pose, poses):
  rotation, translation = relative_pose(names, poses)
  difference = pose[0] @ rotation.T
  if angle_deg((np.trace(difference) - 1.0) / 2.0) > MAX_ROTATION_DEG:
    return False
  baseline = np.linalg.norm(translation)
  return baseline < MIN_BASELINE_M or angle_deg(
      pose[1] @ translation / (np.linalg.norm(pose[1]) * baseline)
  ) <= MAX_DIRECTION_DEG


def count_pairs(verified_path, cleaned_path, folder):
  """Counts pairs of a world's database as verified and as adasfm_global left it
  (cleaned); folder has gt.txt and, in synthesized worlds, landmarks.txt."""
  poses = read_true_poses(os.path.join(folder, 'gt.txt'))
  landmarks = read_landmarks(os.path.join(folder, 'landmarks.txt'))
  verified = read_pairs(verified_path)
  cleaned = read_pairs(cleaned_path)
  counts = dict.fromkeys(('true', 'true_lost', 'right_lost', 'wrong',
                          'wrong_kept', 'false', 'false_kept'), 0)
  for names, (matches, possible) in verified.items():
    if not all(name in poses for name in names):
      continue
    is_kept = names in cleaned
    if not is_true(names, matches, poses, landmarks):
      counts['false'] += 1
      counts['false_kept'] += is_kept and not is_true(
          names, cleaned[names][0], poses, landmarks)
      continue
    is_right = any(is_pose_right(names, pose, poses) for pose in possible)
    counts['true'] += 1
    counts['true_lost'] += not is_kept
    counts['right_lost'] += is_right and not is_kept
    counts['wrong'] += not is_right
    counts['wrong_kept'] += is_kept and not is_right
  return counts
