# SPDX-License-Identifier: BSD-3-Clause
"""Handheld recordings of public repositories as folders of photos and logs.

A folder of clones holds `edge-slam-rgb-imu` (of Rajat-Roy: two walks with an
Android phone, SLAM logger) and `DM-VIO-dataset` (of Zoltan3057: a RealSense
camera). Neither has a licence, so nothing of them is kept here.
"""

import bisect
import json
import os

EVERY = 3  # of 18 to 30 frames a second
NUM_FRAMES = 610

PHONES = 'edge-slam-rgb-imu/slam-mvp/data'
RECORDINGS = {
    'phone 1': PHONES + '/slam_session_20250923_102213',
    'phone 2': PHONES + '/slam_session_20250923_090335_old',
    'RealSense': 'DM-VIO-dataset',
}
# Android's sensor axes on a phone held upright, whose photos are rotated by 90
# deg. The noise is typical of consumer IMUs; these are not calibrated.
PHONE_SENSORS = '''cam0:
  T_cam_imu:
    - [0, -1, 0, 0]
    - [-1, 0, 0, 0]
    - [0, 0, -1, 0]
    - [0, 0, 0, 1]
  timeshift_cam_imu: 0.0
imu0:
  update_rate: 200
  gyroscope_noise_density: 0.0005
  gyroscope_random_walk: 2e-05
  accelerometer_noise_density: 0.005
  accelerometer_random_walk: 0.0005
'''
# As in the repository's own files, except for the time offset.
REALSENSE_SENSORS = '''cam0:
  camera_model: pinhole
  distortion_model: none
  intrinsics: [906.259766, 906.550964, 642.896362, 353.142242]
  resolution: [1280, 720]
  T_cam_imu:
    - [0.99994214, 0.00945273, -0.0050503, 0.01205559]
    - [-0.00932683, 0.99965867, 0.02439719, -0.00234671]
    - [0.00527919, -0.02434868, 0.99968917, -0.00226012]
    - [0, 0, 0, 1]
  timeshift_cam_imu: 0.0
imu0:
  update_rate: 200
  gyroscope_noise_density: 3.7425273e-05
  gyroscope_random_walk: 2.5996761e-06
  accelerometer_noise_density: 0.1829589
  accelerometer_random_walk: 0.0244804
'''


def read_objects(path):
  """Consecutive JSON objects, each on any number of lines; an incomplete object
  ends the list."""
  with open(path) as file:
    text = file.read()
  decoder = json.JSONDecoder()
  objects = []
  position = 0
  while True:
    while position < len(text) and text[position] in ' \r\n\t,':
      position += 1
    if position == len(text):
      return objects
    try:
      value, position = decoder.raw_decode(text, position)
    except ValueError:
      return objects
    objects.append(value)


def join_samples(gyroscope, accelerometer):
  """[(t, w, a)] at the gyroscope's times, with the accelerometer interpolated,
  from two lists of (t, (x, y, z)). The resulting times strictly increase."""
  gyroscope, accelerometer = sorted(gyroscope), sorted(accelerometer)
  times = [t for t, _ in accelerometer]
  samples = []
  for t, rate in gyroscope:
    k = bisect.bisect_left(times, t)
    if (samples and t <= samples[-1][0]) or k == len(times) or t < times[0]:
      continue
    if times[k] == t:
      force = accelerometer[k][1]
    else:
      share = (t - times[k - 1]) / (times[k] - times[k - 1])
      force = [a + share * (b - a) for a, b in zip(accelerometer[k - 1][1],
                                                   accelerometer[k][1])]
    samples.append((t, tuple(rate), tuple(force)))
  return samples


def _phone(source):
  frames = [(frame['timestamp'],
             os.path.join(source, 'images', frame['fileName']))
            for frame in read_objects(os.path.join(source, 'data',
                                                   'camera_frames.jsonl'))]
  samples = {1: [], 4: []}  # Android's numbers: accelerometer, gyroscope
  for sample in read_objects(os.path.join(source, 'data', 'imu_data.jsonl')):
    if sample['sensorType'] in samples:
      values = sample['values']
      values = list(values.values() if isinstance(values, dict) else values)
      samples[sample['sensorType']].append((sample['timestamp'], values[:3]))
  return frames, join_samples(samples[4], samples[1]), PHONE_SENSORS


def _realsense(source):
  def rows(name):
    with open(os.path.join(source, name)) as file:
      return [line.split() for line in file if line.strip() and line[0] != '#']
  frames = [(int(row[0]), os.path.join(source, 'cam0', 'images',
                                       row[0] + '.jpg'))
            for row in rows('cam0/times.txt')]
  samples = [(int(row[0]), row[1:4], row[4:7]) for row in rows('imu.txt')]
  return frames, samples, REALSENSE_SENSORS


def prepare(name, clones, folder):
  """Fills folder with images/, times.csv, imu.csv and sensors.yaml; returns the
  number of photos."""
  source = os.path.join(clones, RECORDINGS[name])
  frames, samples, sensors = (_phone if source.startswith(os.path.join(
      clones, PHONES)) else _realsense)(source)
  frames = [frame for frame in frames[:NUM_FRAMES:EVERY]
            if os.path.exists(frame[1])]
  os.makedirs(os.path.join(folder, 'images'))
  with open(os.path.join(folder, 'times.csv'), 'w') as file:
    file.write('#timestamp [ns],filename\n')
    for t, path in frames:
      file.write('%d,%s\n' % (t, os.path.basename(path)))
      os.symlink(os.path.abspath(path), os.path.join(
          folder, 'images', os.path.basename(path)))
  with open(os.path.join(folder, 'imu.csv'), 'w') as file:
    file.write('#timestamp [ns],w_x,w_y,w_z,a_x,a_y,a_z\n')
    for t, rate, force in samples:
      file.write('%d,%s\n' % (t, ','.join(map(str, rate + force))))
  with open(os.path.join(folder, 'sensors.yaml'), 'w') as file:
    file.write(sensors)
  return len(frames)
