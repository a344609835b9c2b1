#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Runs COLMAP's mappers and AdaSfM side by side on the same databases.

Every figure of the README's tables comes from here. For each set it makes or
copies a database, runs the methods in turn, and writes one JSON line per run
and a Markdown table. Sets are made by `adasfm_synthesizer`; real sequences are
used when a folder with them is given. Only Python's standard library is needed.
"""

import argparse
import json
import os
import re
import shutil
import sqlite3
import struct
import subprocess
import sys
import time

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))

# Arguments of adasfm_synthesizer for each set that is made.
WORLDS = {
    'clean-250': ['--num_images', '250'],
    'clean-500': ['--num_images', '500'],
    'clean-1000': ['--num_images', '1000'],
    'clean-2000': ['--num_images', '2000'],
    'clean-4000': ['--num_images', '4000'],
    'straight-250': ['--num_images', '250', '--trajectory', 'straight'],
    'alias-300': ['--num_images', '300', '--alias_ratio', '0.05',
                  '--num_blackouts', '1', '--wheel_slips', '2'],
    'alias-500': ['--num_images', '500', '--alias_ratio', '0.05',
                  '--num_blackouts', '2', '--wheel_slips', '2'],
    'fisheye-250': ['--num_images', '250', '--camera_model',
                    'OPENCV_FISHEYE'],
}

# Real sequences (or worlds of other generators) in the folder --data_path.
REAL_SETS = ['kitti01-51', 'kitti06-51', 'kitti07-160', 'world-alias-300']

METHODS = ['mapper', 'hierarchical_mapper', 'adasfm', 'adasfm_no_sensors']


class Failed(Exception):
  """A command that did not end well; its output is in the log."""


def run(arguments, log_path):
  """Runs a command; returns (wall s, CPU s, peak MiB). Raises Failed."""
  started = time.monotonic()
  with open(log_path, 'ab') as log:
    log.write(('$ ' + ' '.join(arguments) + '\n').encode())
    log.flush()
    process = subprocess.Popen(arguments, stdout=log, stderr=log)
    _, status, usage = os.wait4(process.pid, 0)
  process.returncode = os.waitstatus_to_exitcode(status)
  if process.returncode != 0:
    raise Failed('%s ended with %d, see %s' %
                 (arguments[1], process.returncode, log_path))
  return (time.monotonic() - started, usage.ru_utime + usage.ru_stime,
          usage.ru_maxrss / 1024)


def camera_params(sensors_path):
  with open(sensors_path) as file:
    match = re.search(r'intrinsics:\s*\[([^\]]*)\]', file.read())
  return match.group(1).replace(' ', '')


def make_database(name, folder, args):
  """Fills folder with database.db; returns the folder of the sensor logs."""
  log_path = os.path.join(folder, 'make.log')
  database = os.path.join(folder, 'database.db')
  if name in WORLDS:
    if not os.path.exists(database):
      run([args.colmap, 'adasfm_synthesizer', '--output_path', folder,
           '--seed', str(args.seed)] + WORLDS[name], log_path)
    return folder
  source = os.path.join(args.data_path, name)
  if os.path.exists(database):
    return source
  if os.path.exists(os.path.join(source, 'database.db')):
    shutil.copy(os.path.join(source, 'database.db'), database)
    return source
  temporary = database + '.part'
  if os.path.exists(temporary):
    os.remove(temporary)
  run([args.colmap, 'feature_extractor', '--database_path', temporary,
       '--image_path', os.path.join(source, 'images'),
       '--ImageReader.single_camera', '1',
       '--ImageReader.camera_model', 'PINHOLE', '--ImageReader.camera_params',
       camera_params(os.path.join(source, 'sensors.yaml')),
       '--SiftExtraction.use_gpu', '0',
       '--SiftExtraction.max_num_features', '2000'], log_path)
  run([args.colmap, 'sequential_matcher', '--database_path', temporary,
       '--SequentialMatching.overlap', '8', '--SiftMatching.use_gpu', '0'],
      log_path)
  os.rename(temporary, database)
  return source


def evaluate(model_path, ground_truth_path, args, log_path):
  """The evaluator's figures, or None when there is no model."""
  if not os.path.isdir(model_path) or not os.listdir(model_path):
    return None
  json_path = model_path.rstrip('/') + '.evaluation.json'
  try:
    run([args.colmap, 'adasfm_evaluator', '--input_path', model_path,
         '--ground_truth_path', ground_truth_path, '--json_path', json_path],
        log_path)
  except Failed:
    return None
  with open(json_path) as file:
    return json.load(file)


def quaternion_product(a, b):
  w, x, y, z = a
  e, f, g, h = b
  return (w * e - x * f - y * g - z * h, w * f + x * e + y * h - z * g,
          w * g - x * h + y * e + z * f, w * h + x * g - y * f + z * e)


def rotate(q, v):
  conjugate = (q[0], -q[1], -q[2], -q[3])
  return quaternion_product(quaternion_product(q, (0.0,) + tuple(v)),
                            conjugate)[1:]


def write_prior_trajectory(database, model_path):
  """Chains the priors into a model of poses only; False without priors."""
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
    turned = rotate(q12, t1)
    poses[id2] = (name2, quaternion_product(q12, q1),
                  tuple(a + b for a, b in zip(turned, t12)))
  if len(poses) < 3:
    return False
  os.makedirs(model_path, exist_ok=True)
  with open(os.path.join(model_path, 'cameras.txt'), 'w') as file:
    file.write('1 PINHOLE 100 100 100 100 50 50\n')
  with open(os.path.join(model_path, 'images.txt'), 'w') as file:
    for image_id, (name, q, t) in sorted(poses.items()):
      file.write('%d %s 1 %s\n\n' %
                 (image_id, ' '.join('%.12g' % x for x in q + t), name))
  open(os.path.join(model_path, 'points3D.txt'), 'w').close()
  return True


def fixed_intrinsics():
  return ['--Mapper.ba_refine_focal_length', '0',
          '--Mapper.ba_refine_extra_params', '0']


def run_mapper(command, executable, folder, source, args):
  images = os.path.join(source, 'images')
  output = os.path.join(folder, 'model')
  os.makedirs(output)
  arguments = [executable, command, '--database_path',
               os.path.join(folder, 'database.db'), '--output_path', output]
  if command in ('mapper', 'hierarchical_mapper'):
    arguments += ['--image_path', images if os.path.isdir(images) else folder]
    arguments += fixed_intrinsics()
  usage = run(arguments, os.path.join(folder, 'run.log'))
  return output, {command: usage}


def run_adasfm(folder, source, args, sensors):
  database = os.path.join(folder, 'database.db')
  log_path = os.path.join(folder, 'run.log')
  steps = {}
  if sensors:
    arguments = [args.colmap, 'adasfm_prior_importer', '--database_path',
                 database]
    for option, file in (('image_times', 'times.csv'), ('imu', 'imu.csv'),
                         ('wheel', 'wheel.csv'), ('sensors', 'sensors.yaml')):
      arguments += ['--%s_path' % option, os.path.join(source, file)]
    steps['import'] = run(arguments, log_path)
  steps['global'] = run([args.colmap, 'adasfm_global', '--database_path',
                         database, '--output_path',
                         os.path.join(folder, 'global')], log_path)
  output = os.path.join(folder, 'model')
  steps['mapper'] = run([args.colmap, 'adasfm_mapper', '--database_path',
                         database, '--input_path',
                         os.path.join(folder, 'global', '0'),
                         '--output_path', output], log_path)
  return output, steps


def run_method(name, method, folder, source, args):
  """One JSON record, or several when a run gives several models."""
  shutil.rmtree(folder, ignore_errors=True)
  os.makedirs(folder)
  shutil.copy(os.path.join(args.output_path, name, 'database.db'), folder)
  ground_truth = os.path.join(source, 'gt.txt')
  log_path = os.path.join(folder, 'run.log')
  record = {'set': name, 'method': method}
  try:
    if method in ('adasfm', 'adasfm_no_sensors'):
      output, steps = run_adasfm(folder, source, args, method == 'adasfm')
    elif method in args.peers:
      executable, command = args.peers[method]
      output, steps = run_mapper(command, executable, folder, source, args)
    else:
      output, steps = run_mapper(method, args.host_colmap or args.colmap,
                                 folder, source, args)
  except Failed as error:
    record['error'] = str(error)
    output, steps = os.path.join(folder, 'model'), {}
  record['seconds'] = round(sum(u[0] for u in steps.values()), 2)
  record['cpu_seconds'] = round(sum(u[1] for u in steps.values()), 2)
  record['peak_mib'] = round(max([u[2] for u in steps.values()] or [0]))
  record['step_seconds'] = {k: round(u[0], 2) for k, u in steps.items()}
  record['evaluation'] = evaluate(output, ground_truth, args, log_path)
  records = [record]
  if method == 'adasfm' and not record.get('error'):
    seconds = steps['import'][0] + steps['global'][0]
    records.insert(0, {
        'set': name, 'method': 'adasfm_global', 'seconds': round(seconds, 2),
        'evaluation': evaluate(os.path.join(folder, 'global', '0'),
                               ground_truth, args, log_path)})
    priors = os.path.join(folder, 'priors')
    if write_prior_trajectory(os.path.join(folder, 'database.db'), priors):
      records.insert(0, {'set': name, 'method': 'priors_only',
                         'seconds': round(steps['import'][0], 2),
                         'evaluation': evaluate(priors, ground_truth, args,
                                                log_path)})
  return records


def table(records):
  lines = ['| set | method | images | points | track | RMSE px | error m '
           '(Sim3) | error m (SE3) | scale | rotation deg | s | MiB |',
           '|---|---|---|---|---|---|---|---|---|---|---|---|']
  for record in records:
    e = record.get('evaluation')
    if not e:
      lines.append('| %s | %s | no model | | | | | | | | %s | |' %
                   (record['set'], record['method'], record['seconds']))
      continue
    lines.append('| %s | %s | %d/%d | %d | %.2f | %.3f | %.3f | %.3f | %.4f '
                 '| %.3f | %.1f | %s |' %
                 (record['set'], record['method'], e['num_images'],
                  e['num_true_images'], e['num_points'],
                  e['mean_track_length'], e['rmse_px'],
                  e['sim3_least_squares']['translation_rmse_m'],
                  e['se3_least_squares']['translation_rmse_m'],
                  e['sim3']['scale'], e['sim3']['rotation_mean_deg'],
                  record['seconds'], record.get('peak_mib', '')))
  return '\n'.join(lines) + '\n'


def parse_arguments():
  parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
  parser.add_argument('sets', nargs='*',
                      help='any of: %s; default: clean-250, alias-300, '
                      'straight-250 and the real sets that are there' %
                      ', '.join(list(WORLDS) + REAL_SETS))
  parser.add_argument('--output_path', default='adasfm-benchmark',
                      help='folder of databases, models and tables')
  parser.add_argument('--data_path', default=os.path.join(ROOT, '..', 'shared',
                                                          'data'),
                      help='folder of the real sets')
  parser.add_argument('--methods', default=','.join(METHODS),
                      help='comma-separated, any of: %s' % ', '.join(METHODS))
  parser.add_argument('--peer', action='append', default=[],
                      metavar='NAME=PATH:COMMAND',
                      help='another colmap executable and its mapping command')
  parser.add_argument('--colmap', default=os.path.join(ROOT, 'build', 'bin',
                                                       'colmap'),
                      help='our launcher')
  parser.add_argument('--host_colmap', default='',
                      help="the host's executable; default: through ours")
  parser.add_argument('--seed', type=int, default=1, help='of the worlds')
  args = parser.parse_args()
  args.peers = {}
  for peer in args.peer:
    match = re.fullmatch(r'([^=]+)=(.+):([^:]+)', peer)
    if not match:
      parser.error('--peer takes NAME=PATH:COMMAND, not ' + peer)
    args.peers[match.group(1)] = (match.group(2), match.group(3))
  if not args.sets:
    args.sets = ['clean-250', 'straight-250', 'alias-300'] + [
        s for s in REAL_SETS if os.path.isdir(os.path.join(args.data_path, s))]
  for name in args.sets:
    if name not in WORLDS and not os.path.isdir(
        os.path.join(args.data_path, name)):
      parser.error('no such set: %s' % name)
  return args


def main():
  args = parse_arguments()
  os.makedirs(args.output_path, exist_ok=True)
  records = []
  for name in args.sets:
    folder = os.path.join(args.output_path, name)
    os.makedirs(folder, exist_ok=True)
    source = make_database(name, folder, args)
    for method in args.methods.split(',') + list(args.peers):
      print('%s: %s' % (name, method), file=sys.stderr, flush=True)
      new = run_method(name, method, os.path.join(folder, method), source,
                       args)
      records += new
      with open(os.path.join(args.output_path, 'results.jsonl'), 'a') as file:
        for record in new:
          file.write(json.dumps(record) + '\n')
  with open(os.path.join(args.output_path, 'results.md'), 'w') as file:
    file.write(table(records))
  print(table(records))


if __name__ == '__main__':
  main()
