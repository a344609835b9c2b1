# SPDX-License-Identifier: BSD-3-Clause
"""Spoils the output of adasfm_synthesizer: logs, calibration, database."""

import math
import os
import random
import re
import sqlite3
import struct


def edit_rows(folder, name, function):
  """Replaces the rows of a CSV file, lists of strings, by function(rows)."""
  path = os.path.join(folder, name)
  with open(path) as file:
    header, *lines = file.read().splitlines()
  rows = function([line.split(',') for line in lines if line])
  with open(path, 'w') as file:
    file.write('\n'.join([header] + [','.join(row) for row in rows]) + '\n')


def edit_calibration(folder, function):
  path = os.path.join(folder, 'sensors.yaml')
  with open(path) as file:
    text = file.read()
  with open(path, 'w') as file:
    file.write(function(text))


def shift_clocks(folder, names, shift_ms):
  shift_ns = int(shift_ms * 1e6)
  for name in names:
    edit_rows(folder, name,
              lambda rows: [[str(int(row[0]) + shift_ns)] + row[1:]
                            for row in rows])


def keep_every(folder, name, step):
  """Keeps every step-th row; the calibration states the new rate."""
  edit_rows(folder, name, lambda rows: rows[::step])
  sensor = name.split('.')[0] + '0:'

  def change(text):
    before, after = text.split(sensor)
    return before + sensor + re.sub(
        r'update_rate: ([\d.]+)',
        lambda match: 'update_rate: %g' % (float(match.group(1)) / step),
        after, count=1)
  edit_calibration(folder, change)


def scale_columns(folder, name, begin, end, factor):
  edit_rows(folder, name, lambda rows: [
      row[:begin] + ['%.9g' % (factor * float(value))
                     for value in row[begin:end]] + row[end:] for row in rows])


def scale_rates(folder, factor):
  scale_columns(folder, 'imu.csv', 1, 4, factor)


def scale_accelerations(folder, factor):
  scale_columns(folder, 'imu.csv', 4, 7, factor)


def drift_gyroscope(folder, end_rad_s):
  """Adds to each axis a rate that grows linearly from zero to end_rad_s."""
  def change(rows):
    begin, end = int(rows[0][0]), int(rows[-1][0])
    return [row[:1] +
            ['%.9g' % (float(value) +
                       end_rad_s * (int(row[0]) - begin) / (end - begin))
             for value in row[1:4]] + row[4:] for row in rows]
  edit_rows(folder, 'imu.csv', change)


def jitter_times(folder, name, sigma_s):
  """Adds white noise to the times of a log; its rows keep their order."""
  generator = random.Random(7)
  edit_rows(folder, name, lambda rows: [
      [str(int(row[0]) + int(generator.gauss(0.0, sigma_s * 1e9)))] + row[1:]
      for row in rows])


def shift_gyroscope(folder, bias_rad_s):
  edit_rows(folder, 'imu.csv', lambda rows: [
      row[:1] + ['%.9g' % (float(value) + bias)
                 for value, bias in zip(row[1:4], bias_rad_s)] + row[4:]
      for row in rows])


def add_imu_noise(folder, rate_sigma_rad_s, acceleration_sigma_m_s2):
  """Adds white noise with these sigmas per sample; the calibration stays."""
  generator = random.Random(7)
  sigmas = [rate_sigma_rad_s] * 3 + [acceleration_sigma_m_s2] * 3
  edit_rows(folder, 'imu.csv', lambda rows: [
      row[:1] + ['%.9g' % (float(value) + generator.gauss(0.0, sigma))
                 for value, sigma in zip(row[1:], sigmas)] for row in rows])


def scale_wheels(folder, factor):
  scale_columns(folder, 'wheel.csv', 1, 3, factor)


def cut_logs(folder, names, begin, end):
  """Removes the rows between two shares of the images' time span."""
  with open(os.path.join(folder, 'times.csv')) as file:
    times = [int(line.split(',')[0]) for line in file.read().splitlines()[1:]]
  begin_ns, end_ns = (times[0] + share * (times[-1] - times[0])
                      for share in (begin, end))
  for name in names:
    edit_rows(folder, name,
              lambda rows: [row for row in rows
                            if not begin_ns <= int(row[0]) <= end_ns])


def turn_matrix(folder, name, rotation):
  """Multiplies a transform of the calibration by a rotation from the left
  (its translation too)."""
  def change(text):
    lines = text.split('\n')
    first = next(i for i, line in enumerate(lines) if name + ':' in line) + 1
    matrix = [[float(value) for value in
               lines[first + i].split('[')[1].strip('] ').split(',')]
              for i in range(3)]
    for i in range(3):
      row = [sum(rotation[i][k] * matrix[k][j] for k in range(3))
             for j in range(4)]
      lines[first + i] = '    - [%s]' % ', '.join('%.12g' % v for v in row)
    return '\n'.join(lines)
  edit_calibration(folder, change)


def axis_rotation(axis, angle_deg):
  a, b = (axis + 1) % 3, (axis + 2) % 3
  cosine = math.cos(math.radians(angle_deg))
  sine = math.sin(math.radians(angle_deg))
  matrix = [[float(i == j) for j in range(3)] for i in range(3)]
  matrix[a][a] = matrix[b][b] = cosine
  matrix[b][a] = sine
  matrix[a][b] = -sine
  return matrix


def turn_wheels(folder, yaw_deg, pitch_deg):
  turn_matrix(folder, 'T_imu_wheel', axis_rotation(1, pitch_deg))
  turn_matrix(folder, 'T_imu_wheel', axis_rotation(2, yaw_deg))


def turn_camera(folder, angle_deg):
  """Rotates the camera in the calibration about its vertical axis (y)."""
  turn_matrix(folder, 'T_cam_imu', axis_rotation(1, angle_deg))


def rotation_about(axis, angle_deg):
  """Rotation matrix about an axis of any length (Rodrigues)."""
  length = math.sqrt(sum(value * value for value in axis))
  x, y, z = (value / length for value in axis)
  cosine = math.cos(math.radians(angle_deg))
  sine = math.sin(math.radians(angle_deg))
  cross = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]
  return [[cosine * (i == j) + sine * cross[i][j] +
           (1 - cosine) * (x, y, z)[i] * (x, y, z)[j] for j in range(3)]
          for i in range(3)]


def turn_camera_about(folder, axis, angle_deg):
  """Rotates the camera in the calibration about an axis of its frame."""
  turn_matrix(folder, 'T_cam_imu', rotation_about(axis, angle_deg))


def scale_focal_length(folder, factor):
  """Scales fx and fy in database and calibration; the verified pairs stay."""
  database = sqlite3.connect(os.path.join(folder, 'database.db'))
  for camera_id, blob in database.execute(
      'SELECT camera_id, params FROM cameras').fetchall():
    params = list(struct.unpack('<%dd' % (len(blob) // 8), blob))
    params[:2] = [factor * value for value in params[:2]]
    database.execute('UPDATE cameras SET params = ? WHERE camera_id = ?',
                     (struct.pack('<%dd' % len(params), *params), camera_id))
  database.commit()
  database.close()
  edit_calibration(folder, lambda text: re.sub(
      r'intrinsics: \[([\d.]+), ([\d.]+)',
      lambda match: 'intrinsics: [%g, %g' % tuple(
          factor * float(value) for value in match.groups()), text))


def forget_focal_length(folder):
  """Marks the focal length in the database as not known."""
  database = sqlite3.connect(os.path.join(folder, 'database.db'))
  database.execute('UPDATE cameras SET prior_focal_length = 0')
  database.commit()
  database.close()
