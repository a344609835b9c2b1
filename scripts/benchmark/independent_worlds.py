#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Worlds of a second generator, which shares nothing with adasfm_synthesizer.

This generator has its own streets, motion, sensors, visibility and noise;
COLMAP itself verifies the matches. Writes into a folder the input of the three
commands (database.db, imu.csv, wheel.csv, times.csv, sensors.yaml), the truth
(gt.txt) and a description of the world (world.json).
docs/guide/synthetic.md describes the generator. Needs numpy.
"""

import argparse
import json
import os
import sys

import numpy as np

from independent import files, images, motion, streets

MIN_NUM_MATCHES = 20
# Grid of junctions [m] and their jitter, lateral distance of facades, their
# height and distance from junctions, radius of corners [m], metres per image,
# speed [m/s]. alias_classes: templates per street (below 1 some streets look
# alike); alias_share: share of a street's landmarks with the template's looks.
TOWN = dict(grid=(58.0, 47.0), jitter=7.0, setback=(5.0, 9.0), height=9.0,
            clear=7.0, corner=3.0, weave=0.35, hills=0.15, spacing=1.5,
            speed=8.0, camera_height=1.3, outlier_ratio=0.15, alias_classes=1.0,
            alias_share=0.7, num_blackouts=0, num_slips=2, num_holes=0)
KINDS = {
    'clean': {},
    'hard': dict(outlier_ratio=0.4, alias_classes=0.7, num_blackouts=4,
                 num_slips=5),
    'alias': dict(alias_classes=0.5, num_blackouts=1),
    'hole': dict(num_holes=2),
    'carpark': dict(grid=(24.0, 16.0), jitter=0.0, setback=(3.0, 3.4),
                    height=2.6, clear=3.5, corner=1.5, spacing=0.6, speed=3.0,
                    alias_classes=0.05, alias_share=0.4),
    'mower': dict(corner=0.2, weave=0.06, hills=0.03, spacing=0.3, speed=0.7,
                  camera_height=0.6, num_slips=3),
}
# Pairs farther apart than this [m] join different places.
FAR_M = {'mower': 8.0, 'carpark': 14.0}


def make_scene(kind, args, length_m, rng):
  """Landmarks, the route as a polyline, and a function from positions and
  vertices to places."""
  if args.kind == 'mower':
    polyline = streets.mow(length_m)
    return (streets.build_lawn(polyline, rng), polyline,
            lambda positions, vertices: [None] * len(positions))
  junctions, route = streets.walk_streets(kind, length_m, rng)
  landmarks, templates = streets.build_town(kind, junctions, route, rng)
  return (landmarks, junctions[route],
          lambda *where: streets.image_places(junctions, route, templates,
                                              *where))


def make_mounting(kind, rng):
  """wheel_from_imu with a small rotation, and wheel_from_cam of a camera that
  looks ahead."""
  wheel_from_imu, wheel_from_cam = np.eye(4), np.eye(4)
  wheel_from_imu[:3, :3] = motion.euler(*rng.normal(0, np.radians(1.5), 3))
  wheel_from_imu[:3, 3] = [0.35, -0.12, 0.3]
  turn = rng.normal(0, np.radians(1.0), 3) + [0, np.radians(3.0), 0]
  wheel_from_cam[:3, :3] = motion.euler(*turn) @ [[0, 0, 1], [-1, 0, 0],
                                                  [0, -1, 0]]
  wheel_from_cam[:3, 3] = [0.8, 0.06, kind['camera_height']]
  return wheel_from_imu, wheel_from_cam


def image_times(kind, num_images):
  """Image times [s], evenly spaced except for holes, each as long as a twelfth
  of num_images."""
  missing = num_images // 12
  times = (motion.STANDSTILL_S + 0.2 + kind['spacing'] / kind['speed'] *
           np.arange(num_images + missing * kind['num_holes']))
  for hole in range(kind['num_holes']):
    begin = int((hole + 0.6) * num_images / kind['num_holes'])
    times = np.delete(times, slice(begin, begin + missing))
  return np.round(times, 3)


def choose_blackouts(count, num_images, rng):
  """First and last image of `count` intervals without texture, one in each of
  `count` equal parts of the drive."""
  blackouts = []
  for i in range(count):
    begin = int((i + rng.uniform(0.3, 0.7)) * num_images / count)
    length = min(int(rng.integers(5, 16)), num_images // (4 * count))
    blackouts.append((begin, min(begin + length, num_images - 4) - 1))
  return blackouts


def take_images(kind, args, landmarks, poses, rng):
  blackouts = choose_blackouts(kind['num_blackouts'], len(poses), rng)
  dark = {i for begin, end in blackouts for i in range(begin, end + 1)}
  taken = [images.take_image(*pose, landmarks, args, rng) for pose in poses]
  return blackouts, [images.darken(image, i, rng) if i in dark else image
                     for i, image in enumerate(taken)]


def match_images(kind, taken, poses, places, rng):
  matches = {}
  for i, j in images.candidate_pairs(poses, places, kind['spacing'], rng):
    found = images.match(taken[i], taken[j], kind['outlier_ratio'], rng)
    if len(found) >= MIN_NUM_MATCHES:
      matches[i, j] = found
  return matches


def summarize(args, poses, pairs, **more):
  centers = np.array([center for center, _ in poses])
  apart = np.array([np.linalg.norm(centers[i] - centers[j]) for i, j in pairs])
  is_far = apart > FAR_M.get(args.kind, 45.0)
  gap = np.array([abs(i - j) for i, j in pairs])
  return dict(vars(args), length_m=round(float(motion.lengths(centers)[-1]), 1),
              num_verified_pairs=len(pairs), num_far_pairs=int(is_far.sum()),
              num_revisit_pairs=int((~is_far & (gap > 15)).sum()), **more)


def make_world(args):
  rng = np.random.default_rng(args.seed)
  kind = {**TOWN, **KINDS[args.kind], 'spoil': args.spoil}
  if args.num_blackouts is not None:
    kind['num_blackouts'] = args.num_blackouts
  times = image_times(kind, args.num_images)
  duration_s = times[-1] - motion.STANDSTILL_S + 0.5
  landmarks, polyline, find_places = make_scene(
      kind, args, 1.1 * duration_s * kind['speed'] + 60.0, rng)
  moved = motion.drive(kind, polyline, duration_s, rng)
  wheel_from_imu, wheel_from_cam = make_mounting(kind, rng)
  rows = np.round(times * motion.RATE_HZ).astype(int)
  poses = [(p + r @ wheel_from_cam[:3, 3], (r @ wheel_from_cam[:3, :3]).T)
           for p, r in zip(moved.position[rows], moved.rotation[rows])]
  blackouts, taken = take_images(kind, args, landmarks, poses, rng)
  places = find_places(moved.position[rows], moved.vertex[rows])
  matches = match_images(kind, taken, poses, places, rng)

  os.makedirs(args.output_path)
  path = lambda name: os.path.join(args.output_path, name)
  names = ['%06d.png' % i for i in range(1, len(poses) + 1)]
  files.write_times(path('times.csv'), times, names)
  files.write_truth(path('gt.txt'), names, poses)
  files.write_log(path('imu.csv'), 'w_x [rad s^-1],w_y [rad s^-1],w_z [rad s^-1]'
                  ',a_x [m s^-2],a_y [m s^-2],a_z [m s^-2]',
                  *motion.imu_log(moved, wheel_from_imu, args.spoil, rng))
  wheel_times, wheels, slips = motion.wheel_log(moved, kind, rng)
  files.write_log(path('wheel.csv'), 'v_left [m s^-1],v_right [m s^-1]',
                  wheel_times, wheels)
  cam_from_imu = np.linalg.inv(wheel_from_cam) @ wheel_from_imu
  error = rng.normal(0, args.spoil * np.radians(0.15), 3)
  cam_from_imu[:3, :3] = motion.euler(*error) @ cam_from_imu[:3, :3]
  files.write_calibration(path('sensors.yaml'), cam_from_imu,
                          np.linalg.inv(wheel_from_imu))
  pairs = files.write_database(path('database.db'), args, names,
                               [image['pixels'] for image in taken], matches)
  summary = summarize(args, poses, pairs, num_matched_pairs=len(matches),
                      blackouts=blackouts, slips_s=slips)
  with open(path('world.json'), 'w') as file:
    json.dump(summary, file, indent=1)
  print(json.dumps(summary))


def main():
  root = os.path.join(os.path.dirname(os.path.abspath(__file__)), '..', '..')
  parser = argparse.ArgumentParser(
      description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
  parser.add_argument('--output_path', required=True, help='a new folder')
  parser.add_argument('--kind', choices=KINDS, default='clean')
  parser.add_argument('--num_images', type=int, default=300)
  parser.add_argument('--seed', type=int, default=1)
  parser.add_argument('--camera_model', choices=images.CAMERAS,
                      default='PINHOLE')
  parser.add_argument('--num_keypoints', type=int, default=320)
  parser.add_argument('--pixel_noise', type=float, default=0.6,
                      help='sigma of keypoints; one in twenty errs thrice that')
  parser.add_argument('--num_blackouts', type=int,
                      help="stretches without texture; default: the kind's")
  parser.add_argument('--spoil', type=float, default=1.0,
                      help='0: sensors as the calibration states them; 1: a '
                      'standstill that turns, wheels 1.2 and 0.8 %% too fast, '
                      'noise half as large again, camera turned by 0.15 deg')
  parser.add_argument('--colmap', default=os.path.join(root, 'build', 'bin',
                                                       'colmap'),
                      help='makes the database and verifies the matches')
  args = parser.parse_args()
  if args.num_images < 16:
    parser.error('--num_images must be at least 16')
  if os.path.exists(args.output_path):
    parser.error('%s exists' % args.output_path)
  make_world(args)
  return 0


if __name__ == '__main__':
  sys.exit(main())
