# SPDX-License-Identifier: BSD-3-Clause
"""The stages in their order. Each waits for the one before; its items do not
depend on each other."""

import os
import re

from chain import costs, prepare, work
from chain.settings import read_json


class Stage:
    """`results(settings, item)` are the paths of an item's results;
    `count(facts)` is the number of items, None if it is not known yet;
    `guess(settings, facts)` is the number of tasks to queue in that case."""

    def __init__(self, name, run, results, count=lambda facts: 1, guess=None,
                 is_wide=False, finds_sizes=False):
        self.name = name
        self.run = run
        self.results = results
        self.count = count
        self.guess = guess
        # True: many items of few cores; False: one item of many cores.
        self.is_wide = is_wide
        # After this stage, the needs of later stages are known better.
        self.finds_sizes = finds_sizes

    def cores(self, settings):
        return settings.threads_per_task if self.is_wide else settings.threads

    def num_tasks(self, settings, most):
        count = self.count(prepare.facts(settings))
        if count is None:
            count = self.guess(settings, prepare.expected(settings))
        return max(1, min(most, count))

    def state_path(self, settings, item):
        return settings.path('state', self.name, '%05d.json' % item)

    def state(self, settings, item):
        return read_json(self.state_path(settings, item), {})

    def is_done(self, settings, item):
        return (self.state(settings, item).get('state') == 'done' and
                all(os.path.exists(path)
                    for path in self.results(settings, item)))

    def is_complete(self, settings):
        count = self.count(prepare.facts(settings))
        return count is not None and all(self.is_done(settings, item)
                                         for item in range(count))


def database(settings, _):
    return [settings.path('database.db')]


def guess_match_blocks(settings, facts):
    return -(-facts['num_pairs'] // settings.pairs_per_block)


def guess_parts(settings, facts):
    given = re.search(r'AdaSfmPartition.max_part_size[ =](\d+)',
                      settings.mapper_options)
    size = int(given.group(1)) if given else costs.IMAGES_PER_PART
    return -(-facts['num_images'] // max(1, size)) + 1


ALL = [
    Stage('features', work.features,
          lambda settings, item: [settings.path('features', '%05d.db' % item)],
          lambda facts: facts['image_blocks'], is_wide=True),
    Stage('join_features', work.join_features, database),
    Stage('pairs', work.pairs,
          lambda settings, item: [prepare.block_path(settings, 'pairs', 0)],
          finds_sizes=True),
    Stage('matches', work.matches,
          lambda settings, item: [settings.path('matches', '%05d.db' % item)],
          lambda facts: facts.get('pair_blocks'), guess_match_blocks,
          is_wide=True),
    Stage('join_matches', work.join_matches, database, finds_sizes=True),
    Stage('priors', work.priors, database),
    Stage('global', work.global_stage,
          lambda settings, item: [settings.path('global', '0', 'images.bin')]),
    Stage('plan', work.plan,
          lambda settings, item: [settings.path('sparse', 'checkpoints',
                                                'plan.json')],
          finds_sizes=True),
    Stage('parts', work.parts,
          lambda settings, item: [settings.path('sparse', 'checkpoints',
                                                'part_%d' % item,
                                                'state.json')],
          lambda facts: facts.get('num_parts'), guess_parts, is_wide=True),
    Stage('merge', work.merge,
          lambda settings, item: [settings.path('sparse', '0', 'images.bin')]),
]


def of(settings):
    """The stages that this workspace has."""
    chosen = ALL
    if settings.database_path:
        chosen = [stage for stage in chosen if stage.name not in
                  ('features', 'join_features', 'pairs', 'matches',
                   'join_matches')]
    if not settings.sensors_path:
        chosen = [stage for stage in chosen if stage.name != 'priors']
    return chosen


def find(settings, name):
    return next(stage for stage in of(settings) if stage.name == name)
