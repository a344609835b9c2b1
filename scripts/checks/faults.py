#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Kills our commands, lets their calls fail, and damages their files.

Campaigns on a world of 30 images, in every command that writes:
  kills       kill -9 at a random time
  injections  a call for writing, fsync, rename, mmap, memory or a thread fails,
              or all from one on, as on a full disk (faulting/shim.c)
  limits      files may not grow beyond a size
  twice       the same command two times at once
  files       a database, model, checkpoint or log is damaged
After all but the last, the same command again must end with the undisturbed
result, byte by byte except for logs, times and SQLite's layout of databases. A
disturbed command ends in time with exit code 0 and the undisturbed result, or
with 1 and an ERROR line. On damaged files a command may end with any result,
except that damaged checkpoints must give the undisturbed model; it must not use
much more memory than usual.

Prints each error with the arguments that repeat it, and a line of counts per
campaign; fails after any error. Needs Python's standard library and a C
compiler.
"""

import argparse
import collections
import os
import random
import sys
import tempfile
import time

from faulting.shim import build_shim
from faulting.trials import (Injections, try_file, try_kill, try_limit,
                             try_two)
from faulting.world import CASES, World, Wrong

# Numbers of trials of a long run.
CAMPAIGNS = {'kills': 200, 'injections': 500, 'limits': 100, 'twice': 50,
             'files': 10000}


def parse_arguments():
  parser = argparse.ArgumentParser(
      description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
  parser.add_argument('colmap', help='our colmap')
  for name, count in CAMPAIGNS.items():
    parser.add_argument('--' + name, type=int, default=count, metavar='N',
                        help='trials, %d unless given' % count)
  parser.add_argument('--commands', nargs='+', default=list(CASES),
                      choices=list(CASES), metavar='COMMAND',
                      help='only these, and what makes their input')
  parser.add_argument('--seconds', type=float, default=float('inf'),
                      help='no trial begins later; all campaigns get their '
                      'share')
  parser.add_argument('--seed', type=int, default=1)
  parser.add_argument('--journal', metavar='FILE',
                      help='writes each trial there, a line each, and counts '
                      'those that are there in place of running them again')
  parser.add_argument('--replay', metavar='CAMPAIGN:NUMBER',
                      help='this trial alone')
  parser.add_argument('--folder', help='keep worlds and the last trial there')
  return parser.parse_args()


class Runner:
  def __init__(self, args, folder):
    self.args = args
    self.world = World(os.path.abspath(args.colmap), folder, args.commands)
    self.functions = {'kills': try_kill,
                      'injections': Injections(build_shim(folder)),
                      'limits': try_limit, 'twice': try_two, 'files': try_file}
    self.counts = {name: collections.Counter() for name in CAMPAIGNS}
    self.journal = self.read_journal()

  def read_journal(self):
    """Outcome of each trial of this seed that was run before."""
    if not self.args.journal or not os.path.exists(self.args.journal):
      return {}
    with open(self.args.journal) as file:
      rows = [line.rstrip('\n').split('\t') for line in file
              if line.endswith('\n')]
    return {(campaign, int(number)): outcome
            for seed, campaign, number, outcome in rows
            if int(seed) == self.args.seed}

  def write_journal(self, campaign, number, outcome):
    if self.args.journal:
      with open(self.args.journal, 'a') as file:
        file.write('%d\t%s\t%d\t%s\n' % (self.args.seed, campaign, number,
                                         outcome))

  def run(self, campaign, number):
    if (campaign, number) in self.journal:
      self.counts[campaign][self.journal[campaign, number]] += 1
      return
    generator = random.Random('%d %s %d' % (self.args.seed, campaign, number))
    try:
      outcome = self.functions[campaign](self.world, generator, number)
    except Wrong as error:
      outcome = 'WRONG'
      print('--seed %d --replay %s:%d: %s' % (self.args.seed, campaign, number,
                                              error), flush=True)
    self.counts[campaign][outcome] += 1
    self.write_journal(campaign, number, outcome)

  def run_all(self):
    """Runs next the campaign with the smallest share of its trials done."""
    started = time.monotonic()
    wanted = {name: getattr(self.args, name) for name in CAMPAIGNS
              if getattr(self.args, name) > 0}
    done = dict.fromkeys(wanted, 0)
    while time.monotonic() - started < self.args.seconds:
      campaign = min(wanted, key=lambda name: (done[name] / wanted[name]))
      if done[campaign] >= wanted[campaign]:
        break
      self.run(campaign, done[campaign])
      done[campaign] += 1

  def report(self):
    for campaign, outcomes in self.counts.items():
      if outcomes:
        print('%s: %d trials: %s' % (campaign, sum(outcomes.values()), ', '.join(
            '%s %d' % item for item in sorted(outcomes.items()))))
    return any(outcomes['WRONG'] for outcomes in self.counts.values())


def main():
  args = parse_arguments()
  with tempfile.TemporaryDirectory(prefix='adasfm-faults-') as temporary:
    folder = temporary
    if args.folder:
      folder = os.path.abspath(args.folder)
      os.makedirs(folder)
    runner = Runner(args, folder)
    if args.replay:
      campaign, number = args.replay.split(':')
      runner.run(campaign, int(number))
    else:
      runner.run_all()
    return 1 if runner.report() else 0


if __name__ == '__main__':
  sys.exit(main())
