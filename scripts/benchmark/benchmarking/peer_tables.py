# SPDX-License-Identifier: BSD-3-Clause
"""The tables of README.md and of the pages about other COLMAPs: models, lost
images and folds of each method on the same database."""

# A model with a larger error of centres after the best similarity is folded, or
# bent beyond use: the drives here are 50 to 600 m long.
FOLDED_M = 1.0


def by_key(records):
  return {(r['set'], r['method']): r for r in records}


def is_whole(record):
  return bool(record and record.get('models') and record['models'][0]['images'] ==
              record['evaluation']['num_true_images'])


def error_of(record):
  return record['models'][0]['rmse_m'] if record and record.get(
      'models') else None


def format_error(error_m):
  return '%.3f' % error_m if error_m < 10 else '%.1f' % error_m


def cell(record, is_best):
  """Error of the largest model, and its images where some are missing."""
  if not record:
    return '-'
  if not record.get('models'):
    return 'no model'
  text = format_error(error_of(record))
  if is_best:
    text = '**%s**' % text
  if not is_whole(record):
    text += ', %d of %d' % (record['models'][0]['images'],
                            record['evaluation']['num_true_images'])
  return text


def summary_table(records, sets, methods):
  """A line per set: sets {name: what it shows}, methods {method: heading}. The
  least error among the models with all images is bold."""
  runs = by_key(records)
  lines = ['| set | what it shows | %s | our scale |' % ' | '.join(
      methods.values()), '|---' * (len(methods) + 3) + '|']
  for name, shows in sets.items():
    mine = [runs.get((name, method)) for method in methods]
    whole = [error_of(r) for r in mine if is_whole(r)]
    cells = [cell(r, is_whole(r) and error_of(r) == min(whole)) for r in mine]
    ours = runs.get((name, 'adasfm'))
    scale = ('%.3f' % ours['evaluation']['sim3']['scale']
             if ours and ours['evaluation'] else '-')
    lines.append('| %s |' % ' | '.join([name, shows] + cells + [scale]))
  return '\n'.join(lines)


def verdict(record):
  """What is lost or folded, in words."""
  models = record['models']
  lost = record['evaluation']['num_true_images'] - sum(
      m['images'] for m in models)
  said = []
  if any(m['rmse_m'] > FOLDED_M for m in models):
    said.append('folded')
  if len(models) > 1:
    said.append('in %d models' % len(models))
  if lost > 0:
    said.append('%d images lost' % lost)
  return ', '.join(said) or 'whole'


def detail_row(name, heading, record):
  if not record:
    return None
  times = '%.1f | %.1f | %d' % (record['seconds'], record['cpu_seconds'],
                                record['peak_mib'])
  if not record.get('models'):
    why = record.get('error', '')
    return '| %s | %s | - | - | no model%s | %s |' % (
        name, heading, why and ': ' + why, times)
  models = record['models']
  return '| %s | %s | %s | %s | %s | %s |' % (
      name, heading, ' + '.join(str(m['images']) for m in models),
      ', '.join(format_error(m['rmse_m']) for m in models), verdict(record),
      times)


def detail_table(records, sets, methods):
  """A line per set and method: every model, times and memory."""
  runs = by_key(records)
  lines = ['| set | method | images | error m | verdict | s | CPU s | MiB |',
           '|---|---|---|---|---|---:|---:|---:|']
  for name in sets:
    rows = [detail_row(name, heading, runs.get((name, method)))
            for method, heading in methods.items()]
    lines += [row for row in rows if row]
  return '\n'.join(lines)


def losses(records, sets, methods):
  """Sets where a peer's whole model is more accurate than ours, or ours lacks
  images, in one line."""
  runs = by_key(records)
  said = []
  for name in sets:
    ours = runs.get((name, 'adasfm'))
    for method, heading in methods.items():
      peer = runs.get((name, method))
      if (method != 'adasfm' and is_whole(peer) and
          not (is_whole(ours) and error_of(ours) <= error_of(peer))):
        said.append('%s on %s (%s m, ours %s)' % (
            heading, name, format_error(error_of(peer)),
            cell(ours, False)))
  return ('Better than ours: %s.' % '; '.join(said) if said else
          'No other method has a whole model with a smaller error.')


def cleaner_table(records, sets, commands):
  """Raw beside cleaned: commands {heading: (raw method, cleaned method)}."""
  runs = by_key(records)
  lines = ['| set | command | raw: images | error m | CPU s | cleaned: images '
           '| error m | CPU s |', '|---|---|---|---|---:|---|---|---:|']
  for name in sets:
    for heading, methods in commands.items():
      cells = []
      for record in (runs.get((name, method)) for method in methods):
        if not record or not record.get('models'):
          cells.append('%s | | ' % ('no model' if record else '-'))
          continue
        models = record['models']
        # CPU time of the mapper alone; the cleaning is the same for all.
        cpu_s = [seconds for step, seconds in
                 record['step_cpu_seconds'].items() if step != 'clean']
        cells.append('%s | %s | %.0f' % (
            ' + '.join(str(m['images']) for m in models),
            ', '.join(format_error(m['rmse_m']) for m in models), sum(cpu_s)))
      lines.append('| %s | `%s` | %s |' % (name, heading, ' | '.join(cells)))
  return '\n'.join(lines)
