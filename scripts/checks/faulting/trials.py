# SPDX-License-Identifier: BSD-3-Clause
"""One trial of each campaign: returns the outcome to count, or raises Wrong."""

import errno
import glob
import os
import resource

from faulting.mutator import damage
from faulting.world import CASES, Wrong

COMMANDS = list(CASES)
# On a damaged file a command may use three times the memory of the undisturbed
# command plus this [kB].
MEMORY_MARGIN_KB = 300000

# A kind of call, the errors that it fails with, and whether all later calls
# fail, too.
FAULTS = [
    ('write', [errno.ENOSPC, errno.EIO], ''),
    ('write', [errno.ENOSPC, errno.EDQUOT], ':keep'),
    ('fsync', [errno.EIO], ''),
    ('fsync', [errno.EIO], ':keep'),
    ('rename', [errno.EACCES, errno.ENOSPC], ''),
    ('rename', [errno.EACCES], ':keep'),
    ('mmap', [errno.ENOMEM], ''),
    ('memory', [errno.ENOMEM], ''),
    ('memory', [errno.ENOMEM], ':keep'),
    ('thread', [errno.EAGAIN], ':keep'),
]

# Damaged files: command; command whose result folder it starts in (None: as in
# CASES); patterns of files; weight.
RESUMED = 'adasfm_mapper'
INPUTS = [
    ('adasfm_prior_importer', None, ['imu.csv', 'wheel.csv', 'gnss.csv',
                                     'times.csv', 'sensors.yaml'], 4),
    ('adasfm_prior_importer', None, ['database.db'], 2),
    ('adasfm_prior_importer', 'adasfm_global', ['database.db'], 1),
    ('adasfm_pair_generator', None, ['ws/database.db', 'times.csv'], 2),
    ('adasfm_global', None, ['database.db'], 3),
    ('adasfm_mapper', None, ['database.db'], 1),
    ('adasfm_mapper', None, ['g/0/*.bin', 'g/summary.json'], 2),
    ('adasfm_mapper', RESUMED, ['m/checkpoints/*', 'm/checkpoints/*/*'], 3),
    ('adasfm_evaluator', None, ['m/0/*.bin', 'gt.txt'], 2),
    ('adasfm_reporter', None, ['m/0/*.bin', 'm/summary.json', 'g/summary.json',
                               'g/0/*.bin', 'database.db', 'gt.txt'], 3),
    ('adasfm_georeferencer', None, ['m/0/*.bin'], 1),
    ('adasfm_restorer', None, ['database.db'], 1),
    ('adasfm_database_merger', None, ['database.db', 'other.db'], 2),
]
WEIGHTED_INPUTS = [row[:3] for row in INPUTS for _ in range(row[3])]


def pick(commands, world, number):
  usable = [command for command in commands if command in world.commands]
  return usable[number % len(usable)]


def try_kill(world, generator, number):
  """kill -9 at a random time; then the command must end as undisturbed."""
  command = pick(COMMANDS, world, number)
  seconds = world.seconds[command]
  for _ in range(20):
    world.begin(command)
    outcome = world.start(command).wait(
        kill_after=generator.uniform(0.002, max(0.02, seconds)))
    if outcome.code < 0:
      break
    # The command ended before it was killed.
    outcome.require_success()
    seconds *= 0.7
  else:
    raise Wrong('%s cannot be killed' % command)
  world.check_after_rerun(command)
  return 'killed'


def count_calls(world, shim, command):
  """{kind: number of calls} of the undisturbed command."""
  world.begin(command)
  path = os.path.join(world.root, 'counts')
  world.start(command, environment={
      'LD_PRELOAD': shim, 'ADASFM_FAULT_COUNTS': path}).wait().require_success()
  with open(path) as file:
    return {kind: int(count) for kind, count in map(str.split, file)}


def with_threads(arguments):
  return [('4' if arguments[i - 1].endswith('num_threads') else argument)
          for i, argument in enumerate(arguments)]


def inject(world, shim, command, fault):
  """Runs the command with the fault, then without; returns the 1st Outcome."""
  arguments = CASES[command][1]
  if fault.startswith('thread'):
    arguments = with_threads(arguments)
  world.begin(command)
  try:
    outcome = world.start(command, arguments, {
        'LD_PRELOAD': shim, 'ADASFM_FAULT': fault}).wait()
    if outcome.require_answer():
      world.check(command)
    world.check_after_rerun(command)
  except Wrong as error:
    raise Wrong('ADASFM_FAULT=%s: %s' % (fault, error)) from None
  return outcome


class Injections:
  """Lets one random call of a command fail, or all calls from that one on."""

  def __init__(self, shim):
    self.shim = shim
    self.counts = {}

  def __call__(self, world, generator, number):
    command = pick(COMMANDS, world, number)
    if command not in self.counts:
      self.counts[command] = count_calls(world, self.shim, command)
    kind, errors, keep = FAULTS[number // len(world.commands) % len(FAULTS)]
    num_calls = self.counts[command][kind]
    if kind == 'thread':
      num_calls = 3
    if num_calls == 0:
      # The command makes no such call, so a kind that it makes is taken.
      kind, errors, keep = FAULTS[generator.choice([0, 1, 7, 8])]
      num_calls = self.counts[command][kind]
    fault = '%s:%d:%d%s' % (kind, generator.randint(1, max(1, num_calls)),
                            generator.choice(errors), keep)
    outcome = inject(world, self.shim, command, fault)
    return '%s%s %s' % (kind, ' from then on' if keep else '',
                        'survived' if outcome.code == 0 else 'refused')


def try_limit(world, generator, number):
  """Runs the command with a limit of file sizes, then without."""
  command = pick(COMMANDS, world, number)
  limit = int(10 ** generator.uniform(1.5, 6.5))
  world.begin(command)
  try:
    outcome = world.start(command, limits=[(resource.RLIMIT_FSIZE,
                                            limit)]).wait()
    if outcome.require_answer():
      world.check(command)
    world.check_after_rerun(command)
  except Wrong as error:
    raise Wrong('file size limit %d: %s' % (limit, error)) from None
  return 'fits' if outcome.code == 0 else 'refused'


def try_two(world, generator, number):
  """The same command twice at once: at least one ends as if it were alone."""
  command = pick(COMMANDS, world, number)
  world.begin(command)
  first = world.start(command)
  second = world.start(command)
  done = [process.wait() for process in (first, second)]
  answers = [outcome.require_answer() for outcome in done]
  if not any(answers):
    raise Wrong('both failed: %s; %s' % (done[0], done[1]))
  if not all(answers):
    # The process that failed must not have changed the other one's result.
    world.check(command)
  world.check_after_rerun(command)
  return 'both' if all(answers) else 'one'


def try_file(world, generator, number):
  """The command on a damaged file ends with a result or an ERROR line, within
  limits of time and memory."""
  rows = [row for row in WEIGHTED_INPUTS if row[0] in world.commands]
  command, state, patterns = rows[number % len(rows)]
  world.copy(state or CASES[command][0])
  if state is None or state == RESUMED:
    paths = [path for pattern in patterns for path in sorted(
        glob.glob(os.path.join(world.folder, pattern))) if os.path.isfile(path)]
  else:
    paths = [os.path.join(world.folder, pattern) for pattern in patterns]
  path = generator.choice(paths)
  what = '%s: %s' % (os.path.relpath(path, world.folder),
                     damage(path, generator))
  try:
    outcome = world.start(command).wait()
    if state == RESUMED:
      # The model counts; checkpoints may differ.
      outcome.require_success()
      world.check_model(command, 'm/0')
    used = outcome.require_answer()
    limit_kb = 3 * world.max_rss_kb[command] + MEMORY_MARGIN_KB
    if outcome.max_rss_kb > limit_kb:
      raise Wrong('%s took %d kB' % (command, outcome.max_rss_kb))
  except Wrong as error:
    raise Wrong('%s: %s' % (what, error)) from None
  return 'made again' if state == RESUMED else 'used' if used else 'refused'
