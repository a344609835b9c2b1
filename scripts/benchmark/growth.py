#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""How time and memory grow with the number of images, as a table and a plot.

Makes a clean world of `adasfm_synthesizer` for each size, runs the three
commands on its database, compares both models with the truth, and writes the
table of docs/results/growth.md and docs/images/growth.svg. With --limits the
table has the limit of those sizes, too: triangulation from the true poses and
one adjustment to convergence. A machine may be slower for minutes: small sizes
run before and after each large one. Needs matplotlib.
"""

import argparse
import functools
import json
import math
import os
import shutil
import statistics
import sys

import matplotlib
matplotlib.use('svg')
from matplotlib import pyplot  # noqa: E402

from benchmarking.figures import add_arguments, measure, run_table
from benchmarking.methods import run_adasfm, run_limit
from benchmarking.process import run

STEPS = {'import': 'import', 'global': '`adasfm_global`',
         'mapper': '`adasfm_mapper`'}
# Sizes up to this run several times.
MAX_SMALL_SIZE = 1000
# Exponents are computed from this size on to the largest size.
FIRST_OF_EXPONENTS = 1000


def count_pairs(folder):
  with open(os.path.join(folder, 'world.json')) as file:
    return json.load(file)['num_pairs']


def run_size(num_images, with_limit, args):
  folder = os.path.join(args.output_path, 'clean-%d' % num_images)
  log_path = os.path.join(args.output_path, 'clean-%d.log' % num_images)
  shutil.rmtree(folder, ignore_errors=True)
  os.makedirs(folder)
  run([args.colmap, 'adasfm_synthesizer', '--num_images', str(num_images),
       '--output_path', folder], log_path)
  record = {'num_images': num_images, 'num_pairs': count_pairs(folder)}
  args.timeout = None
  if with_limit:
    limit = os.path.join(folder, 'limit')
    os.makedirs(limit)
    shutil.copy(os.path.join(folder, 'database.db'), limit)
    output, steps = run_limit(limit, folder, args)
    record['limit'] = dict(measure(output, folder, args, log_path),
                           cpu_s=sum(u.cpu_seconds for u in steps.values()),
                           peak_mb=max(u.peak_mib for u in steps.values()) *
                           1.024)
  output, steps = run_adasfm(folder, folder, args, True, {})
  for name, usage in steps.items():
    record[name] = {'cpu_s': usage.cpu_seconds,
                    'peak_mb': usage.peak_mib * 1.024}
  record['coarse'] = measure(os.path.join(folder, 'global', '0'), folder, args,
                             log_path)
  record['model'] = measure(output, folder, args, log_path)
  if not args.keep:
    shutil.rmtree(folder)
  return record


def merge_runs(runs):
  """One record of the runs of a size: mean CPU times, largest memory."""
  merged = dict(runs[0], all_cpu_s=[cpu_seconds(run) for run in runs])
  for step in STEPS:
    merged[step] = {
        'cpu_s': statistics.mean(run[step]['cpu_s'] for run in runs),
        'peak_mb': max(run[step]['peak_mb'] for run in runs)}
  return merged


def cpu_seconds(record):
  return sum(record[step]['cpu_s'] for step in STEPS)


def peak_mb(record):
  return max(record[step]['peak_mb'] for step in STEPS)


def exponent(records, value):
  """Slope of log(value) over log(images) between the first and the last size
  from FIRST_OF_EXPONENTS on; None for less than two sizes."""
  counted = [r for r in records if r['num_images'] >= FIRST_OF_EXPONENTS]
  if len(counted) < 2:
    return None
  first, last = counted[0], counted[-1]
  return (math.log(value(last) / value(first)) /
          math.log(last['num_images'] / first['num_images']))


def draw(records, path):
  # The same records give the same file.
  matplotlib.rcParams['svg.hashsalt'] = 'adasfm'
  figure, panels = pyplot.subplots(1, 2, figsize=(9.0, 3.8))
  sizes = [r['num_images'] for r in records]
  for axes, label, key, total in (
      (panels[0], 'CPU time [s]', 'cpu_s', cpu_seconds),
      (panels[1], 'peak memory [MB]', 'peak_mb', None)):
    for step, name in STEPS.items():
      axes.loglog(sizes, [r[step][key] for r in records], marker='o',
                  label=name.strip('`'))
    if total:
      axes.loglog(sizes, [total(r) for r in records], marker='o', color='black',
                  label='together')
    limits = [r for r in records if 'limit' in r]
    if limits:
      axes.loglog([r['num_images'] for r in limits],
                  [r['limit'][key] for r in limits], marker='x',
                  linestyle='--', label='limit')
    axes.set_xlabel('images')
    axes.set_ylabel(label)
    axes.grid(True, which='both', alpha=0.25)
    axes.set_xticks(sizes, ['{:,}'.format(size) for size in sizes])
    axes.set_xticks([], minor=True)
    axes.yaxis.set_major_formatter('{x:g}')
    axes.legend(fontsize='small')
  figure.tight_layout()
  figure.savefig(path, metadata={'Date': None})
  pyplot.close(figure)


def usage_cell(usage):
  seconds = usage['cpu_s']
  return '%s s, %s MB' % ('%.1f' % seconds if seconds < 100 else
                          '{:,.0f}'.format(seconds),
                          '{:,.0f}'.format(usage['peak_mb']))


def error_cell(model):
  return '-' if not model else '%.3f m' % model['rmse_m']


def report(records, args):
  sizes = sorted({r['num_images'] for r in records})
  records = [merge_runs([r for r in records if r['num_images'] == size])
             for size in sizes]
  with_limit = any('limit' in r for r in records)
  heads = ['images', 'verified pairs', *STEPS.values(), 'together',
           'coarse error', 'error']
  if with_limit:
    heads += ['limit', 'its error']
  lines = ['| %s |' % ' | '.join(heads), '|---' * len(heads) + '|']
  for record in records:
    cells = ['{:,}'.format(record['num_images']),
             '{:,}'.format(record['num_pairs']),
             *(usage_cell(record[step]) for step in STEPS),
             usage_cell({'cpu_s': cpu_seconds(record),
                         'peak_mb': peak_mb(record)}),
             error_cell(record['coarse']), error_cell(record['model'])]
    if with_limit:
      limit = record.get('limit')
      cells += [usage_cell(limit), error_cell(limit)] if limit else ['', '']
    lines.append('| %s |' % ' | '.join(cells))
  time, memory = exponent(records, cpu_seconds), exponent(records, peak_mb)
  if time is not None:
    lines += ['', 'Exponents from {:,} to {:,} images: {:.2f} of CPU time, '
              '{:.2f} of memory, {:.2f} of the number of pairs.'.format(
                  FIRST_OF_EXPONENTS, records[-1]['num_images'], time, memory,
                  exponent(records, lambda r: r['num_pairs']))]
  repeated = ['{:,} images {} runs of {:.1f} to {:.1f} s'.format(
      r['num_images'], len(r['all_cpu_s']), min(r['all_cpu_s']),
      max(r['all_cpu_s'])) for r in records if len(r['all_cpu_s']) > 1]
  if repeated:
    lines += ['', 'CPU times of small sizes are means of runs before and after '
              'those of large ones: %s.' % ', '.join(repeated)]
  draw(records, args.plot_path)
  return '\n'.join(lines) + '\n'


def parse_arguments():
  parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
  add_arguments(parser, __file__, 'growth', 'adasfm-growth')
  parser.add_argument('--sizes', default='500,1000,4000,10000,30000',
                      help='numbers of images')
  parser.add_argument('--limits', default='',
                      help='those of the sizes whose limit is computed too')
  parser.add_argument('--host_colmap', default='',
                      help='the program for the limit; ours when not given')
  root = parser.get_default('root')
  parser.add_argument('--plot_path',
                      default=os.path.join(root, 'docs', 'images',
                                           'growth.svg'))
  return parser.parse_args()


def list_sizes(text):
  return [int(size) for size in text.split(',') if size]


def order_runs(sizes):
  """Sizes in the order of their runs."""
  small = [size for size in sizes if size <= MAX_SMALL_SIZE]
  order = list(small)
  for size in sizes:
    if size > MAX_SMALL_SIZE:
      order += [size] + small
  return order


def main():
  args = parse_arguments()
  limits = list_sizes(args.limits)
  rows = {}
  counts = {}
  for size in order_runs(list_sizes(args.sizes)):
    counts[size] = counts.get(size, 0) + 1
    key = '%d images' % size
    if counts[size] > 1:
      key += ', run %d' % counts[size]
    rows[key] = ([size in limits],
                 functools.partial(run_size, size, size in limits, args))
  run_table(rows, report, args)


if __name__ == '__main__':
  sys.exit(main())
