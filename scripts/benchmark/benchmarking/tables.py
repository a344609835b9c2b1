# SPDX-License-Identifier: BSD-3-Clause
"""Markdown tables of the benchmark's records."""

import math
from statistics import median

from benchmarking.sets import is_clean, size_of

NAMES = {
    'mapper': 'COLMAP mapper',
    'hierarchical_mapper': 'COLMAP hierarchical_mapper',
    'priors_only': 'priors only',
    'adasfm_global': 'AdaSfM, coarse model',
    'adasfm': '**AdaSfM**',
    'adasfm_no_sensors': 'AdaSfM without sensors',
    'limit': 'limit (true poses, one adjustment)',
}


def name_of(method):
  return NAMES.get(method, method)


def middle_runs(records):
  """{(set, method): record}; of repeated runs the one of median time."""
  groups = {}
  for record in records:
    groups.setdefault((record['set'], record['method']), []).append(record)
  result = {}
  for key, group in groups.items():
    done = [r for r in group if r['evaluation']] or group
    wanted = median([r['seconds'] for r in done])
    result[key] = min(done, key=lambda r: abs(r['seconds'] - wanted))
  return result


def ordered(records, field):
  return list(dict.fromkeys(record[field] for record in records))


def error_of(evaluation):
  return evaluation['sim3_least_squares']['translation_rmse_m']


def sim3_error(record):
  return error_of(record['evaluation'])


def ratio(value, base):
  return '%.2f' % (value / base) if base else ''


def long_table(records):
  """A line per set and method, with ratios to the limit of the set."""
  lines = ['| set | method | images | points | track | RMSE px | error m '
           '(Sim3) | error m (SE3) | scale | rotation deg | s | CPU s | MiB '
           '| error / limit | s / limit |',
           '|---|---|---' + '|---:' * 12 + '|']
  runs = middle_runs(records)
  for (name, method), record in runs.items():
    e = record['evaluation']
    if not e:
      reason = record.get('error', 'no model').replace('|', '/')
      lines.append('| %s | %s | %s |' % (name, name_of(method), reason) +
                   ' |' * 12)
      continue
    limit = runs.get((name, 'limit'))
    has_limit = limit and limit['evaluation']
    # Not printed for models without points.
    structure = '%d | %.2f | %.3f' % (
        e['num_points'], e['mean_track_length'], e['rmse_px'])
    lines.append(
        '| %s | %s | %d/%d | %s | %.3f | %.3f | %.4f | %.3f | %.1f | %.1f '
        '| %d | %s | %s |' %
        (name, name_of(method), e['num_images'], e['num_true_images'],
         structure if e['num_points'] else '- | - | -', sim3_error(record),
         e['se3_least_squares']['translation_rmse_m'], e['sim3']['scale'],
         e['orientation_median_deg'], record['seconds'],
         record['cpu_seconds'], record['peak_mib'],
         ratio(sim3_error(record), sim3_error(limit)) if has_limit else '',
         ratio(record['seconds'], limit['seconds']) if has_limit else ''))
  return '\n'.join(lines) + '\n'


def _wide_table(records, columns, methods, cells):
  runs = middle_runs(records)
  head = ['set', 'N'] + ['%s: %s' % (name_of(m), c) for m in methods
                         for c in columns]
  lines = ['| ' + ' | '.join(head) + ' |', '|---' + '|---:' *
           (len(head) - 1) + '|']
  for name in ordered(records, 'set'):
    base = runs.get((name, 'mapper'))
    row, size = [], ''
    for method in methods:
      record = runs.get((name, method))
      if not record or not record['evaluation']:
        row += ['-'] * len(columns)
        continue
      size = str(record['evaluation']['num_true_images'])
      seconds = '%.1f' % record['seconds']
      if base and base['evaluation'] and method != 'mapper':
        seconds += ' (x%.1f)' % (base['seconds'] / max(record['seconds'], .01))
      row += cells(record) + [seconds]
    lines.append('| ' + ' | '.join([name, size] + row) + ' |')
  return '\n'.join(lines) + '\n'


def reconstruction_table(records, methods):
  """The form of the paper's Table 2: N_c, N_p, track length, RMSE, T."""
  return _wide_table(
      records, ['N_c', 'N_p', 'L', 'RMSE', 'T'], methods,
      lambda r: ['%d' % r['evaluation']['num_images'],
                 '%d' % r['evaluation']['num_points'],
                 '%.2f' % r['evaluation']['mean_track_length'],
                 '%.2f' % r['evaluation']['rmse_px']])


def accuracy_table(records, methods):
  """The form of the paper's Table 3: N_c, N_p, dR, dt, T."""
  return _wide_table(
      records, ['N_c', 'N_p', 'dR deg', 'dt m', 'T'], methods,
      lambda r: ['%d' % r['evaluation']['num_images'],
                 '%d' % r['evaluation']['num_points'],
                 '%.3f' % r['evaluation']['orientation_median_deg'],
                 '%.3f' % sim3_error(r)])


def ablation_table(records):
  """A line per variant of AdaSfM: images, errors in m and CPU s per set."""
  runs = middle_runs(records)
  methods = [m for m in ordered(records, 'method')
             if m.startswith('adasfm') and m != 'adasfm_global']
  if len(methods) < 2:
    return ''
  names = [name for name in ordered(records, 'set')
           if any((name, m) in runs for m in methods)]
  lines = ['| variant | ' + ' | '.join(names) + ' |',
           '|---' * (len(names) + 1) + '|']
  for method in methods:
    cells = []
    for name in names:
      record = runs.get((name, method))
      e = record and record['evaluation']
      coarse = e and record.get('coarse_evaluation')
      cells.append('%d/%d, %.3f m%s, %.0f s' %
                   (e['num_images'], e['num_true_images'], sim3_error(record),
                    ' (coarse %.3f)' % error_of(coarse) if coarse else '',
                    record['cpu_seconds']) if e else '-')
    lines.append('| %s | %s |' % (name_of(method).strip('*'),
                                  ' | '.join(cells)))
  return '\n'.join(lines) + '\n'


def exponent(points):
  """Slope of log(value) over log(images) by least squares."""
  xs = [math.log(x) for x, _ in points]
  ys = [math.log(y) for _, y in points]
  mean_x, mean_y = sum(xs) / len(xs), sum(ys) / len(ys)
  return (sum((x - mean_x) * (y - mean_y) for x, y in zip(xs, ys)) /
          sum((x - mean_x) ** 2 for x in xs))


def growth_table(records):
  """Exponents of time and memory over the images of the clean sets."""
  runs = middle_runs(records)
  lines = ['| method | images | exponent of time | of CPU time | of memory |',
           '|---|---|---:|---:|---:|']
  for method in ordered(records, 'method'):
    done = sorted((size_of(name), r) for (name, m), r in runs.items()
                  if m == method and is_clean(name) and r['evaluation'])
    if len(done) < 2 or min(r['seconds'] for _, r in done) <= 0:
      continue
    values = [exponent([(n, r[field]) for n, r in done])
              for field in ('seconds', 'cpu_seconds', 'peak_mib')]
    lines.append('| %s | %d to %d | %.2f | %.2f | %.2f |' %
                 ((name_of(method), done[0][0], done[-1][0]) + tuple(values)))
  return '\n'.join(lines) + '\n' if len(lines) > 2 else ''
