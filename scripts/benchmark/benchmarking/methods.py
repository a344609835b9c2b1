# SPDX-License-Identifier: BSD-3-Clause
"""The methods of the benchmark: COLMAP's mappers, peers, AdaSfM, the limit."""

import json
import os
import shutil

from benchmarking.host_options import has_option, solver_group
from benchmarking.limit import write_true_poses
from benchmarking.process import Failed, run
from benchmarking.trajectories import write_prior_trajectory

SCRIPTS = os.path.join(os.path.dirname(os.path.abspath(__file__)), '..', '..')
METHODS = ['mapper', 'hierarchical_mapper', 'adasfm', 'adasfm_no_sensors',
           'limit']

# AdaSfM with one step changed, to measure the effect of that step.
ABLATIONS = {
    'adasfm_no_' + name: {command: ['--%s.%s' % (group, option), '0']}
    for name, command, group, option in (
        ('loop_gating', 'global', 'AdaSfmGlobal', 'use_loop_gating'),
        ('augmentation', 'global', 'AdaSfmGlobal', 'use_augmentation'),
        ('refined_translations', 'global', 'AdaSfmGlobal',
         'refine_translations'),
        ('refined_positions', 'global', 'AdaSfmGlobal', 'refine_positions'),
        ('candidates', 'mapper', 'AdaSfmMapper', 'use_global_candidate'),
        ('priors_in_adjustment', 'mapper', 'AdaSfmMapper',
         'use_priors_in_adjustment'))}
# The paper's own terms in the adjustments of parts (eq. 8).
ABLATIONS['adasfm_coarse_motions'] = {
    'mapper': ['--AdaSfmMapper.use_coarse_motions_in_parts', '1']}
# The alignment of parts with one threshold for all, in metres.
ABLATIONS.update({
    'adasfm_fixed_threshold_%s' % metres: {
        'mapper': ['--AdaSfmAlign.adapt_threshold', '0',
                   '--AdaSfmAlign.initial_threshold', metres]}
    for metres in ('0.1', '1', '10')})


# Limits so low that small sets have several parts [images].
SMALL_PARTS = ['--AdaSfmPartition.max_num_images_undivided', '50',
               '--AdaSfmPartition.max_part_size', '50']


LOGS = {'image_times': 'times.csv', 'imu': 'imu.csv', 'wheel': 'wheel.csv',
        'sensors': 'sensors.yaml'}


def log_options(source, logs=tuple(LOGS)):
  """Arguments of adasfm_prior_importer and adasfm_automatic_reconstructor for
  these logs of a set."""
  return [word for log in logs
          for word in ('--%s_path' % log, os.path.join(source, LOGS[log]))]


def fixed_intrinsics(prefix):
  return ['--%srefine_focal_length' % prefix, '0',
          '--%srefine_extra_params' % prefix, '0']


def images_of(folder, source):
  images = os.path.join(source, 'images')
  return images if os.path.isdir(images) else folder


def run_mapper(command, executable, folder, source, args, fixed=True):
  """Runs a mapper of COLMAP. fixed: the database's intrinsics are kept."""
  output = os.path.join(folder, 'model')
  os.makedirs(output)
  arguments = [executable, command, '--database_path',
               os.path.join(folder, 'database.db'), '--output_path', output]
  if command in ('mapper', 'hierarchical_mapper', 'global_mapper'):
    arguments += ['--image_path', images_of(folder, source)]
    group = 'GlobalMapper' if command == 'global_mapper' else 'Mapper'
    if fixed and has_option(executable, command,
                            group + '.ba_refine_focal_length'):
      arguments += fixed_intrinsics(group + '.ba_')
  told = os.path.join(folder, 'cleaned.db.options')
  if command == 'mapper' and os.path.isfile(told):
    with open(told) as file:
      arguments += file.read().split()
  usage = run(arguments, os.path.join(folder, 'run.log'), args.timeout)
  return output, {command: usage}


def clean_database(folder, source, args):
  """Cleans a database for COLMAP's own mappers (docs/guide/cleaner.md)."""
  database = os.path.join(folder, 'database.db')
  cleaned = os.path.join(folder, 'cleaned.db')
  arguments = [os.path.join(SCRIPTS, 'clean_database.sh'), database, cleaned]
  if os.path.isfile(os.path.join(source, 'sensors.yaml')):
    arguments.append(source)
  usage = run(arguments, os.path.join(folder, 'run.log'), args.timeout,
              environment={'COLMAP': args.colmap})
  os.replace(cleaned, database)
  return {'clean': usage}


def make_coarse_model(folder, source, args, sensors, options):
  """Imports the logs and runs adasfm_global."""
  database = os.path.join(folder, 'database.db')
  log_path = os.path.join(folder, 'run.log')
  steps = {}
  if sensors:
    steps['import'] = run(
        [args.colmap, 'adasfm_prior_importer', '--database_path', database] +
        log_options(source) + options.get('import', []), log_path,
        args.timeout)
  steps['global'] = run([args.colmap, 'adasfm_global', '--database_path',
                         database, '--output_path',
                         os.path.join(folder, 'global')] +
                        options.get('global', []), log_path, args.timeout)
  return steps


def run_adasfm(folder, source, args, sensors, options):
  steps = make_coarse_model(folder, source, args, sensors, options)
  database = os.path.join(folder, 'database.db')
  log_path = os.path.join(folder, 'run.log')
  output = os.path.join(folder, 'model')
  steps['mapper'] = run([args.colmap, 'adasfm_mapper', '--database_path',
                         database, '--input_path',
                         os.path.join(folder, 'global'),
                         '--output_path', output] + options.get('mapper', []),
                        log_path, args.timeout)
  return output, steps


def run_limit(folder, source, args):
  """Triangulation from the true poses, then one adjustment to convergence."""
  host = args.host_colmap or args.colmap
  database = os.path.join(folder, 'database.db')
  log_path = os.path.join(folder, 'run.log')
  truth, points, output = (os.path.join(folder, name)
                           for name in ('truth', 'points', 'model'))
  write_true_poses(database, os.path.join(source, 'gt.txt'), truth)
  os.makedirs(points)
  os.makedirs(output)
  # COLMAP's triangulator adjusts the points at the true poses, too, at least
  # once; the limit needs no more than one iteration.
  steps = {'triangulate': run(
      [host, 'point_triangulator', '--database_path', database, '--image_path',
       images_of(folder, source), '--input_path', truth, '--output_path',
       points, '--Mapper.ba_global_max_refinements', '1',
       '--Mapper.ba_global_max_num_iterations', '1'], log_path,
      args.timeout)}
  solver = solver_group(host)
  steps['adjust'] = run(
      [host, 'bundle_adjuster', '--input_path', points, '--output_path',
       output, '--%s.function_tolerance' % solver, '1e-6',
       '--%s.max_num_iterations' % solver, '200'] +
      fixed_intrinsics('BundleAdjustment.'), log_path, args.timeout)
  return output, steps


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


def list_models(folder, ground_truth_path, args, log_path):
  """Images and error of every model of a run, the largest first."""
  models = []
  for name in sorted(os.listdir(folder)) if os.path.isdir(folder) else ():
    path = os.path.join(folder, name)
    evaluation = (evaluate(path, ground_truth_path, args, log_path)
                  if name.isdigit() and os.path.isdir(path) else None)
    if evaluation:
      models.append({
          'images': evaluation['num_images'],
          'rmse_m': evaluation['sim3_least_squares']['translation_rmse_m']})
  return sorted(models, key=lambda model: -model['images'])


def _record(name, method, steps, evaluation):
  record = {'set': name, 'method': method}
  record['seconds'] = round(sum(u.seconds for u in steps.values()), 2)
  record['cpu_seconds'] = round(sum(u.cpu_seconds for u in steps.values()), 2)
  record['peak_mib'] = round(max([u.peak_mib for u in steps.values()] or [0]))
  record['step_seconds'] = {k: round(u.seconds, 2) for k, u in steps.items()}
  record['step_cpu_seconds'] = {k: round(u.cpu_seconds, 2)
                                for k, u in steps.items()}
  record['evaluation'] = evaluation
  return record


def _run_steps(method, folder, source, args):
  if method in args.peers:
    executable, command, cleaned = args.peers[method]
    steps = {}
    if cleaned:
      steps = clean_database(folder, source, args)
    output, own_steps = run_mapper(command, executable, folder, source, args)
    return output, dict(steps, **own_steps)
  if method == 'limit':
    return run_limit(folder, source, args)
  if method.startswith('adasfm'):
    return run_adasfm(folder, source, args, method != 'adasfm_no_sensors',
                      ABLATIONS.get(method, {}))
  return run_mapper(method, args.host_colmap or args.colmap, folder, source,
                    args)


def run_method(name, method, folder, source, args):
  """JSON records of a run: one; for adasfm also of its coarse model and
  priors."""
  shutil.rmtree(folder, ignore_errors=True)
  os.makedirs(folder)
  database = os.path.join(folder, 'database.db')
  shutil.copy(os.path.join(args.output_path, name, 'database.db'), database)
  log_path = os.path.join(folder, 'run.log')
  ground_truth = os.path.join(source, 'gt.txt')

  def score(model):
    return evaluate(os.path.join(folder, model), ground_truth, args, log_path)

  try:
    _, steps = _run_steps(method, folder, source, args)
  except Failed as error:
    return [dict(_record(name, method, {'failed': error.usage}, None),
                 error=str(error))]
  records = [_record(name, method, steps, score('model'))]
  records[0]['models'] = list_models(os.path.join(folder, 'model'),
                                     ground_truth, args, log_path)
  if method.startswith('adasfm'):
    records[0]['coarse_evaluation'] = score(os.path.join('global', '0'))
  if method == 'adasfm':
    coarse = {k: steps[k] for k in ('import', 'global')}
    records.insert(0, _record(name, 'adasfm_global', coarse,
                              records[0]['coarse_evaluation']))
    if write_prior_trajectory(database, os.path.join(folder, 'priors')):
      records.insert(0, _record(name, 'priors_only',
                                {'import': steps['import']}, score('priors')))
  os.remove(database)
  return records
