# SPDX-License-Identifier: BSD-3-Clause
"""Tests of the bookkeeping of scripts/benchmark/all.py: rows are done once for
a version, and versions are not mixed."""

import argparse
import json
import os
import subprocess
import sys
import unittest

SCRIPTS = os.path.join(os.path.dirname(os.path.abspath(__file__)), '..', '..',
                       'scripts', 'benchmark')
sys.path.insert(0, SCRIPTS)

import all as all_tables  # noqa: E402
from benchmarking import handheld, process  # noqa: E402
from benchmarking.figures import run_table  # noqa: E402
from benchmarking.ledger import (Ledger, MixedVersions,  # noqa: E402
                                 hash_sources, make_stamp)
from benchmarking.pages import write_table  # noqa: E402
from temporary_folder import FolderTest  # noqa: E402


def write(path, text):
  os.makedirs(os.path.dirname(path), exist_ok=True)
  with open(path, 'w') as file:
    file.write(text)


def read(path):
  with open(path) as file:
    return file.read()


class LedgerTest(FolderTest):

  def stamp(self, sources='a', machine='m'):
    return {'sources': sources, 'commit': 'c', 'machine': machine}

  def ledger(self, **stamp):
    return Ledger(self.path('rows.jsonl'), self.stamp(**stamp))

  def test_a_row_is_run_once_for_version_machine_and_spec(self):
    runs = []

    def row():
      runs.append(1)
      return [{'value': len(runs)}]

    for stamp, spec, expected in (
        ({}, 's', 1), ({}, 's', 1), ({}, 't', 2), ({'sources': 'b'}, 't', 3),
        ({'sources': 'b', 'machine': 'n'}, 't', 4),
        ({'sources': 'b', 'machine': 'n'}, 't', 4)):
      records = self.ledger(**stamp).run('key', row, spec)
      self.assertEqual(records, [{'value': expected}])

  def test_a_table_of_two_versions_or_machines_is_refused(self):
    for other in ({'sources': 'b'}, {'machine': 'n'}):
      path = self.path('rows.jsonl')
      if os.path.exists(path):
        os.remove(path)
      self.ledger().run('one', lambda: [{}])
      ledger = self.ledger(**other)
      ledger.run('two', lambda: [{}])
      with self.assertRaisesRegex(MixedVersions, 'different versions'):
        ledger.entries(['one', 'two'])
      ledger.run('one', lambda: [{}])
      self.assertEqual(len(ledger.entries(['one', 'two'])), 2)

  def test_a_missing_row_is_refused(self):
    with self.assertRaisesRegex(MixedVersions, 'not run yet: one'):
      self.ledger().entries(['one'])

  def test_a_line_cut_short_is_run_again(self):
    self.ledger().run('one', lambda: [{'value': 1}])
    self.ledger().run('two', lambda: [{'value': 2}])
    path = self.path('rows.jsonl')
    os.truncate(path, os.path.getsize(path) - 20)
    ledger = self.ledger()
    self.assertIsNone(ledger.find('two'))
    ledger.run('two', lambda: [{'value': 3}])
    ledger = self.ledger()
    self.assertEqual(ledger.find('one'), [{'value': 1}])
    self.assertEqual(ledger.find('two'), [{'value': 3}])


class VersionTest(FolderTest):

  def test_the_version_is_that_of_the_product_and_not_of_docs(self):
    write(self.path('core', 'a.cc'), 'int a;')
    write(self.path('docs', 'a.md'), 'text')
    version = hash_sources(self.folder)
    write(self.path('docs', 'a.md'), 'other text')
    write(self.path('scripts', 'b.py'), '')
    self.assertEqual(hash_sources(self.folder), version)
    write(self.path('core', 'a.cc'), 'int b;')
    changed = hash_sources(self.folder)
    self.assertNotEqual(changed, version)
    os.rename(self.path('core', 'a.cc'), self.path('core', 'b.cc'))
    self.assertNotEqual(hash_sources(self.folder), changed)

  def test_a_row_during_which_the_sources_change_does_not_count(self):
    source = self.path('core', 'a.cc')
    write(source, 'int a;')
    ledger = Ledger(self.path('rows.jsonl'), make_stamp(self.folder),
                    self.folder)
    with self.assertRaisesRegex(MixedVersions, 'changed while one ran'):
      ledger.run('one', lambda: write(source, 'int b;') or [{}])
    self.assertFalse(os.path.exists(self.path('rows.jsonl')))

  def test_tables_are_made_of_one_version(self):
    write(self.path('core', 'a.cc'), 'int a;')
    page = self.path('page.md')
    args = argparse.Namespace(root=self.folder, run=1,
                              output_path=self.path('out'), table_path=page,
                              figures_path=self.path('figures.json'))
    runs = []

    def rows(*names):
      return {name: (None, lambda name=name: runs.append(name) or
                     {'name': name}) for name in names}

    def make(names, **options):
      run_table(rows(*names), lambda records, _: ' '.join(
          r['name'] for r in records),
                argparse.Namespace(**dict(vars(args), **options)))

    make('ab')
    make('abc')
    self.assertEqual(runs, ['a', 'b', 'c'])
    self.assertIn('a b c', read(page))
    figures = json.loads(read(args.figures_path))
    self.assertEqual(figures['stamp']['sources'], hash_sources(self.folder))
    # In another version, old rows do not count, and their worlds are removed.
    write(self.path('core', 'a.cc'), 'int b;')
    make('d')
    self.assertEqual(runs, ['a', 'b', 'c', 'd'])
    self.assertEqual(len([name for name in os.listdir(args.output_path)
                          if name.startswith('runs-')]), 1)
    before = read(page)
    with self.assertRaises(MixedVersions):
      make('cd', run=0)
    self.assertEqual(read(page), before)
    make('cd')
    self.assertEqual(runs, ['a', 'b', 'c', 'd', 'c'])


class PagesTest(FolderTest):

  def test_only_what_stands_between_the_markers_changes(self):
    page = self.path('page.md')
    write_table(page, 'one', 'first')
    write(page, 'before\n\n' + read(page) + '\nafter\n')
    write_table(page, 'one', 'second')
    text = read(page)
    self.assertTrue(text.startswith('before\n\n<!-- table one'), text)
    self.assertTrue(text.endswith('<!-- end of table -->\n\nafter\n'), text)
    self.assertIn('\nsecond\n', text)
    self.assertNotIn('first', text)
    with self.assertRaisesRegex(ValueError, 'table two'):
      write_table(page, 'two', 'text')

  def test_the_pages_have_the_markers_of_all_tables(self):
    root = os.path.join(SCRIPTS, '..', '..')
    for page, tables in (
        ('README.md', ['summary']), ('docs/guide/cleaner.md', ['cleaner']),
        ('docs/guide/sessions.md', ['drives', 'extension']),
        ('docs/results/benchmark.md', ['peers', 'ablations', 'kinds']),
        *(('docs/results/%s.md' % step, [step]) for step in
          all_tables.STEPS if step not in ('readme', 'cleaner', 'ablations',
                                           'kinds', 'sessions'))):
      text = read(os.path.join(root, page))
      for table in tables:
        write(self.path('copy.md'), text)
        write_table(self.path('copy.md'), table, 'a table')


def record(name, method, models, num_images=100, error=''):
  if error:
    return {'set': name, 'method': method, 'seconds': 2.0, 'cpu_seconds': 3.0,
            'peak_mib': 50, 'step_cpu_seconds': {'failed': 3.0},
            'evaluation': None, 'error': error}
  return {'set': name, 'method': method, 'seconds': 10.0, 'cpu_seconds': 15.0,
          'peak_mib': 100, 'step_cpu_seconds': {'clean': 5.0, 'map': 10.0},
          'evaluation': {'num_true_images': num_images, 'sim3': {'scale': 1.0}},
          'models': [{'images': n, 'rmse_m': e} for n, e in models]}


class HandheldTest(FolderTest):
  """A phone's log: objects on many lines, two sensors with their own times."""

  def setUp(self):
    super().setUp()
    self.source = self.path(handheld.RECORDINGS['phone 1'])
    frames = [{'fileName': 'frame_%d.jpg' % k, 'timestamp': 1000 * k}
              for k in range(7)]
    samples = [{'sensorType': 1, 'timestamp': 500 + 1000 * k,
                'values': [float(k), 2.0 * k, 9.8]} for k in range(7)]
    # A repeated time, six values of an uncalibrated gyroscope, a magnetometer.
    samples += [{'sensorType': 4, 'timestamp': t,
                 'values': [0.1, 0.2, 0.3, 0.0, 0.0, 0.0]}
                for t in (0, 500, 1750, 1750, 9000)]
    samples.append({'sensorType': 2, 'timestamp': 600, 'values': [1, 2, 3]})
    for name, objects in (('camera_frames', frames), ('imu_data', samples)):
      write(os.path.join(self.source, 'data', name + '.jsonl'),
            '\n'.join(json.dumps(o, indent=2) for o in objects) + '\n{"cut":')
    for k in (0, 6):
      write(os.path.join(self.source, 'images', 'frame_%d.jpg' % k), 'photo')

  def test_every_third_photo_that_is_there(self):
    folder = self.path('prepared')
    self.assertEqual(handheld.prepare('phone 1', self.folder, folder), 2)
    self.assertEqual(read(os.path.join(folder, 'times.csv')).splitlines()[1:],
                     ['0,frame_0.jpg', '6000,frame_6.jpg'])
    self.assertEqual(read(os.path.join(folder, 'images', 'frame_6.jpg')),
                     'photo')

  def test_accelerations_at_the_times_of_the_gyroscope(self):
    folder = self.path('prepared')
    handheld.prepare('phone 1', self.folder, folder)
    self.assertEqual(
        read(os.path.join(folder, 'imu.csv')).splitlines()[1:],
        ['500,0.1,0.2,0.3,0.0,0.0,9.8', '1750,0.1,0.2,0.3,1.25,2.5,9.8'])


class AllTest(FolderTest):

  RUNS = {'mapper': [(80, 52.5)], 'adasfm': [(100, 0.04)],
          'colmap4_mapper': [(100, 0.02)],
          'colmap4_global_mapper': [(60, 3.0), (30, 0.05)]}

  def setUp(self):
    super().setUp()
    for name, version in (('colmap', '3.8'), ('colmap4', '4.2.1')):
      write(self.path(name), '#!/bin/sh\necho COLMAP %s -- a program\n' % version)
      os.chmod(self.path(name), 0o755)
    os.makedirs(self.path('data', 'kitti01-51'))
    for page, tables in (('README.md', ['summary']),
                         ('docs/results/benchmark.md', ['peers'])):
      os.makedirs(os.path.dirname(self.path(page)), exist_ok=True)
      for table in tables:
        write_table(self.path(page), table, 'nothing')

  def fill(self, stamp):
    folder = self.path('out', 'benchmark')
    os.makedirs(folder, exist_ok=True)
    ledger = Ledger(os.path.join(folder, 'rows.jsonl'), stamp)
    for name in ('kitti01-51', 'blackout-250'):
      for method, models in self.RUNS.items():
        made = record(name, method, models)
        if (name, method) == ('blackout-250', 'mapper'):
          made = record(name, method, [], error='mapper ended with 1')
        ledger.run('%s %s 0' % (name, method), lambda: [made])
    return ledger

  def draw(self):
    return subprocess.run(
        [sys.executable, os.path.join(SCRIPTS, 'all.py'), '--quick', '--draw',
         '--output_path', self.path('out'), '--data_path', self.path('data'),
         '--colmap', self.path('colmap'), '--colmap4', self.path('colmap4'),
         '--docs_root', self.folder, '--figures_path', self.path('figures')],
        capture_output=True, text=True)

  def test_failures_name_no_folder_of_this_machine(self):
    with self.assertRaises(process.Failed) as caught:
      process.run([sys.executable, '-c', 'raise SystemExit(3)'],
                  self.path('run.log'))
    self.assertIn('ended with 3', str(caught.exception))
    self.assertNotIn(self.folder, str(caught.exception))

  def test_tables_of_what_is_done(self):
    self.fill(make_stamp(all_tables.ROOT))
    result = self.draw()
    self.assertEqual(result.returncode, 0, result.stderr)
    self.assertIn('left out kitti07-160: not in', result.stdout)
    readme = read(self.path('README.md'))
    self.assertIn('| COLMAP 3.8 mapper | COLMAP 4.2.1 mapper | COLMAP 4.2.1 '
                  'global_mapper | AdaSfM | our scale |', readme)
    self.assertIn('| kitti01-51 | a bend with low overlap | 52.5, 80 of 100 | '
                  '**0.020** | 3.000, 60 of 100 | 0.040 | 1.000 |', readme)
    self.assertIn('| no model | **0.020** |', readme)
    # The page also lists the sets where a peer is more accurate.
    self.assertIn('Better than ours: COLMAP 4.2.1 mapper on kitti01-51 '
                  '(0.020 m, ours 0.040)', readme)
    page = read(self.path('docs', 'results', 'benchmark.md'))
    self.assertIn('| 60 + 30 | 3.000, 0.050 | folded, in 2 models, 10 images '
                  'lost | 10.0 | 15.0 | 100 |', page)
    self.assertIn('| no model: mapper ended with 1 | 2.0 | 3.0 | 50 |', page)
    figures = json.loads(read(self.path('figures', 'benchmark.json')))
    self.assertEqual(len(figures['rows']), 8)

  def test_rows_of_two_versions_are_an_error(self):
    stamp = make_stamp(all_tables.ROOT)
    self.fill(dict(stamp, sources='older'))
    # Rows of an older version alone are not mixed.
    self.assertEqual(self.draw().returncode, 0)
    before = read(self.path('README.md'))
    ledger = Ledger(self.path('out', 'benchmark', 'rows.jsonl'), stamp)
    ledger.run('kitti01-51 mapper 0',
               lambda: [record('kitti01-51', 'mapper', [(100, 0.01)])])
    result = self.draw()
    self.assertEqual(result.returncode, 1, result.stdout)
    self.assertIn('different versions', result.stderr)
    self.assertEqual(read(self.path('README.md')), before)

  def test_unknown_steps_are_refused(self):
    for words in (['nonsense'], ['--quick', 'cleaner']):
      result = subprocess.run(
          [sys.executable, os.path.join(SCRIPTS, 'all.py'), *words],
          capture_output=True, text=True)
      self.assertEqual(result.returncode, 2, words)


if __name__ == '__main__':
  unittest.main()
