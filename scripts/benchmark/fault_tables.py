#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Effects of faults: campaigns of kills and damaged files, spoilt IMU logs.

Runs the campaigns of scripts/checks/faults.py, a row each, and the chain with
IMU logs that are spoilt or have a lower rate, on drives of `adasfm_synthesizer`
and a real drive. Writes docs/results/faults.md. Needs Python's standard library
and a C compiler.
"""

import argparse
import functools
import os
import random
import re
import shutil
import subprocess
import sys

from benchmarking.figures import add_arguments, run_table
from benchmarking.ledger import hash_sources
from benchmarking.sets import (add_features_argument, copy_features,
                               set_features_path)
from benchmarking.spoil import edit_rows, keep_every
from verdict_table import Chain, set_value, zero_samples

FAULTS = os.path.join(os.path.dirname(os.path.abspath(__file__)), '..',
                      'checks', 'faults.py')
# Campaigns of faults.py, with the number of trials.
CAMPAIGNS = {
    'kills': ('kill -9 at a random time, then the same command', 200),
    'injections': ('a call for writing, fsync, rename, mmap, memory or a thread '
                   'fails, or all from one on; then the same command', 500),
    'limits': ('no file may grow beyond 30 bytes to 3 MB, then it may again',
               100),
    'twice': ('the same command twice at once', 50),
    'files': ('a damaged database, model, checkpoint, log or calibration',
              10000),
}
SEED = 41


def add_spikes(folder):
  generator = random.Random(3)

  def change(rows):
    for i in generator.sample(range(len(rows)), 100):
      rows[i][generator.randint(1, 3)] = '%.9g' % generator.uniform(-20, 20)
    return rows
  edit_rows(folder, 'imu.csv', change)


def freeze(folder):
  edit_rows(folder, 'imu.csv', lambda rows: [
      row[:1] + rows[2000][1:] if 2000 <= i < 2200 else row
      for i, row in enumerate(rows)])


def drop_samples(folder):
  generator = random.Random(3)
  edit_rows(folder, 'imu.csv', lambda rows: [
      row for row in rows if generator.random() >= 0.05])


SPOILT = {
    'nothing': lambda folder: None,
    'one gyroscope sample of 17 rad/s': lambda f: set_value(f, 2000, 3, 17.0),
    '100 gyroscope samples of up to 20 rad/s': add_spikes,
    'one reading for 1 s': freeze,
    'zeros for 0.5 s': lambda f: zero_samples(f, 2000, 100),
    '5 % of the samples missing': drop_samples,
}
SPOILT_SEEDS = (7, 8)
# Every n-th sample is kept of an IMU of 200 Hz (96 Hz in kitti01-51).
STEPS = (1, 3, 4, 5, 8, 20, 40)
RATE_DRIVES = {
    'town': ['--num_images', '100'],
    'turn by 360 deg': ['--num_images', '100', '--spins', '1',
                        '--spin_duration', '4'],
    'two blackouts, two slips': ['--num_images', '100', '--num_blackouts', '2',
                                 '--blackout_images', '24', '--wheel_slips',
                                 '2'],
    'slow': ['--num_images', '60', '--spacing', '0.5'],
}
REAL_DRIVE = 'kitti01-51'


def synthesize(folder, options, args):
  shutil.rmtree(folder, ignore_errors=True)
  subprocess.run([args.colmap, 'adasfm_synthesizer', '--output_path', folder,
                  *options], check=True, stdout=subprocess.DEVNULL)


def copy_real(folder, args):
  shutil.rmtree(folder, ignore_errors=True)
  os.makedirs(folder)
  source = os.path.join(args.data_path, REAL_DRIVE)
  for name in ('times.csv', 'imu.csv', 'wheel.csv', 'sensors.yaml', 'gt.txt'):
    shutil.copy(os.path.join(source, name), folder)
  copy_features(REAL_DRIVE, source, os.path.join(folder, 'database.db'), args,
                os.path.join(folder, 'features.log'))


def count_named(output):
  """Samples of imu.csv that the importer's warnings count."""
  warnings = [line for line in output.splitlines()
              if line.startswith('WARNING') and 'imu.csv' in line]
  return sum(int(count) for line in warnings for count in re.findall(
      r'(\d+) (?:samples? (?:is|are|repeat)|of \d+ in all)', line))


def map_drive(folder, args):
  """Runs the chain in the folder of a drive; returns the model's errors."""
  chain = Chain(args.colmap, folder)
  imported = chain.importer({'sensors': ('imu.csv', 'wheel.csv')})
  record = {'named': count_named(imported.stdout)}
  for done in (imported,
               chain.call('global', '--database_path',
                          chain.path('database.db'), '--output_path',
                          chain.path('g'))):
    if done.returncode != 0:
      said = (done.stderr.strip().splitlines() or [''])[-1]
      return dict(record, error=said.replace(folder + '/', ''))
  chain.mapper('g/0', 'm', {})
  return dict(record, errors=chain.errors('m')._asdict())


def run_campaign(name, folder, args):
  """Counts of each outcome; a stopped campaign continues."""
  journal = os.path.join(folder, 'journal-%s' % hash_sources(args.root))
  arguments = [sys.executable, FAULTS, args.colmap, '--seed', str(SEED),
               '--journal', journal]
  for campaign in CAMPAIGNS:
    arguments += ['--' + campaign,
                  str(getattr(args, name) if campaign == name else 0)]
  done = subprocess.run(arguments, capture_output=True, text=True, check=False)
  print(done.stdout, file=sys.stderr)
  counts = {}
  with open(journal) as file:
    for line in file:
      _, campaign, number, outcome = line.rstrip('\n').split('\t')
      if campaign == name and int(number) < getattr(args, name):
        counts[outcome] = counts.get(outcome, 0) + 1
  return {'campaign': name, 'counts': counts}


def run_spoilt(name, seed, folder, args):
  drive = os.path.join(folder, 'drive')
  synthesize(drive, ['--num_images', '200', '--seed', str(seed)], args)
  SPOILT[name](drive)
  return dict(map_drive(drive, args), spoilt=name, seed=seed)


def run_rate(name, step, folder, args):
  drive = os.path.join(folder, 'drive')
  if name == REAL_DRIVE:
    copy_real(drive, args)
  else:
    synthesize(drive, RATE_DRIVES[name], args)
  if step > 1:
    keep_every(drive, 'imu.csv', step)
  return dict(map_drive(drive, args), drive=name, step=step)


def campaign_table(records):
  lines = ['| campaign (seed %d) | trials | wrong |' % SEED, '|---|---|---|']
  for record in records:
    counts = dict(record['counts'])
    wrong = counts.pop('WRONG', 0)
    lines.append('| %s | %s: %s | %d |' % (
        CAMPAIGNS[record['campaign']][0],
        '{:,}'.format(sum(counts.values()) + wrong),
        ', '.join('{:,} {}'.format(count, outcome)
                  for outcome, count in sorted(counts.items())), wrong))
  return lines


def spoilt_table(records):
  lines = ['| spoilt | %s | samples named |' % ' | '.join(
      'seed %d' % seed for seed in SPOILT_SEEDS),
           '|---' * (len(SPOILT_SEEDS) + 2) + '|']
  runs = {(r['spoilt'], r['seed']): r for r in records}
  for name in SPOILT:
    cells = []
    for seed in SPOILT_SEEDS:
      run, clean = runs[name, seed], runs['nothing', seed]
      if 'error' in run:
        cells.append('refused: ' + run['error'])
        continue
      error_m = run['errors']['shape_m']
      cells.append('%.3f m' % error_m if run is clean else '%.3f m, %.2f' % (
          error_m, error_m / clean['errors']['shape_m']))
    cells.append(', '.join(str(runs[name, seed]['named'])
                           for seed in SPOILT_SEEDS))
    lines.append('| %s | %s |' % (name, ' | '.join(cells)))
  return lines


def rate_cell(run):
  if run is None:
    return '-'
  if 'error' in run:
    return 'refused'
  errors = run['errors']
  if not errors['sigma']:
    return '%.3f m, no metres' % errors['shape_m']
  return '%.3f m, %.1f' % (errors['shape_m'],
                           abs(errors['scale'] - 1) / errors['sigma'])


def rate_table(records):
  runs = {(r['drive'], r['step']): r for r in records}
  drives = list(dict.fromkeys(r['drive'] for r in records))
  lines = ['| rate | %s |' % ' | '.join(drives), '|---' * (len(drives) + 1) +
           '|']
  for step in STEPS:
    lines.append('| %.0f Hz | %s |' % (200 / step, ' | '.join(
        rate_cell(runs.get((drive, step))) for drive in drives)))
  return lines


def report(records, args):
  del args
  return '\n'.join(
      campaign_table([r for r in records if 'campaign' in r]) +
      ['', 'Spoilt IMU logs on two drives of 200 images: error after a '
       'similarity, and over that with the clean log.', ''] +
      spoilt_table([r for r in records if 'spoilt' in r]) +
      ['', 'Every n-th sample of the IMU (of 96 Hz on %s): error after a '
       'similarity, and that of the metres in sigmas that the verdict states '
       '(`metric_sigma`).' % REAL_DRIVE, ''] +
      rate_table([r for r in records if 'drive' in r])) + '\n'


def parse_arguments():
  parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
  add_arguments(parser, __file__, 'faults', 'adasfm-faults')
  parser.add_argument('--data_path', default='../shared/data',
                      help='folder of the real drive')
  add_features_argument(parser)
  for name, (_, trials) in CAMPAIGNS.items():
    parser.add_argument('--' + name, type=int, default=trials, metavar='N',
                        help='trials, %d unless given' % trials)
  args = parser.parse_args()
  set_features_path(args)
  args.colmap = os.path.abspath(args.colmap)
  return args


def main():
  args = parse_arguments()
  folder = os.path.abspath(args.output_path)
  os.makedirs(folder, exist_ok=True)
  rows = {}
  for name in SPOILT:
    for seed in SPOILT_SEEDS:
      rows['%s %d' % (name, seed)] = (
          None, functools.partial(run_spoilt, name, seed, folder, args))
  drives = list(RATE_DRIVES)
  if os.path.isdir(os.path.join(args.data_path, REAL_DRIVE)):
    drives.append(REAL_DRIVE)
  for name in drives:
    for step in STEPS:
      rows['%s %d' % (name, step)] = (
          RATE_DRIVES.get(name), functools.partial(run_rate, name, step, folder,
                                                   args))
  for name in CAMPAIGNS:
    rows[name] = ([SEED, getattr(args, name)],
                  functools.partial(run_campaign, name, folder, args))
  run_table(rows, report, args)


if __name__ == '__main__':
  sys.exit(main())
