# SPDX-License-Identifier: BSD-3-Clause
"""Plots of the benchmark's records, as SVG."""

import os

import matplotlib
matplotlib.use('svg')
from matplotlib import pyplot  # noqa: E402

from benchmarking.sets import is_clean, size_of
from benchmarking.tables import middle_runs, name_of, ordered, sim3_error


def _plain(method):
  return name_of(method).replace('*', '')


def _over_images(records, value, label, path):
  runs = middle_runs(records)
  figure, axes = pyplot.subplots(figsize=(8.0, 4.2))
  for method in ordered(records, 'method'):
    points = sorted((size_of(name), value(r)) for (name, m), r in runs.items()
                    if m == method and is_clean(name) and r['evaluation'])
    if points:
      axes.loglog(*zip(*points), marker='o', label=_plain(method))
  if not axes.lines:
    pyplot.close(figure)
    return
  axes.set_xlabel('images')
  axes.set_ylabel(label)
  axes.grid(True, which='both', alpha=0.25)
  sizes = sorted({size_of(name) for name, _ in runs if is_clean(name)})
  axes.set_xticks(sizes, ['{:,}'.format(size) for size in sizes])
  axes.set_xticks([], minor=True)
  axes.yaxis.set_major_formatter('{x:g}')
  # Beside the lines: there is no corner that none of them crosses.
  axes.legend(fontsize='small', loc='upper left', bbox_to_anchor=(1.0, 1.0))
  figure.tight_layout()
  figure.savefig(path, metadata={'Date': None})
  pyplot.close(figure)


def _stacked_steps(records, path):
  runs = [(name, record) for (name, method), record in
          middle_runs(records).items()
          if method == 'adasfm' and record['evaluation']]
  if not runs:
    return
  figure, axes = pyplot.subplots(figsize=(6.4, 0.4 * len(runs) + 1.6))
  left = [0.0] * len(runs)
  for step in ('import', 'global', 'mapper'):
    widths = [record['step_seconds'][step] for _, record in runs]
    axes.barh([name for name, _ in runs], widths, left=left, label=step)
    left = [a + b for a, b in zip(left, widths)]
  axes.invert_yaxis()
  axes.set_xlabel('AdaSfM, seconds')
  axes.legend(fontsize='small')
  figure.tight_layout()
  figure.savefig(path, metadata={'Date': None})
  pyplot.close(figure)


def write_plots(records, folder):
  # The same records give the same file.
  matplotlib.rcParams['svg.hashsalt'] = 'adasfm'
  _over_images(records, sim3_error, 'error after Sim3 [m]',
               os.path.join(folder, 'error.svg'))
  _over_images(records, lambda r: r['cpu_seconds'], 'CPU time [s]',
               os.path.join(folder, 'time.svg'))
  _over_images(records, lambda r: r['peak_mib'], 'peak memory [MiB]',
               os.path.join(folder, 'memory.svg'))
  _stacked_steps(records, os.path.join(folder, 'steps.svg'))
