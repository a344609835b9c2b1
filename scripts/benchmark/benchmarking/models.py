# SPDX-License-Identifier: BSD-3-Clause
"""Poses of COLMAP's binary models and of gt.txt, with numpy."""

import os
import struct

import numpy as np


def rotation_of(qvec):
  """3x3 of a quaternion w, x, y, z."""
  w, x, y, z = np.asarray(qvec, float) / np.linalg.norm(qvec)
  return np.array([
      [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
      [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
      [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


def quaternion_of(rotation):
  """w, x, y, z of a 3x3, by its largest eigenvector (Bar-Itzhack)."""
  r = rotation
  k = np.array([
      [r[0, 0] + r[1, 1] + r[2, 2], r[2, 1] - r[1, 2], r[0, 2] - r[2, 0],
       r[1, 0] - r[0, 1]],
      [0, r[0, 0] - r[1, 1] - r[2, 2], r[0, 1] + r[1, 0], r[0, 2] + r[2, 0]],
      [0, 0, r[1, 1] - r[0, 0] - r[2, 2], r[1, 2] + r[2, 1]],
      [0, 0, 0, r[2, 2] - r[0, 0] - r[1, 1]]])
  return np.linalg.eigh(k, UPLO='U')[1][:, -1]


def centre_of(rotation, translation):
  return -rotation.T @ translation


def read_truth(path):
  """{name: (R, t)}, cam_from_world."""
  poses = {}
  with open(path) as file:
    for line in file:
      fields = line.split()
      if len(fields) == 8 and not line.startswith('#'):
        values = [float(x) for x in fields[1:]]
        poses[fields[0]] = rotation_of(values[:4]), np.array(values[4:])
  return poses


def _walk_images(data):
  """(offset of the pose, name) for each image of an images.bin."""
  num_images, = struct.unpack_from('<Q', data, 0)
  at = 8
  for _ in range(num_images):
    pose, end = at + 4, data.index(b'\0', at + 64)
    yield pose, data[at + 64:end].decode()
    num_points, = struct.unpack_from('<Q', data, end + 1)
    at = end + 9 + 24 * num_points


def read_model(folder):
  """{name: (R, t)} of a folder's images.bin."""
  with open(os.path.join(folder, 'images.bin'), 'rb') as file:
    data = file.read()
  poses = {}
  for at, name in _walk_images(data):
    values = struct.unpack_from('<7d', data, at)
    poses[name] = rotation_of(values[:4]), np.array(values[4:])
  return poses


def replace_poses(folder, poses):
  """Writes other poses into images.bin; its points stay as they are."""
  path = os.path.join(folder, 'images.bin')
  with open(path, 'rb') as file:
    data = bytearray(file.read())
  for at, name in list(_walk_images(bytes(data))):
    rotation, translation = poses[name]
    struct.pack_into('<7d', data, at, *quaternion_of(rotation), *translation)
  with open(path, 'wb') as file:
    file.write(data)
