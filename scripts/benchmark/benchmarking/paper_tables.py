# SPDX-License-Identifier: BSD-3-Clause
"""The page docs/results/paper.md: tables of paper_figures.py's records."""

from statistics import median

from benchmarking.match_refinement import FEW_KEYPOINTS
from benchmarking.merge_trials import LEVELS_M, THRESHOLDS
from benchmarking.sets import REAL_SETS
from benchmarking.view_graph import unpack

METHODS = {'mapper': 'COLMAP 3.8 mapper',
           'hierarchical_mapper': 'COLMAP 3.8 hierarchical_mapper',
           'adasfm_global': 'AdaSfM, coarse model', 'adasfm': 'AdaSfM'}
# Rendered and real photos of Table I and its histograms.
TWO_VIEW_SETS = ('rendered-60', 'kitti07-160')


def by_method(benchmark, hierarchical):
  """{set: {method: record}} in the order of README's table."""
  result = {}
  for record in [r for row in benchmark['rows'] for r in row['records']] + list(
      hierarchical):
    result.setdefault(record['set'], {})[record['method']] = record
  return result


def structure_table(runs):
  """The form of the paper's Table II."""
  lines = ['| set | method | N_c | N_p | L | RMSE px | T s | CPU s |',
           '|---|---|---:|---:|---:|---:|---:|---:|']
  for name, methods in runs.items():
    for method, label in METHODS.items():
      record = methods.get(method)
      if not record:
        continue
      e = record['evaluation']
      figures = '%d of %d | %s | %.2f | %.2f' % (
          e['num_images'], e['num_true_images'],
          '{:,}'.format(e['num_points']), e['mean_track_length'],
          e['rmse_px']) if e else ' - | | |'
      lines.append('| %s | %s | %s | %.1f | %.1f |' % (
          name, label, figures, record['seconds'], record['cpu_seconds']))
  return lines


def accuracy_table(runs):
  """The form of the paper's Table III."""
  cells = ('rotation_mean_deg', 'rotation_median_deg', 'translation_mean_m',
           'translation_median_m')
  lines = ['| set | N | COLMAP 3.8: N_c | R mean deg | R median | t mean m | '
           't median | R alone | AdaSfM: N_c | R mean deg | R median | t mean m | '
           't median | R alone |', '|---|' + '---:|' * 13]
  for name, methods in runs.items():
    row, size = [], ''
    for method in ('mapper', 'adasfm'):
      e = methods.get(method, {}).get('evaluation')
      if not e:
        row += ['-'] * 6
        continue
      size = str(e['num_true_images'])
      best = e['sim3_least_squares']
      row += ['%d' % e['num_images']] + ['%.3f' % best[key] for key in cells]
      row.append('%.3f' % e['orientation_median_deg'])
    lines.append('| ' + ' | '.join([name, size] + row) + ' |')
  return lines


def view_graph_table(record):
  lines = ['| view graph | coarse models | images | t RMSE m, after a similarity '
           '| as it is, in metres | scale |', '|---|---:|---:|---:|---:|---:|']
  for key, label in (('without', 'verified pairs only'),
                     ('with', 'with sensor edges')):
    models = record[key]

    def column(field, form):
      return ', '.join(form % model[field] for model in models)

    lines.append('| %s | %d | %s | %s | %s | %s |' % (
        label, len(models), ', '.join(str(m['images']) for m in models),
        column('sim3_rmse_m', '%.3f'), column('se3_rmse_m', '%.3f'),
        column('scale', '%.3f')))
  return lines


def view_graph_words(record):
  visual, sensors = (set(unpack(record[k])) for k in ('visual', 'sensors'))
  return ('%d verified pairs are kept, %d that join look-alike places or '
          'contradict the odometry are removed, %d edges are of the sensors, %d '
          'of them between images that no verified pair joins.' % (
              len(visual), len(unpack(record['removed'])), len(sensors),
              len(sensors - visual)))


def trial_values(records, level_m, threshold, with_priors, field):
  """The values of a field, one for each seed whose run has it."""
  found = [r[threshold] for r in records
           if r['level_m'] == level_m and r['with_priors'] == with_priors]
  if field == 'separator_rmse_m':  # needs two merged parts
    found = [f for f in found if f.get('merged', 0) > 1]
  return [f[field] for f in found if f.get(field) is not None]


def _median(values, form):
  return form % median(values) if values else '-'


def _spread(values, form='%.3f'):
  if not values:
    return '-'
  if len(values) == 1:
    return form % values[0]
  return '%s (%s to %s)' % tuple(form % v for v in (
      median(values), min(values), max(values)))


def merge_table(records):
  lines = ['| disturbed by m | coarse error m | threshold m | parts merged | '
           'images at coarse poses | inlier ratio, median part | threshold used '
           '| parts apart m | error without priors m | with priors m |',
           '|---:|---:|---|---:|---:|---:|---:|---|---|---|']
  for level_m in (0,) + LEVELS_M:
    coarse = [r['coarse_rmse_m'] for r in records if r['level_m'] == level_m]
    for threshold in THRESHOLDS:
      def values(field, with_priors=False):
        return trial_values(records, level_m, threshold, with_priors, field)

      merged, parts = sum(values('merged')), sum(values('parts'))
      lines.append('| %g | %s | %s | %d of %d | %s | %s | %s | %s | %s | %s |' % (
          level_m, _median(coarse, '%.2f'), threshold, merged, parts,
          _median(values('coarse_images'), '%.0f'),
          _median([median(v) for v in values('inlier_ratios')], '%.2f'),
          _median([median(v) for v in values('thresholds_m')], '%.1f'),
          _spread(values('separator_rmse_m'), '%.2f'),
          _spread(values('rmse_m')), _spread(values('rmse_m', True))))
  return lines


def best_thresholds(records):
  """Which threshold has the smallest median error at which level, and at which
  levels all errors of the adaptive one are below all errors of the others."""
  words = []
  for with_priors, name in ((False, 'without priors'), (True, 'with priors')):
    won, apart = {}, []
    for level_m in LEVELS_M:
      errors = {t: values for t in THRESHOLDS if (
          values := trial_values(records, level_m, t, with_priors, 'rmse_m'))}
      if 'adaptive' not in errors:
        continue
      best = min(errors, key=lambda t: median(errors[t]))
      won.setdefault(best, []).append('%g m' % level_m)
      if max(errors['adaptive']) < min(min(values) for t, values in
                                       errors.items() if t != 'adaptive'):
        apart.append('%g m' % level_m)
    words.append('Smallest median error %s: %s. The adaptive threshold errs less '
                 'than all others %s.' % (name, '; '.join(
                     '%s at %s' % (t if t == 'adaptive' else t + ' m',
                                   ', '.join(levels))
                     for t, levels in won.items()),
                               'in all trials at ' + ', '.join(apart) if apart
                               else 'at none of them: the ranges overlap'))
  return ' '.join(words)


def _model_cell(models):
  if not models:
    return 'no model'
  return '%s images, %s m' % (
      ' + '.join(str(m['images']) for m in models),
      ', '.join('%.3f' % m['rmse_m'] for m in models))


def refinement_table(records):
  lines = ['| case | pairs | | number | matches a pair | precision % | '
           'true matches kept % | COLMAP mapper on all pairs | coarse model |',
           '|---|---|---|---:|---:|---:|---:|---|---|']
  for record in records:
    if 'after' not in record:
      lines.append('| %s | %s | | | | | | | |' % (
          record['case'], record.get('error')))
      continue
    for kind, label in (('hard', record['case']), ('other', 'all others')):
      for when in ('before', 'after'):
        f = record[when][kind]
        true_before = record['before'][kind]['true']
        lines.append('| %s | %s | %s | %d | %s | %s | %s | %s | %s |' % (
            record['case'], label, when, f['pairs'],
            '%.1f' % (f['matches'] / f['pairs']) if f['pairs'] else '-',
            '%.2f' % (100 * f['true'] / f['matches']) if f['matches'] else '-',
            '' if when == 'before' else '%.1f' % (
                100 * f['true'] / true_before) if true_before else '-',
            _model_cell(record['mapper_' + when]) if kind == 'hard' else '',
            _model_cell(record['coarse']) if kind == 'hard' and
            when == 'after' else ''))
  return lines


def command(options):
  return '`adasfm_synthesizer %s`' % ' '.join(options)


def recall_table(pairs):
  """The form of the paper's Table I, of {set: pairs}."""
  columns = [(name, key, label) for name in pairs for key, label in (
      ('verified', 'COLMAP'), ('kept_after', 'global'))]
  lines = ['| AUC % | ' + ' | '.join('%s, %s: R | t' % (name, label)
                                     for name, _, label in columns) + ' |',
           '|---|' + '---:|' * (2 * len(columns))]
  first = next(iter(pairs.values()))['verified']['relative_pose_auc']
  for k, auc in enumerate(first):
    cells = ['%.2f' % pairs[name][key]['relative_pose_auc'][k][part]
             for name, key, _ in columns
             for part in ('rotation_percent', 'translation_percent')]
    lines.append('| @ %g deg | %s |' % (auc['threshold_deg'], ' | '.join(cells)))
  return lines


def pairs_of_sets(two_view):
  """{set: pairs} of the sets in Table I and its picture."""
  pairs = {r['set']: r['pairs'] for row in two_view['rows']
           for r in row['records'] if 'pairs' in r}
  return {name: pairs[name] for name in TWO_VIEW_SETS if name in pairs}


def two_view_section(two_view):
  pairs = pairs_of_sets(two_view)
  means = '; '.join('%s from %.3f to %.3f' % (
      name, p['verified']['mean_inlier_ratio'],
      p['kept_after']['mean_inlier_ratio']) for name, p in pairs.items())
  return ['## Table I in form', '',
          "Area under the recall curve of the pairs' rotations R and directions "
          't: COLMAP 3.8 (nearest neighbours and RANSAC), and after '
          '`adasfm_global`. All sets and counts: [two_view.md](two_view.md); runs '
          'of %s.' % ' and '.join(sorted({row['date']
                                          for row in two_view['rows']})), '',
          *recall_table(pairs), '',
          'Inlier ratios are of the raw matches. Afterwards a match has to fit '
          'the global poses, before it had to fit the pose of its pair alone. '
          'Means: %s.' % means, '',
          '![Inlier ratios before and after](../images/paper_inlier_ratios.svg)',
          '']


def set_sections(records, benchmark):
  runs = by_method(benchmark, [r for r in records if r.get('method') ==
                               'hierarchical_mapper'])
  runs = {name: methods for name, methods in runs.items() if name in REAL_SETS}
  missing = [name for name in runs if 'hierarchical_mapper' not in runs[name]]
  dates = sorted(row['date'] for row in benchmark['rows'])
  return ['## Table II in form', '',
          'N_c registered images, N_p points, L mean track length, T wall time '
          'after extraction and matching; the largest model where there are '
          "several. `hierarchical_mapper` is of this page's run, the others of "
          "README's table (%s).%s" % (
              ' to '.join(dict.fromkeys((dates[0], dates[-1]))),
              ' It has not been run on %s.' % ', '.join(missing)
              if missing else ''), '', *structure_table(runs), '',
          '## Table III in form', '',
          'Mean and median errors of orientations R and camera centres t of the '
          'final models after the best similarity, of those images that a '
          'model has. A straight drive leaves the turn about its line open to '
          'that; R alone is the median [deg] after the best rotation of the '
          'orientations.', '', *accuracy_table(runs), '']


def view_graph_section(record, world):
  return ['## View graph with and without augmentation', '',
          'World: %s. %s Without these (`AdaSfmGlobal.use_augmentation 0`) '
          'the view graph falls apart. In the picture each model is moved so '
          'that its first camera is where it truly is, and not scaled.' %
          (command(world), view_graph_words(record)), '',
          '![View graph, and coarse models without and with sensor edges]'
          '(../images/paper_view_graph.png)', '', *view_graph_table(record), '']


def merge_section(trials):
  return ['## Merge trials', '',
          'The coarse model of the same world, disturbed: a bend over 60 images '
          'with the amplitude that the table names, half of it as white noise '
          'per axis, 1 deg a metre in rotation, and 15 % of the images, four '
          'in a row, ten times as far beside the way. Parts have 50 images '
          '(`--AdaSfmPartition.max_part_size 50`); a part whose inlier ratio is '
          'below 0.7 is not merged, and its images begin at the coarse poses. '
          'Parts apart: RMSE between the places of an image in two parts, before '
          'the parts are relaxed. Medians of three disturbances, with their '
          'range; without priors is '
          '`--AdaSfmMapper.use_priors_in_adjustment 0`. No threshold exceeds '
          'a tenth of its part: 10 m became what the table says.', '',
          '![Merged parts and errors over the disturbance]'
          '(../images/paper_merge_trials.svg)', '', *merge_table(trials), '',
          best_thresholds(trials), '']


def refinement_section(cases):
  worlds = '; '.join('%s %s' % (r['case'], command([r['options']]))
                     for r in cases)
  lines = ['## Match refinement', '',
           'Verified pairs of three hard kinds, before and after '
           '`adasfm_global`. Look-alike: more false matches than true ones. '
           'Little texture: an image of the pair has at most %d keypoints. '
           'Mirrored: photos in a bend, whose right half is the mirror image '
           'of the left one; a match is true there when it fits the true poses '
           'within 4 px and is not in the mirror (the importer refuses this '
           'drive, whose gyroscope contradicts the pictures, without `--force '
           '1`). The mapper of COLMAP 3.8 ran '
           'on all pairs, before and after; the coarse model is that of '
           '`adasfm_global`. The false matches that are left fit the epipolar '
           'lines of the global poses. Worlds: %s.' % (
               FEW_KEYPOINTS, worlds), '',
           *refinement_table(cases)]
  if any(r.get('example') for r in cases):
    lines += ['', '![Matches of a mirrored pair before and after]'
              '(../images/paper_mirrored_pair.png)']
  return lines


def page(records, benchmark, two_view, args):
  """The text between the markers of the page."""
  lines = two_view_section(two_view) + set_sections(records, benchmark)
  for record in records:
    if 'visual' in record:
      lines += view_graph_section(record, args.world)
  lines += merge_section([r for r in records if 'level_m' in r])
  lines += refinement_section([r for r in records if 'case' in r])
  return '\n'.join(lines) + '\n'
