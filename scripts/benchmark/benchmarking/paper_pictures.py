# SPDX-License-Identifier: BSD-3-Clause
"""Pictures of docs/results/paper.md: white ground, colours of Okabe and Ito."""

import os
from statistics import median

import matplotlib
matplotlib.use('agg')
from matplotlib import pyplot  # noqa: E402
from matplotlib.collections import LineCollection  # noqa: E402
from matplotlib.ticker import LogLocator  # noqa: E402
from PIL import Image  # noqa: E402

from benchmarking.merge_trials import LEVELS_M, THRESHOLDS  # noqa: E402
from benchmarking.paper_tables import (pairs_of_sets,  # noqa: E402
                                       trial_values)
from benchmarking.view_graph import unpack, unpack_points  # noqa: E402

BLUE, ORANGE, GREEN, PURPLE = '#0072B2', '#D55E00', '#009E73', '#CC79A7'
GREY, YELLOW, BLACK = '#999999', '#E69F00', '#000000'
# About as many matches of a pair are drawn at most.
NUM_LINES = 90


def save(figure, args, name, num_colours=0):
  """Saves a figure; num_colours limits a PNG's colours to keep photos small."""
  os.makedirs(args.images_path, exist_ok=True)
  path = os.path.join(args.images_path, name)
  if name.endswith('.svg'):
    figure.savefig(path, metadata={'Date': None}, facecolor='white')
  else:
    figure.savefig(path, metadata={'Software': None}, facecolor='white',
                   dpi=110)
  if num_colours:
    with Image.open(path) as picture:
      small = picture.convert('RGB').quantize(num_colours, dither=0)
    small.save(path, optimize=True)
  pyplot.close(figure)


def draw_histograms(two_view, args):
  sets = pairs_of_sets(two_view)
  figure, panels = pyplot.subplots(1, len(sets), figsize=(9.0, 3.4),
                                   squeeze=False)
  for axes, (name, pairs) in zip(panels[0], sets.items()):
    num_bins = len(pairs['verified']['inlier_ratio_histogram'])
    width = 0.4 / num_bins
    for k, (key, label, colour) in enumerate((
        ('verified', 'before: verified by COLMAP', BLUE),
        ('kept_after', 'after: kept and refined', ORANGE))):
      counts = pairs[key]['inlier_ratio_histogram']
      axes.bar([(b + 0.5) / num_bins + (k - 0.5) * width
                for b in range(num_bins)], counts, width, color=colour,
               label='%s, mean %.3f' % (label, pairs[key]['mean_inlier_ratio']))
    axes.set_yscale('log')
    axes.yaxis.set_major_formatter('{x:g}')
    axes.set_xlim(0.2, 1.0)
    axes.set_ylim(0.7, None)
    axes.set_title(name)
    axes.set_xlabel('inlier ratio [inliers / raw matches]')
    axes.set_ylabel('number of pairs')
    axes.legend(fontsize='small', loc='upper left')
  figure.tight_layout()
  save(figure, args, 'paper_inlier_ratios.svg')


def _segments(points, pairs):
  return [(points[a], points[b]) for a, b in pairs]


def _plain_axes(axes, title):
  axes.set_title(title, fontsize='medium')
  axes.set_xlabel('x [m]')
  axes.set_ylabel('y [m]')
  axes.set_aspect('equal', adjustable='datalim')
  axes.grid(True, alpha=0.25)


def draw_view_graph(record, args):
  truth = unpack_points(record['truth'])
  visual, sensors, removed = (set(unpack(record[key]))
                              for key in ('visual', 'sensors', 'removed'))
  figure, panels = pyplot.subplots(1, 3, figsize=(13.0, 5.2))
  for pairs, colour, width, zorder, label in (
      (removed, ORANGE, 0.6, 1, 'verified pair, removed as false'),
      (visual, GREY, 4.0, 2, 'verified pair, kept'),
      (sensors - visual, BLUE, 4.0, 4, 'sensor edge where no pair is verified')):
    panels[0].add_collection(LineCollection(
        _segments(truth, pairs), colors=colour, linewidths=width,
        label='%s (%d)' % (label, len(pairs)), zorder=zorder))
  panels[0].plot(*truth.T, '.', color=BLACK, markersize=2, zorder=3,
                 label='images (%d)' % len(truth))
  _plain_axes(panels[0], 'view graph, from above')
  for axes, key, title in ((panels[1], 'without', 'coarse, no augmentation'),
                           (panels[2], 'with', 'coarse, with sensor edges')):
    axes.plot(*truth.T, color=GREY, linewidth=5, alpha=0.5, label='truth')
    for k, model in enumerate(record[key]):
      points = unpack_points(model['centres'])
      colour = (BLUE, ORANGE, GREEN, PURPLE, YELLOW)[k % 5]
      axes.plot(*points.T, '-', color=colour, linewidth=1.5,
                label='model %d: %d images' % (k, model['images']))
      axes.plot(*points[0], 'o', color=colour, markersize=5)
    _plain_axes(axes, title)
    axes.set_xlim(panels[0].get_xlim())
  for axes in panels:
    axes.legend(fontsize='small', loc='upper center',
                bbox_to_anchor=(0.5, -0.14))
  figure.tight_layout()
  save(figure, args, 'paper_view_graph.png')


def _draw_trial(axes, records, field, with_priors, label):
  marks = dict(zip(THRESHOLDS, 'vso*'))
  colours = dict(zip(THRESHOLDS, (PURPLE, YELLOW, BLUE, ORANGE)))
  for k, threshold in enumerate(THRESHOLDS):
    values = [trial_values(records, level, threshold, with_priors, field)
              for level in LEVELS_M]
    if field == 'merged':
      values = [[100 * m / p for m, p in zip(merged, trial_values(
          records, level, threshold, with_priors, 'parts'))]
                for level, merged in zip(LEVELS_M, values)]
    done = [(level * 1.04 ** (k - 1.5), v) for level, v in zip(LEVELS_M, values)
            if v]
    middle = [median(v) for _, v in done]
    axes.errorbar([x for x, _ in done], middle, yerr=(
        [m - min(v) for m, (_, v) in zip(middle, done)],
        [max(v) - m for m, (_, v) in zip(middle, done)]),
                  marker=marks[threshold], color=colours[threshold],
                  capsize=3, linewidth=1.3, markersize=7, label=(
                      'adaptive' if threshold == 'adaptive' else
                      'fixed, %s m' % threshold))
  axes.set_xscale('log')
  axes.set_xticks(LEVELS_M, ['%g' % level for level in LEVELS_M])
  axes.set_xticks([], minor=True)
  axes.set_xlabel('disturbance of the coarse poses [m]')
  axes.set_ylabel(label)
  axes.grid(True, alpha=0.25)


def draw_merge_trials(records, args):
  figure, panels = pyplot.subplots(2, 2, figsize=(9.6, 7.4))
  panels = panels.ravel()
  _draw_trial(panels[0], records, 'merged', False, 'parts merged [%]')
  _draw_trial(panels[1], records, 'separator_rmse_m', False,
              'merged parts apart, RMSE [m]')
  _draw_trial(panels[2], records, 'rmse_m', False,
              'final error, no priors in adjustment [m]')
  _draw_trial(panels[3], records, 'rmse_m', True,
              'final error, with priors [m]')
  for axes in panels[1:3]:
    axes.set_yscale('log')
    axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axes.yaxis.set_major_formatter('{x:g}')
    axes.yaxis.set_minor_formatter('')
  panels[0].set_ylim(-4, 104)
  panels[3].set_ylim(0, 1.1 * panels[3].get_ylim()[1])
  panels[3].legend(fontsize='small', loc='lower right')
  figure.tight_layout()
  save(figure, args, 'paper_merge_trials.svg')


def _draw_matches(axes, photos, matches, step, title):
  """Every step-th match as a line; the legend counts all."""
  height, width = photos[0].shape[:2]
  gap = 12
  for k, photo in enumerate(photos):
    left = k * (width + gap)
    axes.imshow(photo, cmap='gray', vmin=0, vmax=1,
                extent=(left, left + width, height, 0))
  for true, colour, style in ((0, ORANGE, '--'), (1, '#56B4E9', '-')):
    chosen = [m for m in matches if m[4] == true]
    axes.add_collection(LineCollection(
        [((m[0], m[1]), (m[2] + width + gap, m[3])) for m in chosen[::step]],
        colors=colour, linewidths=1.0, linestyles=style,
        label='%d %s' % (len(chosen), 'true' if true else 'false')))
  axes.set_xlim(0, 2 * width + gap)
  axes.set_ylim(height, 0)
  axes.set_axis_off()
  axes.set_title(title, fontsize='medium')
  axes.legend(fontsize='small', loc='lower right')


def draw_mirrored_pair(example, args):
  """Without the photos of the run, an existing picture stays as it is."""
  folder = os.path.join(args.output_path, example['photos'], 'images')
  paths = [os.path.join(folder, name) for name in example['names']]
  if not all(map(os.path.exists, paths)):
    print('left out the picture of matches: the photos of the run are gone')
    return
  photos = [pyplot.imread(path) for path in paths]
  photos = [p[..., :3].mean(axis=2)[::2, ::2] if p.ndim == 3 else p[::2, ::2]
            for p in photos]
  figure, panels = pyplot.subplots(2, 1, figsize=(7.2, 5.2))
  step = 1 + len(example['before'].split()) // NUM_LINES
  for axes, key, title in ((panels[0], 'before', 'as COLMAP verified them'),
                           (panels[1], 'after', 'after adasfm_global')):
    matches = [[float(v) for v in word.split(',')]
               for word in example[key].split()]
    matches = [[0.5 * v for v in m[:4]] + [m[4]] for m in matches]
    _draw_matches(axes, photos, matches, step,
                  '%s (every %dth match)' % (title, step))
  figure.tight_layout()
  save(figure, args, 'paper_mirrored_pair.png', num_colours=32)


def draw_all(records, two_view, args):
  # The same records give the same file.
  matplotlib.rcParams['svg.hashsalt'] = 'adasfm'
  draw_histograms(two_view, args)
  graph = next((r for r in records if 'visual' in r), None)
  if graph:
    draw_view_graph(graph, args)
  trials = [r for r in records if 'level_m' in r]
  if trials:
    draw_merge_trials(trials, args)
  example = next((r['example'] for r in records if r.get('example')), None)
  if example:
    draw_mirrored_pair(example, args)
