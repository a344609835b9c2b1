# SPDX-License-Identifier: BSD-3-Clause
"""The sets of the benchmark: worlds that are made, and real sequences."""

import os
import re
import shutil

from benchmarking.host_options import feature_groups
from benchmarking.process import run


# What makes each kind of world hard, as arguments of adasfm_synthesizer. A set
# is called KIND-IMAGES; blackouts and slips do not depend on the size.
KINDS = {
    'clean': [],
    'alias': ['--alias_ratio', '0.05', '--num_blackouts', '2',
              '--wheel_slips', '2'],
    'blackout': ['--num_blackouts', '3'],
    'straight': ['--trajectory', 'straight'],
    'sparse': ['--num_keypoints', '100', '--num_neighbors', '4',
               '--spacing', '2'],
    'fisheye': ['--camera_model', 'OPENCV_FISHEYE'],
    'noisy': ['--pixel_noise', '3', '--num_keypoints', '200'],
    'outliers': ['--outlier_ratio', '0.8', '--num_keypoints', '400'],
}

# Real sequences (or worlds of other generators) in the folder --data_path.
REAL_SETS = ['kitti01-51', 'kitti06-51', 'kitti07-160', 'world-alias-300',
             'world-clean-300', 'world-hard-400', 'world-kitti10-592']

QUICK = ['clean-250', 'clean-500', 'clean-1000', 'alias-300', 'blackout-250',
         'straight-250', 'sparse-250', 'fisheye-250']
FULL = QUICK + ['clean-2000', 'clean-4000', 'clean-10000', 'alias-1000',
                'blackout-1000', 'straight-1000', 'sparse-1000',
                'fisheye-1000']


def is_world(name):
  kind, _, size = name.partition('-')
  return kind in KINDS and size.isdigit()


def is_clean(name):
  return is_world(name) and name.startswith('clean-')


def size_of(world):
  return int(world.partition('-')[2])


def shrink(world, max_num_images):
  return '%s-%d' % (world.partition('-')[0],
                    min(size_of(world), max_num_images))


def camera_params(sensors_path):
  """cam0's parameters for COLMAP's PINHOLE: pixel centres are at 0.5."""
  with open(sensors_path) as file:
    match = re.search(r'intrinsics:\s*\[([^\]]*)\]', file.read())
  fx, fy, cx, cy = (float(number) for number in match.group(1).split(','))
  return '%.12g,%.12g,%.12g,%.12g' % (fx, fy, cx + 0.5, cy + 0.5)


def make_database(name, folder, args):
  """Fills folder with database.db; returns the folder of the sensor logs."""
  log_path = os.path.join(folder, 'make.log')
  database = os.path.join(folder, 'database.db')
  if is_world(name):
    # gt.txt is written last, so an incomplete world is made again.
    if not os.path.exists(os.path.join(folder, 'gt.txt')):
      if os.path.exists(database):
        os.remove(database)
      run([args.colmap, 'adasfm_synthesizer', '--output_path', folder,
           '--seed', str(args.seed), '--num_images', str(size_of(name))] +
          KINDS[name.partition('-')[0]], log_path)
    return folder
  source = os.path.join(args.data_path, name)
  if os.path.exists(database):
    return source
  if os.path.exists(os.path.join(source, 'database.db')):
    copy_whole(os.path.join(source, 'database.db'), database)
    return source
  copy_features(name, source, database, args, log_path)
  return source


def add_features_argument(parser):
  parser.add_argument('--features_path', default='',
                      help="folder of COLMAP's databases of the real photos; "
                      'default: features in that of --output_path')


def set_features_path(args):
  args.features_path = args.features_path or os.path.join(args.output_path,
                                                          'features')


def copy_features(name, source, database, args, log_path):
  """Copies COLMAP's features and matches of real photos. They are computed
  once, since they do not depend on our version."""
  features = os.path.join(args.features_path, name + '.db')
  if not os.path.exists(features):
    os.makedirs(args.features_path, exist_ok=True)
    extract_and_match(source, features, args, log_path)
  copy_whole(features, database)


def copy_whole(source, target):
  """Copies a file; an interrupted copy is left under another name."""
  shutil.copyfile(source, target + '.part')
  os.replace(target + '.part', target)


def extract_and_match(source, database, args, log_path):
  temporary = database + '.part'
  if os.path.exists(temporary):
    os.remove(temporary)
  extraction, matching = feature_groups(args.colmap)
  run([args.colmap, 'feature_extractor', '--database_path', temporary,
       '--image_path', os.path.join(source, 'images'),
       '--ImageReader.single_camera', '1',
       '--ImageReader.camera_model', 'PINHOLE', '--ImageReader.camera_params',
       camera_params(os.path.join(source, 'sensors.yaml')),
       '--%s.use_gpu' % extraction, '0',
       '--SiftExtraction.max_num_features', '2000'], log_path)
  run([args.colmap, 'sequential_matcher', '--database_path', temporary,
       '--SequentialMatching.overlap', '8', '--%s.use_gpu' % matching, '0'],
      log_path)
  os.rename(temporary, database)
