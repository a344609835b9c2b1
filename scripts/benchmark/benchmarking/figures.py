# SPDX-License-Identifier: BSD-3-Clause
"""What the scripts share that write tables into docs/: arguments, results."""

import json
import os

from benchmarking.methods import evaluate


def add_arguments(parser, script, name, output_path):
  root = os.path.abspath(os.path.join(os.path.dirname(script), '..', '..'))
  parser.add_argument('--output_path', default=output_path,
                      help='folder of worlds and runs')
  parser.add_argument('--keep', type=int, default=0,
                      help="1: keep the runs' models and databases")
  parser.add_argument('--table_path',
                      default=os.path.join(root, 'docs', 'results',
                                           name + '.md'),
                      help='the table')
  parser.add_argument('--figures_path',
                      default=os.path.join(root, 'benchmark', 'results',
                                           name + '.json'),
                      help='the figures behind the table')
  parser.add_argument('--colmap', default=os.path.join(root, 'build', 'bin',
                                                       'colmap'),
                      help='our launcher')


def write_results(records, text, args):
  with open(args.figures_path, 'w') as file:
    json.dump(records, file, indent=1)
    file.write('\n')
  with open(args.table_path, 'w') as file:
    file.write(text)


def world_folder(name, seed, args):
  return os.path.join(args.output_path, '%s-%d' % (
      ''.join(c if c.isalnum() else '_' for c in name), seed))


def measure(model, folder, args, log_path):
  """Images and errors of a model of the world in a folder; None without one."""
  evaluation = evaluate(model, os.path.join(folder, 'gt.txt'), args, log_path)
  if not evaluation:
    return None
  best = evaluation['sim3_least_squares']
  return {'images': evaluation['num_images'],
          'true_images': evaluation['num_true_images'],
          'rmse_m': best['translation_rmse_m'], 'scale': best['scale']}
