# SPDX-License-Identifier: BSD-3-Clause
"""Shared code of scripts that write tables into docs/: arguments, results."""

import json
import os
import shutil
import sys

from benchmarking.ledger import Ledger, describe, make_stamp
from benchmarking.methods import evaluate
from benchmarking.pages import write_table


def add_arguments(parser, script, name, output_path):
  root = os.path.abspath(os.path.join(os.path.dirname(script), '..', '..'))
  parser.set_defaults(root=root)
  parser.add_argument('--output_path', default=output_path,
                      help='folder of worlds and runs, and of rows.jsonl, the '
                      'rows that are done')
  parser.add_argument('--run', type=int, default=1,
                      help='0: only write the table of the rows that are done')
  parser.add_argument('--keep', type=int, default=0,
                      help="1: keep the runs' models and databases")
  parser.add_argument('--table_path',
                      default=os.path.join(root, 'docs', 'results',
                                           name + '.md'),
                      help='the page with the table, between markers')
  parser.add_argument('--figures_path',
                      default=os.path.join(root, 'benchmark', 'results',
                                           name + '.json'),
                      help='the figures behind the table')
  parser.add_argument('--colmap', default=os.path.join(root, 'build', 'bin',
                                                       'colmap'),
                      help='our launcher, built from these sources')


def open_ledger(args):
  """Opens the ledger in args.output_path, then sets args.output_path to its
  subfolder for worlds and runs of this version. Removes those of other
  versions."""
  os.makedirs(args.output_path, exist_ok=True)
  ledger = Ledger(os.path.join(args.output_path, 'rows.jsonl'),
                  make_stamp(args.root), args.root)
  folder = 'runs-' + ledger.stamp['sources']
  for name in os.listdir(args.output_path):
    if name.startswith('runs-') and name != folder:
      shutil.rmtree(os.path.join(args.output_path, name))
  args.output_path = os.path.join(args.output_path, folder)
  os.makedirs(args.output_path, exist_ok=True)
  return ledger


def run_rows(rows, args):
  """Runs the rows that are not done, writes the figures and returns the rows'
  entries; rows: {key: (spec, function that gives the record)}."""
  ledger = open_ledger(args)
  for key, (spec, function) in rows.items() if args.run else ():
    records = ledger.run(key, lambda: [function()], spec)
    print('%s: %s' % (key, json.dumps(records[0])[:500]), file=sys.stderr,
          flush=True)
  entries = ledger.entries(list(rows))
  write_figures(args.figures_path, entries)
  return entries


def run_table(rows, report, args):
  """Runs rows as run_rows and writes the table; report: text of records and
  args."""
  entries = run_rows(rows, args)
  text = report([r for e in entries for r in e['records']], args)
  name = os.path.splitext(os.path.basename(args.table_path))[0]
  write_table(args.table_path, name, text + '\n' + describe(entries))


def write_figures(path, entries):
  with open(path, 'w') as file:
    json.dump({'stamp': entries[0]['stamp'],
               'rows': [dict(key=e['key'], date=e['date'],
                             records=e['records']) for e in entries]},
              file, indent=1)
    file.write('\n')


def world_folder(name, seed, args):
  return os.path.join(args.output_path, '%s-%d' % (
      ''.join(c if c.isalnum() else '_' for c in name), seed))


def measure(model, folder, args, log_path):
  """Images and errors of a model against the folder's gt.txt; None without a
  model."""
  evaluation = evaluate(model, os.path.join(folder, 'gt.txt'), args, log_path)
  if not evaluation:
    return None
  best = evaluation['sim3_least_squares']
  return {'images': evaluation['num_images'],
          'true_images': evaluation['num_true_images'],
          'rmse_m': best['translation_rmse_m'], 'scale': best['scale']}
