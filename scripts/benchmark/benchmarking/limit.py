# SPDX-License-Identifier: BSD-3-Clause
"""The true poses as a COLMAP model, from which the limit is computed."""

import sqlite3
import struct

from benchmarking.trajectories import write_poses

# COLMAP's camera model ids, as the database has them.
CAMERA_MODELS = ['SIMPLE_PINHOLE', 'PINHOLE', 'SIMPLE_RADIAL', 'RADIAL',
                 'OPENCV', 'OPENCV_FISHEYE', 'FULL_OPENCV', 'FOV',
                 'SIMPLE_RADIAL_FISHEYE', 'RADIAL_FISHEYE',
                 'THIN_PRISM_FISHEYE']


def write_true_poses(database, ground_truth_path, model_path,
                     matched_only=True):
  """A model of the images of the database, at their true poses.

  With matched_only, images without a verified pair are left out, since no
  matches constrain them.
  """
  connection = sqlite3.connect(database)
  names = dict(connection.execute('SELECT name, image_id FROM images'))
  pair_ids = [row[0] for row in connection.execute(
      'SELECT pair_id FROM two_view_geometries WHERE rows > 0')]
  cameras = connection.execute(
      'SELECT camera_id, model, width, height, params FROM cameras').fetchall()
  connection.close()
  if len(cameras) != 1:
    raise ValueError('the limit is made for sets of one camera')
  camera_id, model, width, height, params = cameras[0]
  values = struct.unpack('<%dd' % (len(params) // 8), params)
  camera_line = '%d %s %d %d %s' % (camera_id, CAMERA_MODELS[model], width,
                                    height, ' '.join('%.15g' % v
                                                     for v in values))
  matched = {image_id for pair_id in pair_ids
             for image_id in divmod(pair_id, 2147483647)}
  poses = {}
  with open(ground_truth_path) as file:
    for line in file:
      fields = line.split()
      if not fields or fields[0].startswith('#') or fields[0] not in names:
        continue
      image_id = names[fields[0]]
      if image_id in matched or not matched_only:
        pose = [float(x) for x in fields[1:8]]
        poses[image_id] = (fields[0], pose[:4], pose[4:])
  write_poses(poses, camera_line, model_path)
