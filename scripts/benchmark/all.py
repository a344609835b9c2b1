#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Makes the comparison tables of README.md and docs, all from one version.

scripts/benchmark/all.sh calls this script on a build of these sources. Each
table is a step. Its rows are kept in OUTPUT/STEP/rows.jsonl with the version of
the sources and the machine; rows of the same version and machine are not run
again, and a table never mixes rows of two versions or machines. Figures go to
benchmark/results, tables into the pages between markers.
"""

import argparse
import os
import subprocess
import sys
import time

ROOT = os.path.abspath(os.path.join(os.path.dirname(__file__), '..', '..'))

from benchmarking import tables  # noqa: E402
from benchmarking.figures import write_figures  # noqa: E402
from benchmarking.host_options import version_of  # noqa: E402
from benchmarking.ledger import (Ledger, MixedVersions, describe,  # noqa: E402
                                 make_stamp)
from benchmarking.methods import ABLATIONS  # noqa: E402
from benchmarking.pages import write_table  # noqa: E402
from benchmarking.peer_tables import (cleaner_table, detail_table,  # noqa: E402
                                      losses, summary_table)
from benchmarking.sets import QUICK, is_world  # noqa: E402

# README's rows, and what each shows.
README_SETS = {
    'kitti01-51': 'a bend with low overlap',
    'kitti06-51': 'straight ahead',
    'kitti07-160': 'bends, a stop, oncoming cars',
    'world-alias-300': 'places that look alike, a blackout',
    'world-clean-300': 'a gyroscope that is off by 0.05 deg/s',
    'world-hard-400': '11 % false pairs, 40 % outliers, four blackouts',
    'world-kitti10-592': "KITTI 10's motion and IMU, look-alikes",
    'blackout-250': 'three intervals of 16 images without texture',
}
CLEANER_SETS = ['world-alias-300', 'world-hard-400', 'world-clean-300',
                'kitti06-51', 'kitti07-160']
# Perceptual aliasing, a clean world, few good matches, and two real motions.
ABLATION_SETS = ['alias-300', 'clean-500', 'noisy-500', 'outliers-500',
                 'world-hard-400', 'kitti07-160', 'world-kitti10-592']
# Worlds with much perceptual aliasing or many false pairs, for forty seeds.
ALIKE_DIALS = ['parallel streets', 'parallel streets, half of the pairs false',
               'parallel streets, three blackouts',
               'parallel streets alike around corners, a blackout between',
               'half of the pairs spurious', '62 % of the pairs false']
# The commands of COLMAP 4, and the names of the benchmark's methods for them.
PEER_COMMANDS = {'mapper': 'colmap4_mapper',
                 'global_mapper': 'colmap4_global_mapper'}


def find_colmap4(args):
  """The program, or '' after one line that says why there is none."""
  if args.colmap4:
    return os.path.abspath(args.colmap4)
  fetch = os.path.join(ROOT, 'tests', 'scripts', 'fetch_colmap.sh')
  cache = os.environ.get('ADASFM_CACHE') or os.path.join(
      os.environ.get('XDG_CACHE_HOME') or os.path.expanduser('~/.cache'),
      'adasfm')
  done = subprocess.run([fetch, os.path.join(cache, 'other'), 'sid'],
                        capture_output=True, text=True, check=False)
  if done.returncode != 0:
    said = done.stderr.strip().splitlines()
    print('left out COLMAP 4: %s' % (said[-1] if said else 'not to be had'))
    return ''
  return done.stdout.strip()


def present(names, args):
  """The sets that can be made here; prints a line for each other set."""
  there = []
  for name in names:
    if is_world(name) or os.path.isdir(os.path.join(args.data_path, name)):
      there.append(name)
    else:
      print('left out %s: not in %s' % (name, args.data_path))
  return there


def call(script, arguments):
  subprocess.run([sys.executable, os.path.join(ROOT, 'scripts', 'benchmark',
                                               script), *arguments],
                 check=True, stdout=subprocess.DEVNULL)


class Benchmark:
  """Steps that run COLMAP's mappers and ours side by side."""

  def __init__(self, args):
    self.args = args
    self.folder = os.path.join(args.output_path, 'benchmark')
    self.colmap4 = find_colmap4(args)
    self.version4 = version_of(self.colmap4) if self.colmap4 else ''

  def headings(self):
    """{method: heading} of README's table."""
    headings = {'mapper': 'COLMAP %s mapper' % version_of(self.args.colmap)}
    if self.colmap4:
      headings.update({method: 'COLMAP %s %s' % (self.version4, command)
                       for command, method in PEER_COMMANDS.items()})
    return dict(headings, adasfm='AdaSfM')

  def peers(self, suffix=''):
    arguments = []
    for command, method in PEER_COMMANDS.items() if self.colmap4 else ():
      arguments += ['--peer', '%s=%s:%s%s' % (
          method + suffix.replace(':', '_'), self.colmap4, command, suffix)]
    return arguments

  def run(self, names, methods, peers=()):
    if self.args.run and names:
      call('benchmark.py', [
          *names, '--methods', ','.join(methods), *peers, '--output_path',
          self.folder, '--data_path', self.args.data_path,
          '--features_path', os.path.join(self.args.output_path, 'features'),
          '--colmap', self.args.colmap])

  def entries(self, names, methods):
    """The rows of a table, of one version."""
    ledger = Ledger(os.path.join(self.folder, 'rows.jsonl'), make_stamp(ROOT))
    return ledger.entries(['%s %s 0' % (name, method) for name in names
                           for method in methods])

  def records(self, entries):
    return [record for entry in entries for record in entry['records']]

  def write(self, page, table, text):
    write_table(os.path.join(self.args.docs_root, page), table, text)

  def readme(self):
    """README's table, and the same with times, memory and every model."""
    sets = {name: README_SETS[name] for name in present(README_SETS, self.args)}
    headings = self.headings()
    self.run(list(sets), ['mapper', 'adasfm'], self.peers())
    entries = self.entries(sets, headings)
    records = self.records(entries)
    write_figures(os.path.join(self.args.figures_path, 'benchmark.json'),
                  entries)
    lost = losses(records, sets, headings)
    self.write('README.md', 'summary', '\n\n'.join(
        (summary_table(records, sets, headings),
         '%s %s' % (lost, describe(entries)))))
    self.write('docs/results/benchmark.md', 'peers', '\n\n'.join(
        (detail_table(records, sets, headings),
         '%s %s' % (lost, describe(entries)))))

  def cleaner(self):
    """COLMAP 4's commands on raw and on cleaned databases."""
    if not self.colmap4:
      return
    names = present(CLEANER_SETS, self.args)
    cleaned = {command: (method, method + '_cleaned')
               for command, method in PEER_COMMANDS.items()}
    self.run(names, ['adasfm'], self.peers() + self.peers(':cleaned'))
    entries = self.entries(names, [m for pair in cleaned.values()
                                   for m in pair])
    write_figures(os.path.join(self.args.figures_path, 'cleaner.json'), entries)
    self.write('docs/guide/cleaner.md', 'cleaner', '\n\n'.join(
        ('COLMAP %s. %s' % (self.version4, describe(entries)),
         cleaner_table(self.records(entries), names, cleaned))))

  def ablations(self):
    methods = ['adasfm'] + list(ABLATIONS)
    names = present(ABLATION_SETS, self.args)
    self.run(names, methods)
    entries = self.entries(names, methods)
    write_figures(os.path.join(self.args.figures_path, 'ablations.json'),
                  entries)
    self.write('docs/results/benchmark.md', 'ablations', '\n\n'.join(
        (tables.ablation_table(self.records(entries)), describe(entries))))

  def kinds(self):
    """All methods on worlds of each kind, without recordings."""
    methods = ['mapper', 'hierarchical_mapper', 'adasfm', 'adasfm_no_sensors',
               'limit']
    self.run(QUICK, methods)
    entries = self.entries(QUICK, methods)
    write_figures(os.path.join(self.args.figures_path, 'kinds.json'), entries)
    self.write('docs/results/benchmark.md', 'kinds', '\n\n'.join(
        (tables.long_table(self.records(entries)), describe(entries))))


def run_script(args, step, script, *options, page=''):
  """page: with the tables of the step, if it is not docs/results/STEP.md."""
  call(script, [*options, '--output_path',
                os.path.join(args.output_path, step), '--colmap', args.colmap,
                '--run', str(args.run), '--table_path',
                os.path.join(args.docs_root, page or
                             'docs/results/%s.md' % step),
                '--figures_path',
                os.path.join(args.figures_path, step + '.json')])


def photos(args):
  run_script(args, 'photos', 'photo_tables.py', '--data_path', args.data_path,
             '--colmap4', find_colmap4(args))


def handheld(args):
  run_script(args, 'handheld', 'handheld_tables.py', '--recordings_path',
             args.recordings_path, '--colmap4', find_colmap4(args))


# The steps, in the order in which they are run.
STEPS = {
    'readme': lambda args: Benchmark(args).readme(),
    'cleaner': lambda args: Benchmark(args).cleaner(),
    'ablations': lambda args: Benchmark(args).ablations(),
    'two_view': lambda args: run_script(args, 'two_view', 'two_view_tables.py',
                                        '--data_path', args.data_path,
                                        '--features_path', os.path.join(
                                            args.output_path, 'features')),
    'pairs': lambda args: run_script(args, 'pairs', 'pair_tables.py',
                                     '--data_path', args.data_path),
    'candidates': lambda args: run_script(args, 'candidates',
                                          'candidate_tables.py'),
    'refinements': lambda args: run_script(args, 'refinements',
                                           'refinement_tables.py'),
    # After readme and two_view, since it reads their figures.
    'paper': lambda args: run_script(
        args, 'paper', 'paper_figures.py', '--data_path', args.data_path,
        '--features_path', os.path.join(args.output_path, 'features'),
        '--benchmark_path', os.path.join(args.figures_path, 'benchmark.json'),
        '--two_view_path', os.path.join(args.figures_path, 'two_view.json'),
        '--images_path', os.path.join(args.docs_root, 'docs', 'images')),
    'stress_worlds': lambda args: run_script(args, 'stress_worlds',
                                             'stress_worlds.py'),
    'alike_seeds': lambda args: run_script(
        args, 'alike_seeds', 'stress_worlds.py', *ALIKE_DIALS, '--seeds',
        '1-40', '--summary', '1'),
    'photos': photos,
    'handheld': handheld,
    'global_results': lambda args: run_script(
        args, 'global_results', 'global_tables.py', '--num_seeds', '5'),
    'global_seeds': lambda args: run_script(
        args, 'global_seeds', 'global_tables.py', '--sizes', '150,300,500',
        '--num_seeds', '10', '--num_blackouts', '2', '--variants', 'as it is',
        '--mapper_variants', 'as it is', '--compare_pairs', '0'),
    'global_worlds': lambda args: run_script(args, 'global_worlds',
                                             'global_worlds.py'),
    'global_without_sensors': lambda args: run_script(
        args, 'global_without_sensors', 'global_without_sensors.py'),
    'estimator_seeds': lambda args: run_script(args, 'estimator_seeds',
                                               'estimator_seeds.py'),
    'sensor_errors': lambda args: run_script(
        args, 'sensor_errors', 'sensor_errors.py', '--data_path',
        args.data_path),
    'sessions': lambda args: run_script(
        args, 'sessions', 'session_tables.py', '--data_path', args.data_path,
        '--features_path', os.path.join(args.output_path, 'features'),
        page='docs/guide/sessions.md'),
    'kinds': lambda args: Benchmark(args).kinds(),
    'faults': lambda args: run_script(
        args, 'faults', 'fault_tables.py', '--data_path', args.data_path,
        '--features_path', os.path.join(args.output_path, 'features')),
    'growth': lambda args: run_script(
        args, 'growth', 'growth.py', '--limits', '4000,10000', '--plot_path',
        os.path.join(args.docs_root, 'docs', 'images', 'growth.svg')),
    # Last, as it fails when a verdict is wrong.
    'verdicts': lambda args: run_script(args, 'verdicts', 'verdict_table.py'),
}
QUICK_STEPS = ['readme']


def parse_arguments(words=None):
  parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
  parser.add_argument('steps', nargs='*', metavar='step',
                      help='any of: %s; all when none is named' %
                      ', '.join(STEPS))
  parser.add_argument('--quick', action='store_true',
                      help="only README's table: 20 to 45 minutes on two cores")
  parser.add_argument('--draw', dest='run', action='store_const', const=0,
                      default=1, help='run nothing: only write the tables')
  parser.add_argument('--output_path',
                      default=os.path.join(ROOT, 'adasfm-benchmark', 'all'),
                      help='folder of rows, databases and models')
  parser.add_argument('--data_path',
                      default=os.path.join(ROOT, '..', 'shared', 'data'),
                      help='folder of the recordings')
  parser.add_argument('--recordings_path',
                      default=os.path.join(ROOT, '..', 'recordings'),
                      help='folder with clones of edge-slam-rgb-imu and '
                      'DM-VIO-dataset')
  build = os.environ.get('ADASFM_BUILD_DIR') or os.path.join(ROOT, 'build')
  parser.add_argument('--colmap', default=os.path.join(build, 'bin', 'colmap'),
                      help='our launcher, built from these sources')
  parser.add_argument('--colmap4', default='',
                      help="COLMAP 4's program; default: Debian sid's, fetched")
  parser.add_argument('--docs_root', default=ROOT,
                      help='folder of README.md and docs/ to write into')
  parser.add_argument('--figures_path',
                      default=os.path.join(ROOT, 'benchmark', 'results'),
                      help='folder of the figures behind the tables')
  args = parser.parse_args(words)
  for step in args.steps:
    if step not in STEPS:
      parser.error('no such step: %s; there are: %s' % (step, ', '.join(STEPS)))
  if args.quick and args.steps:
    parser.error('--quick names its steps itself')
  args.steps = QUICK_STEPS if args.quick else args.steps or list(STEPS)
  return args


def main():
  args = parse_arguments()
  os.makedirs(args.output_path, exist_ok=True)
  os.makedirs(args.figures_path, exist_ok=True)
  for step in args.steps:
    print('== %s' % step, flush=True)
    started = time.monotonic()
    try:
      STEPS[step](args)
    except MixedVersions as error:
      sys.exit('%s: not written: %s' % (step, error))
    except subprocess.CalledProcessError as error:
      sys.exit('%s: %s ended with %d' % (step, error.cmd[1], error.returncode))
    print('%s: %.1f min' % (step, (time.monotonic() - started) / 60),
          flush=True)
  print('done; git diff shows the tables')


if __name__ == '__main__':
  main()
