#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Runs COLMAP's mappers and AdaSfM side by side on the same databases.

For each set the script makes or copies a database and runs the methods in turn;
with --repeats the methods alternate. Each run appends a line to rows.jsonl and
is not run again with the same version of the sources on the same machine, so a
benchmark may be continued; results.json, results.md and the plots are made from
all lines of the current version. Sets are made by `adasfm_synthesizer`; real
sequences are used when a folder with them is given. all.sh calls this script
for the tables of README.md and docs/.
"""

import argparse
import json
import os
import re
import sys

ROOT = os.path.abspath(os.path.join(os.path.dirname(__file__), '..', '..'))

from benchmarking import sets, tables  # noqa: E402
from benchmarking.figures import open_ledger  # noqa: E402
from benchmarking.host_options import version_of  # noqa: E402
from benchmarking.methods import ABLATIONS, METHODS, run_method  # noqa: E402

# Sets beyond this size are run with AdaSfM alone unless --methods names others.
LARGEST_SET_OF_PEERS = 4000


def parse_arguments():
  parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
  parser.add_argument('sets', nargs='*', default=['quick'],
                      help='quick, full, or any of: %s; default: quick' %
                      ', '.join(sets.REAL_SETS +
                                [kind + '-IMAGES' for kind in sets.KINDS]))
  parser.add_argument('--output_path', default='adasfm-benchmark',
                      help='folder of databases, models and tables')
  parser.add_argument('--data_path', default=os.path.join(ROOT, '..', 'shared',
                                                          'data'),
                      help='folder of the real sets')
  parser.add_argument('--methods', default='',
                      help='comma-separated, any of: %s; default: %s' %
                      (', '.join(METHODS + list(ABLATIONS)),
                       ','.join(METHODS)))
  parser.add_argument('--repeats', type=int, default=1,
                      help='runs of each method, alternating')
  parser.add_argument('--timeout', type=float, default=3600,
                      help='a command that takes longer is stopped [s]')
  parser.add_argument('--peer', action='append', default=[],
                      metavar='NAME=PATH:COMMAND[:cleaned]',
                      help='another colmap executable and its mapping command; '
                      'cleaned: on the database that adasfm_global has cleaned')
  parser.add_argument('--colmap', default=os.path.join(ROOT, 'build', 'bin',
                                                       'colmap'),
                      help='our launcher')
  parser.add_argument('--host_colmap', default='',
                      help="the host's executable; default: through ours")
  sets.add_features_argument(parser)
  parser.add_argument('--max_num_images', type=int, default=0,
                      help='worlds have no more than so many images (100 or '
                      'more, as blackouts have a size), and real sets are '
                      'left out: to see soon whether it all runs; 0: as named')
  parser.add_argument('--seed', type=int, default=1, help='of the worlds')
  args = parser.parse_args()
  args.root = ROOT
  sets.set_features_path(args)
  args.peers = {}
  for peer in args.peer:
    match = re.fullmatch(r'([^=]+)=([^:]+):([^:]+)(:cleaned)?', peer)
    if not match:
      parser.error('--peer takes NAME=PATH:COMMAND[:cleaned], not ' + peer)
    args.peers[match.group(1)] = (match.group(2), match.group(3),
                                  bool(match.group(4)))
  args.sets = expand_sets(args, parser)
  for method in args.methods.split(',') if args.methods else []:
    if method not in METHODS and method not in ABLATIONS:
      parser.error('no such method: %s' % method)
  return args


def expand_sets(args, parser):
  names = []
  for name in args.sets:
    if name in ('quick', 'full'):
      names += sets.QUICK if name == 'quick' else sets.FULL
      names += [s for s in sets.REAL_SETS
                if (name == 'full' or s == 'world-alias-300') and
                os.path.isdir(os.path.join(args.data_path, s))]
    elif sets.is_world(name) or os.path.isdir(
        os.path.join(args.data_path, name)):
      names.append(name)
    else:
      parser.error('no such set: %s' % name)
  if args.max_num_images:
    names = [sets.shrink(name, args.max_num_images) for name in names
             if sets.is_world(name)]
  return list(dict.fromkeys(names))


def methods_of(name, args):
  if args.methods:
    return args.methods.split(',') + list(args.peers)
  if sets.is_world(name) and sets.size_of(name) > LARGEST_SET_OF_PEERS:
    return ['adasfm']
  return METHODS + list(args.peers)


def spec_of(method, args):
  """What a run depends on besides our sources."""
  executable, *how = args.peers.get(method, (args.host_colmap or args.colmap,))
  return [version_of(executable), args.seed, args.timeout, *how]


def key_of(name, method, repeat):
  return '%s %s %d' % (name, method, repeat)


def write_tables(records, folder):
  present = tables.ordered(records, 'method')
  wide = [m for m in ('mapper', 'hierarchical_mapper', 'adasfm_global',
                      'adasfm') if m in present]
  text = ''.join((
      '# All runs\n\n', tables.long_table(records),
      "\n# Structure (the form of the paper's Table 2)\n\n",
      tables.reconstruction_table(records, wide),
      "\n# Accuracy (the form of the paper's Table 3)\n\n",
      tables.accuracy_table(records, wide)))
  growth = tables.growth_table(records)
  if growth:
    text += '\n# Growth on the clean sets\n\n' + growth
  ablations = tables.ablation_table(records)
  if ablations:
    text += '\n# Ablations: images, error after Sim3, CPU time\n\n' + ablations
  with open(os.path.join(folder, 'results.md'), 'w') as file:
    file.write(text)
  try:
    from benchmarking.plots import write_plots
    write_plots(records, folder)
  except ImportError:
    print('no plots: matplotlib is missing (scripts/setup.sh installs it)',
          file=sys.stderr)


def main():
  args = parse_arguments()
  top = args.output_path
  ledger = open_ledger(args)
  specs = {}
  for name in args.sets:
    folder = os.path.join(args.output_path, name)
    os.makedirs(folder, exist_ok=True)
    for repeat in range(args.repeats):
      for method in methods_of(name, args):
        print('%s: %s' % (name, method), file=sys.stderr, flush=True)
        if method not in specs:
          specs[method] = spec_of(method, args)

        def execute():
          source = sets.make_database(name, folder, args)
          return run_method(name, method, os.path.join(folder, method), source,
                            args)

        ledger.run(key_of(name, method, repeat), execute, specs[method])
  entries = ledger.current()
  records = [record for entry in entries for record in entry['records']]
  with open(os.path.join(top, 'results.json'), 'w') as file:
    json.dump({'stamp': ledger.stamp, 'records': records}, file, indent=1)
    file.write('\n')
  write_tables(records, top)
  print(tables.long_table(records))


if __name__ == '__main__':
  main()
