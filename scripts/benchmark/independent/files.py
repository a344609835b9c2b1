# SPDX-License-Identifier: BSD-3-Clause
"""The files of a world."""

import os
import sqlite3
import subprocess

import numpy as np

from independent import images, motion

BEGIN_NS = 1500000000 * 10**9

CALIBRATION = '''cam0:
  T_cam_imu:
%s
  timeshift_cam_imu: 0.0
  resolution: [%d, %d]
imu0:
  update_rate: 200.0
  gyroscope_noise_density: %g
  gyroscope_random_walk: %g
  accelerometer_noise_density: %g
  accelerometer_random_walk: %g
wheel0:
  type: differential
  track_width: %g
  speed_noise: %g
  T_imu_wheel:
%s
'''


def quaternion(rotation):
  """w, x, y, z: the largest eigenvector of Davenport's matrix."""
  r = rotation
  z = np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]])
  matrix = np.zeros((4, 4))
  matrix[0, 0] = np.trace(r)
  matrix[0, 1:] = matrix[1:, 0] = z
  matrix[1:, 1:] = r + r.T - np.trace(r) * np.eye(3)
  return np.linalg.eigh(matrix)[1][:, -1]


def write_log(path, header, times_s, *columns):
  with open(path, 'w') as file:
    file.write('#timestamp [ns],' + header + '\n')
    for t, row in zip(times_s, np.column_stack(columns)):
      file.write('%d,%s\n' % (BEGIN_NS + round(t * 1e9),
                              ','.join('%.9g' % value for value in row)))


def write_times(path, times_s, names):
  with open(path, 'w') as file:
    file.write('#timestamp [ns],filename\n')
    for t, name in zip(times_s, names):
      file.write('%d,%s\n' % (BEGIN_NS + round(t * 1e9), name))


def write_truth(path, names, poses):
  with open(path, 'w') as file:
    for name, (center, cam_from_world) in zip(names, poses):
      pose = np.append(quaternion(cam_from_world), -cam_from_world @ center)
      file.write('%s %s\n' % (name, ' '.join('%.10g' % v for v in pose)))


def write_calibration(path, cam_from_imu, imu_from_wheel):
  def rows(matrix):
    return '\n'.join('    - [%s]' % ', '.join('%.12g' % v for v in row)
                     for row in matrix)
  with open(path, 'w') as file:
    file.write(CALIBRATION % (
        rows(cam_from_imu), images.WIDTH, images.HEIGHT, motion.GYRO_NOISE,
        motion.GYRO_WALK, motion.ACCEL_NOISE, motion.ACCEL_WALK,
        motion.TRACK_WIDTH_M, motion.WHEEL_NOISE, rows(imu_from_wheel)))


def write_keypoints(path, camera_model, names, keypoints):
  database = sqlite3.connect(path)
  model, params = images.CAMERAS[camera_model]
  database.execute('INSERT INTO cameras VALUES (1, ?, ?, ?, ?, 1)',
                   (model, images.WIDTH, images.HEIGHT,
                    np.array(params, '<f8').tobytes()))
  for i, (name, pixels) in enumerate(zip(names, keypoints), 1):
    database.execute('INSERT INTO images (image_id, name, camera_id) '
                     'VALUES (?, ?, 1)', (i, name))
    scale = np.tile([1.0, 0.0], (len(pixels), 1))
    database.execute('INSERT INTO keypoints VALUES (?, ?, 4, ?)',
                     (i, len(pixels),
                      np.hstack([pixels, scale]).astype('<f4').tobytes()))
    database.execute('INSERT INTO descriptors VALUES (?, ?, 128, ?)',
                     (i, len(pixels), bytes(128 * len(pixels))))
  database.commit()
  database.close()


def write_database(path, args, names, keypoints, matches):
  """COLMAP makes the tables and verifies the raw matches; returns the verified
  pairs, counted from 0."""
  def colmap(command, *arguments):
    subprocess.run([args.colmap, command, '--database_path', path, *arguments],
                   check=True, capture_output=True)
  colmap('database_creator')
  write_keypoints(path, args.camera_model, names, keypoints)
  list_path = path + '.matches.txt'
  with open(list_path, 'w') as file:
    for (i, j), rows in matches.items():
      file.write('%s %s\n%s\n\n' % (names[i], names[j], '\n'.join(
          '%d %d' % tuple(row) for row in rows)))
  colmap('matches_importer', '--match_list_path', list_path, '--match_type',
         'raw', '--SiftMatching.use_gpu', '0', '--SiftMatching.max_num_trials',
         '300')
  os.remove(list_path)
  database = sqlite3.connect(path)
  pair_ids = [row[0] for row in database.execute(
      'SELECT pair_id FROM two_view_geometries WHERE rows > 0')]
  database.close()
  return [(p // 2147483647 - 1, p % 2147483647 - 1) for p in pair_ids]
