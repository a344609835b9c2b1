#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Real photos from an empty workspace to a model, beside COLMAP's mappers.

Runs `adasfm_automatic_reconstructor` on each set of photos, with logs if the
set has them, as it is and with cheaper features. On the resulting database it
runs adasfm_mapper with parts of at most 50 images and, with the geometries as
COLMAP verified them, the mappers of COLMAP 3.8 and 4. Writes
docs/results/photos.md. Needs only Python's standard library.
"""

import argparse
import functools
import json
import os
import shutil
import struct
import sys

from benchmarking.figures import add_arguments, measure, run_table
from benchmarking.host_options import version_of
from benchmarking.methods import SMALL_PARTS, log_options, run_mapper
from benchmarking.process import Failed, run
from benchmarking.sets import camera_params

# Sets and their camera options. None: parameters of sensors.yaml, with the set's
# logs; empty: EXIF's focal length, which is refined.
PHOTOS = {
    'kitti01-51': None,
    'kitti06-51': None,
    'kitti07-160': None,
    '7scenes-kitchen-200': ['--camera_model', 'PINHOLE', '--camera_params',
                            '525,525,320,240'],
    'lund-29': [],
}
VARIANTS = {
    'one command': [],
    '`--extractor opencv`': ['--extractor', 'opencv'],
    '`--first_octave 0`': ['--first_octave', '0'],
}
PARTS_NAME = 'mapper alone, parts of 50'


def options_of(name, args):
  """Options of the command besides the paths of photos and workspace."""
  source = os.path.join(args.data_path, name)
  options = PHOTOS[name]
  if options is None:
    options = ['--camera_model', 'PINHOLE', '--camera_params',
               camera_params(os.path.join(source, 'sensors.yaml')),
               *log_options(source)]
  return options


def count(model, file):
  """The count at the beginning of a file of COLMAP's binary models."""
  with open(os.path.join(model, file), 'rb') as stream:
    return struct.unpack('<Q', stream.read(8))[0]


def outcome(output, source, usage, args, log_path):
  """Images of all models, points and error of the largest, CPU time, memory."""
  result = {'cpu_s': round(usage.cpu_seconds, 1),
            'peak_mib': round(usage.peak_mib)}
  models = [os.path.join(output, name) for name in sorted(os.listdir(output))
            if os.path.exists(os.path.join(output, name, 'images.bin'))]
  result['images'] = sorted((count(m, 'images.bin') for m in models),
                            reverse=True)
  if models:
    model = max(models, key=lambda m: count(m, 'images.bin'))
    result['points'] = count(model, 'points3D.bin')
    if os.path.exists(os.path.join(source, 'gt.txt')):
      result['model'] = measure(model, source, args, log_path)
  return result


def attempt(function):
  try:
    return function()
  except Failed as error:
    return {'error': str(error)}


def run_ours(name, extra, folder, args):
  source = os.path.join(args.data_path, name)
  log_path = folder + '.log'
  usage = run([args.colmap, 'adasfm_automatic_reconstructor', '--image_path',
               os.path.join(source, 'images'), '--workspace_path', folder,
               *options_of(name, args), *extra], log_path)
  return outcome(os.path.join(folder, 'sparse'), source, usage, args, log_path)


def run_parts(name, workspace, folder, args):
  source = os.path.join(args.data_path, name)
  log_path = folder + '.log'
  os.makedirs(folder)
  database = os.path.join(folder, 'database.db')
  shutil.copy(os.path.join(workspace, 'database.db'), database)
  output = os.path.join(folder, 'sparse')
  usage = run([args.colmap, 'adasfm_mapper', '--database_path', database,
               '--input_path', os.path.join(workspace, 'coarse'),
               '--output_path', output, *SMALL_PARTS], log_path)
  with open(os.path.join(output, 'summary.json')) as file:
    num_parts = len(json.load(file)['parts'])
  return dict(outcome(output, source, usage, args, log_path), parts=num_parts)


def run_peer(source, fixed, command, executable, workspace, folder, args):
  """Runs a mapper of COLMAP on the geometries as before adasfm_global."""
  log_path = folder + '.log'
  os.makedirs(folder)
  database = os.path.join(folder, 'database.db')
  shutil.copy(os.path.join(workspace, 'database.db'), database)
  run([args.colmap, 'adasfm_restorer', '--database_path', database], log_path)
  output, steps = run_mapper(command, executable, folder, source, args, fixed)
  return outcome(output, source, steps[command], args, log_path)


def peers_of(args):
  """{heading: (command, program)}."""
  peers = {'COLMAP %s mapper' % version_of(args.colmap):
           ('mapper', args.colmap)}
  if args.colmap4:
    for command in ('mapper', 'global_mapper'):
      peers['COLMAP %s %s' % (version_of(args.colmap4), command)] = (
          command, args.colmap4)
  return peers


def run_set(name, args):
  top = os.path.join(args.output_path, name)
  shutil.rmtree(top, ignore_errors=True)
  os.makedirs(top)
  methods = {}
  for i, (variant, extra) in enumerate(VARIANTS.items()):
    methods[variant] = attempt(lambda: run_ours(
        name, extra, os.path.join(top, 'ours-%d' % i), args))
  workspace = os.path.join(top, 'ours-0')
  methods[PARTS_NAME] = attempt(lambda: run_parts(
      name, workspace, os.path.join(top, 'parts'), args))
  for i, (heading, (command, executable)) in enumerate(peers_of(args).items()):
    methods[heading] = attempt(lambda: run_peer(
        os.path.join(args.data_path, name), bool(options_of(name, args)),
        command, executable, workspace, os.path.join(top, 'peer-%d' % i), args))
  if not args.keep:
    shutil.rmtree(top)
  return {'set': name, 'methods': methods}


def row(name, method, result, num_photos):
  if 'error' in result or not result['images']:
    return '| %s | %s | no model%s | | | | %s | %s |' % (
        name, method, ': ' + result['error'] if 'error' in result else '',
        result.get('cpu_s', ''), result.get('peak_mib', ''))
  if 'parts' in result:
    method += ' (%d)' % result['parts']
  model = result.get('model')
  return '| %s | %s | %s of %d | %s | %s | %s | %.0f | %d |' % (
      name, method, ' + '.join(map(str, result['images'])), num_photos,
      '{:,}'.format(result['points']),
      '%.3f' % model['rmse_m'] if model else 'no truth',
      '%.3f' % model['scale'] if model and 'COLMAP' not in method and
      PHOTOS[name] is None else '', result['cpu_s'], result['peak_mib'])


def report(records, args):
  lines = ['| photos | method | images | points | error m | scale | CPU s | '
           'MiB |', '|---|---|---|---:|---:|---:|---:|---:|']
  for record in records:
    num_photos = len(os.listdir(os.path.join(args.data_path, record['set'],
                                             'images')))
    lines += [row(record['set'], method, result, num_photos)
              for method, result in record['methods'].items()]
  return '\n'.join(lines) + '\n'


def parse_arguments():
  parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
  add_arguments(parser, __file__, 'photos', 'adasfm-photos')
  parser.set_defaults(timeout=None)
  parser.add_argument('sets', nargs='*', help='any of: %s; default: all that '
                      'are there' % ', '.join(PHOTOS))
  parser.add_argument('--data_path', default='../shared/data',
                      help='folder of the photos')
  parser.add_argument('--colmap4', default='',
                      help="COLMAP 4's program; without it it is left out")
  args = parser.parse_args()
  for name in args.sets:
    if name not in PHOTOS:
      parser.error('no such set: %s; there are: %s' % (name, ', '.join(PHOTOS)))
  args.sets = args.sets or list(PHOTOS)
  there = [name for name in args.sets
           if os.path.isdir(os.path.join(args.data_path, name))]
  for name in args.sets:
    if name not in there:
      print('left out %s: not in %s' % (name, args.data_path),
            file=sys.stderr)
  if not there:
    parser.exit(0, 'no photos: no table\n')
  args.sets = there
  return args


def main():
  args = parse_arguments()
  spec = [VARIANTS, SMALL_PARTS, list(peers_of(args))]
  run_table({name: ([PHOTOS[name], *spec], functools.partial(run_set, name,
                                                             args))
             for name in args.sets}, report, args)


if __name__ == '__main__':
  sys.exit(main())
