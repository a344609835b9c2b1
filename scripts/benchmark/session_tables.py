#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Several drives in one map, and drives added to a model.

Cuts simulated worlds and a real drive into drives with their own databases,
logs and cameras, merges and maps them; maps the first images of a drive, then
all of them from scratch and with `adasfm_mapper --existing_path`. Writes the
tables of docs/guide/sessions.md and the figures behind them
(benchmark/results/sessions.json). Needs only Python's standard library.
"""

import argparse
import collections
import functools
import hashlib
import json
import os
import random
import shutil
import sys

from benchmarking import drives
from benchmarking.figures import add_arguments, measure, run_rows
from benchmarking.host_options import feature_groups
from benchmarking.ledger import describe
from benchmarking.methods import list_models, run_adasfm
from benchmarking.pages import write_table
from benchmarking.peer_tables import format_error
from benchmarking.process import Failed, run
from benchmarking.sets import (add_features_argument, copy_features, is_world,
                               make_database, set_features_path)
from benchmarking.spoil import turn_camera_about
from global_worlds import read_warnings

SYNTHESIZER = ['--alias_ratio', '0.05', '--seed', '5']
TURN_DEG = 1.0


def halves(names):
  """Every second image each."""
  return [names[0::2], names[1::2]]


def quarters(names):
  return drives.cut(names, 4)


# How a world is cut: the row's name in the table, the function that gives the
# images of each drive, whether T_cam_imu is wrong in each, and whether all
# begin at the same time.
Cut = collections.namedtuple('Cut', 'label split turned together')
CUTS = {
    'one': Cut('one drive', lambda names: [names], False, False),
    'quarters': Cut('four, one after the other; each begins where the last one '
                    'ended', quarters, False, False),
    'turned': Cut('the same, of four robots: in each `T_cam_imu` is wrong by '
                  '%g deg about another axis' % TURN_DEG, quarters, True,
                  False),
    'together': Cut('the same four, all at the same time', quarters, False,
                    True),
    'behind': Cut('two, one robot behind the other at the same time; every '
                  'second image each', halves, False, False),
}
# The cuts of worlds of so many images.
WORLDS = {240: list(CUTS), 1000: ['one', 'quarters', 'turned', 'together']}

PHOTOS = 'kitti07-160'
# The photos that two drives take in turn; the others belong to one of them.
SHARED = range(60, 100)
PHOTOS_LABEL = ('two halves, which take photos %d to %d in turn' %
                (SHARED[0], SHARED[-1]))

# Images that are mapped first. clean-500 is a world of seed 1.
EXTENDED = {'clean-500': 350, 'world-clean-300': 150, 'world-alias-300': 200,
            'world-hard-400': 250}


def make_world(num_images, args):
  """The folder of a world, which all of its rows share."""
  folder = os.path.join(args.output_path, 'world-%d' % num_images)
  if not os.path.exists(folder):
    temporary = folder + '.part'
    shutil.rmtree(temporary, ignore_errors=True)
    os.makedirs(temporary)
    run([args.colmap, 'adasfm_synthesizer', '--output_path', temporary,
         '--num_images', str(num_images)] + SYNTHESIZER,
        os.path.join(args.output_path, 'make.log'))
    os.rename(temporary, folder)
  return folder


def make_drives(source, split, folder):
  """Folders of logs {prefix: folder} and images {prefix: names} of drives."""
  names = {'s%d/' % k: part for k, part in enumerate(split(
      [name for _, name in drives.read_times(source)]))}
  folders = {prefix: os.path.join(folder, prefix[:-1]) for prefix in names}
  for prefix, part in names.items():
    drives.copy_logs(source, folders[prefix], part)
  return folders, names


def databases_of(folders):
  return {prefix: os.path.join(folder, 'database.db')
          for prefix, folder in folders.items()}


def map_drives(source, names, folder, args, record):
  """Maps the merged database; all models of both stages, what was warned of."""
  truth = os.path.join(folder, 'gt.txt')
  log_path = os.path.join(folder, 'run.log')
  drives.write_true_poses(source, names, truth)
  record['num_images'] = sum(map(len, names.values()))
  record['pairs_between'] = drives.count_pairs_between(
      os.path.join(folder, 'database.db'))
  output, _ = run_adasfm(folder, folder, args, False, {})
  for key, models in (('coarse', 'global'), ('final', 'model')):
    record[key] = list_models(os.path.join(folder, models), truth, args,
                              log_path)
  record['scale'] = measure(output, folder, args, log_path)['scale']
  with open(os.path.join(folder, 'global', 'summary.json')) as file:
    record['turned_deg'] = [
        turn['angle_deg'] for turn in json.load(file)['camera_imu_rotations']
        if turn['corrected']]
  with open(os.path.join(output, 'summary.json')) as file:
    record['verdict'] = json.load(file)['verdict']['result']
  record['warnings'] = read_warnings(log_path)


def cut_world(num_images, name, folder, args, record):
  cut = CUTS[name]
  source = make_world(num_images, args)
  folders, names = make_drives(source, cut.split, folder)
  databases = databases_of(folders)
  generator = random.Random(3)
  for prefix, drive in folders.items():
    shutil.copyfile(os.path.join(source, 'database.db'), databases[prefix])
    drives.keep_images(databases[prefix], names[prefix])
    if cut.turned:
      turn_camera_about(drive, [generator.gauss(0, 1) for _ in range(3)],
                        TURN_DEG)
  if cut.together:
    drives.begin_together(list(folders.values()))
  merged = os.path.join(folder, 'database.db')
  log_path = os.path.join(folder, 'run.log')
  drives.import_logs(folders.values(), args, log_path)
  drives.merge(databases, merged, args, log_path)
  between = os.path.join(folder, 'between.db')
  shutil.copyfile(os.path.join(source, 'database.db'), between)
  drives.keep_pairs_between(between, names)
  drives.merge({'': between}, merged, args, log_path)
  map_drives(source, names, folder, args, record)


def take_in_turn(names):
  """The photos of two drives that overlap in SHARED."""
  first, last = SHARED[0], SHARED[-1] + 1
  return [names[:first] + names[first:last:2],
          names[first + 1:last:2] + names[last:]]


def match_pairs(features, pairs, args, log_path):
  """A database of drives {prefix: database} with matches of more pairs, without
  logs. It is computed once for a list of pairs."""
  with open(pairs, 'rb') as file:
    digest = hashlib.sha256(file.read()).hexdigest()[:16]
  matched = os.path.join(args.features_path, '%s-pairs-%s.db' % (PHOTOS,
                                                                 digest))
  if not os.path.exists(matched):
    temporary = matched + '.part'
    if os.path.exists(temporary):
      os.remove(temporary)
    drives.merge(features, temporary, args, log_path)
    _, matching = feature_groups(args.colmap)
    run([args.colmap, 'matches_importer', '--database_path', temporary,
         '--match_list_path', pairs, '--%s.use_gpu' % matching, '0'], log_path)
    os.rename(temporary, matched)
  return matched


def cut_photos(folder, args, record):
  """Two drives of real photos, matched by themselves and with each other."""
  source = os.path.abspath(os.path.join(args.data_path, PHOTOS))
  log_path = os.path.join(folder, 'run.log')
  folders, names = make_drives(source, take_in_turn, folder)
  databases = databases_of(folders)
  features = {}
  for prefix, drive in folders.items():
    os.makedirs(os.path.join(drive, 'images'))
    for name in names[prefix]:
      os.symlink(os.path.join(source, 'images', name),
                 os.path.join(drive, 'images', name))
    features_name = '%s-%s' % (PHOTOS, prefix[:-1])
    copy_features(features_name, drive, databases[prefix], args, log_path)
    features[prefix] = os.path.join(args.features_path, features_name + '.db')
  merged = os.path.join(folder, 'database.db')
  drives.import_logs(folders.values(), args, log_path)
  drives.merge(databases, merged, args, log_path)
  pairs = os.path.join(folder, 'pairs.txt')
  run([args.colmap, 'adasfm_pair_generator', '--database_path', merged,
       '--output_path', pairs], log_path)
  drives.merge({'': match_pairs(features, pairs, args, log_path)}, merged, args,
               log_path)
  map_drives(source, names, folder, args, record)


def extend(name, folder, args, record):
  """Maps the first images of a drive, then all in two ways."""
  log_path = os.path.join(folder, 'run.log')
  source = os.path.abspath(make_database(name, folder, args))
  models = {}
  for part in ('before', 'scratch'):
    models[part] = os.path.join(folder, part)
    os.makedirs(models[part])
    database = os.path.join(models[part], 'database.db')
    shutil.copyfile(os.path.join(folder, 'database.db'), database)
    if part == 'before':
      names = sorted(image for _, image in drives.read_times(source))
      drives.keep_images(database, names[:EXTENDED[name]])
    run_adasfm(models[part], source, args, True, {})
  models['extended'] = os.path.join(folder, 'extended')
  run([args.colmap, 'adasfm_mapper', '--database_path',
       os.path.join(models['scratch'], 'database.db'), '--input_path',
       os.path.join(models['scratch'], 'global'), '--existing_path',
       os.path.join(models['before'], 'model', '0'), '--output_path',
       os.path.join(models['extended'], 'model')], log_path)
  for part, model in models.items():
    shutil.copyfile(os.path.join(source, 'gt.txt'),
                    os.path.join(model, 'gt.txt'))
    record[part] = measure(os.path.join(model, 'model'), model, args, log_path)


def run_row(key, function, args, **record):
  folder = os.path.abspath(os.path.join(
      args.output_path, ''.join(c if c.isalnum() else '_' for c in key)[:60]))
  shutil.rmtree(folder, ignore_errors=True)
  os.makedirs(folder)
  try:
    function(folder, args, record)
  except Failed as error:
    record['error'] = str(error)
  if not args.keep:
    shutil.rmtree(folder)
  return record


def list_drives(args):
  """{key: (spec, function)} of the rows of several drives."""
  rows = {}
  for num_images, cuts in WORLDS.items():
    for name in cuts:
      key = '%d %s' % (num_images, name)
      rows[key] = ([SYNTHESIZER, drives.MARGIN_S], functools.partial(
          run_row, key, functools.partial(cut_world, num_images, name), args,
          set=num_images, cut=name))
  if is_there(PHOTOS, args):
    rows[PHOTOS] = ([list(SHARED), drives.MARGIN_S], functools.partial(
        run_row, PHOTOS, cut_photos, args, set=PHOTOS, cut=''))
  return rows


def list_extended(args):
  """{key: (spec, function)} of the rows of extended models."""
  return {name: (num_images, functools.partial(
      run_row, 'extend ' + name, functools.partial(extend, name), args,
      set=name)) for name, num_images in EXTENDED.items()
          if is_there(name, args)}


def is_there(name, args):
  if is_world(name) or os.path.isdir(os.path.join(args.data_path, name)):
    return True
  print('left out %s: not in %s' % (name, args.data_path), file=sys.stderr)
  return False


def count_models(models, num_images):
  """The number of models, and their images unless one has all."""
  if [model['images'] for model in models] == [num_images]:
    return '1'
  return '%d of %s images' % (len(models), ', '.join(
      str(model['images']) for model in models))


def errors_of(models):
  return ', '.join(format_error(model['rmse_m']) for model in models) + ' m'


def drives_row(record):
  cells = ([PHOTOS, PHOTOS_LABEL] if record['set'] == PHOTOS else
           ['{:,} images'.format(record['set']), CUTS[record['cut']].label])
  if 'error' in record:
    return cells + [record['error'], '-', '-']
  return cells + [count_models(record['final'], record['num_images']),
                  errors_of(record['coarse']), errors_of(record['final'])]


def drives_table(records):
  lines = ['| drive | cut into | models | coarse error | error |',
           '|---|---|---|---|---|']
  lines += ['| %s |' % ' | '.join(drives_row(record)) for record in records]
  done = [record for record in records if 'error' not in record]
  turned = [angle for record in done if record['cut'] == 'turned'
            for angle in record['turned_deg']]
  if turned:
    lines += ['', '`adasfm_global` finds %d wrong rotations, of %.2f to %.2f '
              'deg.' % (len(turned), min(turned), max(turned))]
  for record in done:
    if record['set'] == PHOTOS:
      lines += ['', 'Of %s %d of %d photos are in the model, with %d verified '
                'pairs between the two drives; its scale is %.4f.' % (
                    PHOTOS, record['final'][0]['images'], record['num_images'],
                    record['pairs_between'], record['scale'])]
  return '\n'.join(lines)


def extension_table(records):
  lines = ['| drive | images before | its error | all from scratch | '
           'extended |', '|---|---:|---:|---:|---:|']
  for record in records:
    cells = [record['set'], str(EXTENDED[record['set']])]
    if 'error' in record:
      cells += [record['error'], '-', '-']
    else:
      cells += ['%s m' % format_error(record[part]['rmse_m'])
                for part in ('before', 'scratch', 'extended')]
    lines.append('| %s |' % ' | '.join(cells))
  return '\n'.join(lines)


# Each table of the page: its rows, and its text from their records.
TABLES = {'drives': (list_drives, drives_table),
          'extension': (list_extended, extension_table)}


def parse_arguments():
  parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
  add_arguments(parser, __file__, 'sessions', 'adasfm-sessions')
  root = parser.get_default('root')
  # The seed is that of clean-500.
  parser.set_defaults(timeout=None, seed=1, table_path=os.path.join(
      root, 'docs', 'guide', 'sessions.md'))
  parser.add_argument('--data_path', default='../shared/data',
                      help='folder of the real photos and of the world-* sets')
  add_features_argument(parser)
  args = parser.parse_args()
  set_features_path(args)
  return args


def main():
  args = parse_arguments()
  rows = {name: list_rows(args) for name, (list_rows, _) in TABLES.items()}
  entries = {entry['key']: entry for entry in run_rows(
      {key: row for part in rows.values() for key, row in part.items()}, args)}
  for name, (_, report) in TABLES.items():
    mine = [entries[key] for key in rows[name]]
    write_table(args.table_path, name, '\n\n'.join(
        (report([r for e in mine for r in e['records']]), describe(mine))))


if __name__ == '__main__':
  sys.exit(main())
