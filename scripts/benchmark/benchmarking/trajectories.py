# SPDX-License-Identifier: BSD-3-Clause
"""The priors alone, chained into a model of poses."""

import os
import sqlite3
import struct


def quaternion_product(a, b):
  w, x, y, z = a
  e, f, g, h = b
  return (w * e - x * f - y * g - z * h, w * f + x * e + y * h - z * g,
          w * g - x * h + y * e + z * f, w * h + x * g - y * f + z * e)


def rotate(q, v):
  conjugate = (q[0], -q[1], -q[2], -q[3])
  return quaternion_product(quaternion_product(q, (0.0,) + tuple(v)),
                            conjugate)[1:]


def chain_priors(database):
  """{image id: (name, qvec, tvec)}, cam_from_world; the first is identity."""
  connection = sqlite3.connect(database)
  rows = connection.execute(
      'SELECT p.image_id1, p.name1, p.image_id2, p.name2, p.qvec, p.tvec '
      'FROM adasfm_relative_pose_priors p JOIN adasfm_image_times t '
      'ON t.image_id = p.image_id1 ORDER BY t.timestamp_ns').fetchall()
  connection.close()
  poses = {}
  for id1, name1, id2, name2, qvec, tvec in rows:
    if not poses:
      poses[id1] = (name1, (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    if id1 not in poses:
      continue
    _, q1, t1 = poses[id1]
    q12 = struct.unpack('<4d', qvec)
    t12 = struct.unpack('<3d', tvec)
    poses[id2] = (name2, quaternion_product(q12, q1),
                  tuple(a + b for a, b in zip(rotate(q12, t1), t12)))
  return poses


def write_poses(poses, camera_line, model_path):
  """Writes {image id: (name, qvec, tvec)} as a COLMAP text model."""
  os.makedirs(model_path, exist_ok=True)
  with open(os.path.join(model_path, 'cameras.txt'), 'w') as file:
    file.write(camera_line + '\n')
  with open(os.path.join(model_path, 'images.txt'), 'w') as file:
    for image_id, (name, q, t) in sorted(poses.items()):
      file.write('%d %s %s %s\n\n' %
                 (image_id, ' '.join('%.15g' % x for x in tuple(q) + tuple(t)),
                  camera_line.split()[0], name))
  open(os.path.join(model_path, 'points3D.txt'), 'w').close()


def write_prior_trajectory(database, model_path):
  """Chains the priors into a model of poses only; False below three poses."""
  poses = chain_priors(database)
  if len(poses) < 3:
    return False
  write_poses(poses, '1 PINHOLE 100 100 100 100 50 50', model_path)
  return True
