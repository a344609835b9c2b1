# SPDX-License-Identifier: BSD-3-Clause
"""Poses of COLMAP's binary models."""

import os
import struct

import numpy as np

from benchmarking.pair_counts import rotation_matrix


def quaternion_of(rotation):
  """w, x, y, z of a 3x3 rotation, by the largest eigenvector (Bar-Itzhack)."""
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
    poses[name] = rotation_matrix(values[:4]), np.array(values[4:])
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
