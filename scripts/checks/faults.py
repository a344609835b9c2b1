#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Kills our commands, damages their files and takes their disk away, at random.

After a kill, a damaged checkpoint or a file size limit the same command again
must end in the undisturbed model, byte by byte. On a damaged database or coarse
model a command must end in time with exit code 0, or with 1 and an ERROR line.
Prints what went wrong with the seed of the trial, and a line of counts; fails
when anything did. Needs only Python's standard library.
"""

import argparse
import collections
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time

NUM_IMAGES = '60'
# Far more than any command takes on a world of that size [s].
TIMEOUT_S = 120
# Small parts, so that there are several; one thread, so that sums are repeatable.
MAPPER_OPTIONS = ['--num_threads', '1',
                  '--AdaSfmPartition.max_num_images_undivided', '20',
                  '--AdaSfmPartition.max_part_size', '25']


class Wrong(Exception):
  """A command did what it must not."""


class World:
  """A world and its undisturbed models; trials work on copies of it."""

  def __init__(self, colmap, folder):
    self.colmap = colmap
    self.source = os.path.join(folder, 'source')
    self.folder = os.path.join(folder, 'trial')
    self.check(self.run(['adasfm_synthesizer', '--output_path', self.source,
                         '--num_images', NUM_IMAGES], cwd=folder))
    self.copy()
    self.seconds = {}
    for command in self.chain():
      started = time.monotonic()
      self.check(self.run(command))
      self.seconds[command[0]] = time.monotonic() - started
    self.models = {name: self.read_model(name) for name in ('g/0', 'm/0')}
    self.done = os.path.join(folder, 'done')
    os.rename(self.folder, self.done)

  def copy(self, source=None):
    shutil.rmtree(self.folder, ignore_errors=True)
    shutil.copytree(source or self.source, self.folder)

  def chain(self):
    database = ['--database_path', 'database.db']
    return [
        ['adasfm_prior_importer', *database, '--image_times_path', 'times.csv',
         '--imu_path', 'imu.csv', '--wheel_path', 'wheel.csv',
         '--sensors_path', 'sensors.yaml'],
        ['adasfm_global', *database, '--output_path', 'g',
         '--AdaSfmGlobal.num_threads', '1'],
        ['adasfm_mapper', *database, '--input_path', 'g/0', '--output_path',
         'm', *MAPPER_OPTIONS]]

  def run(self, command, cwd=None, kill_after=None, limit_bytes=None):
    def prepare():
      if limit_bytes is not None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit_bytes, limit_bytes))
    process = subprocess.Popen(
        [self.colmap, *command], cwd=cwd or self.folder, text=True,
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, preexec_fn=prepare)
    try:
      _, error = process.communicate(timeout=kill_after or TIMEOUT_S)
    except subprocess.TimeoutExpired:
      process.kill()
      process.communicate()
      if kill_after is None:
        raise Wrong('%s hangs' % command[0]) from None
      return -signal.SIGKILL, ''
    return process.returncode, error

  @staticmethod
  def check(outcome):
    code, error = outcome
    if code != 0:
      raise Wrong('exit code %d: %s' % (code, error.strip()))

  @staticmethod
  def check_refusal(outcome):
    code, error = outcome
    if code == 0 or code == 1 and 'ERROR: ' in error:
      return code
    raise Wrong('exit code %d: %s' % (code, error.strip()[-300:]))

  def read_model(self, name):
    texts = []
    for file_name in ('cameras.bin', 'images.bin', 'points3D.bin'):
      with open(os.path.join(self.folder, name, file_name), 'rb') as file:
        texts.append(file.read())
    return texts

  def check_models(self):
    for name, expected in self.models.items():
      if self.read_model(name) != expected:
        raise Wrong('%s is not the undisturbed model' % name)


def damage(path, generator):
  """Empties, cuts, overwrites or lengthens a file; returns what it did."""
  size = os.path.getsize(path)
  what = generator.choice(['empty', 'cut', 'bytes', 'longer'])
  with open(path, 'r+b') as file:
    if what == 'empty':
      file.truncate(0)
    elif what == 'cut':
      file.truncate(generator.randrange(max(1, size)))
    elif what == 'longer':
      file.seek(0, os.SEEK_END)
      file.write(bytes(generator.randrange(256) for _ in range(50)))
    else:
      for _ in range(generator.choice([1, 10, 1000])):
        file.seek(generator.randrange(max(1, size)))
        file.write(bytes([generator.randrange(256)]))
  return '%s %s' % (what, path)


def try_kill(world, generator):
  """In each command of the chain, once."""
  world.copy()
  for command in world.chain():
    world.run(command, kill_after=generator.uniform(
        0.01, max(0.02, 1.1 * world.seconds[command[0]])))
    world.check(world.run(command))
  world.check_models()
  return 'kill'


def try_limit(world, generator):
  world.copy(world.done)
  shutil.rmtree(os.path.join(world.folder, 'm'))
  mapper = world.chain()[-1]
  world.check_refusal(world.run(
      mapper, limit_bytes=int(10 ** generator.uniform(2.5, 6))))
  world.check(world.run(mapper))
  world.check_models()
  return 'limit'


def try_checkpoint(world, generator):
  world.copy(world.done)
  files = [os.path.join(folder, name) for folder, _, names in
           os.walk(os.path.join(world.folder, 'm', 'checkpoints'))
           for name in names]
  what = damage(generator.choice(sorted(files)), generator)
  try:
    world.check(world.run(world.chain()[-1]))
    world.check_models()
  except Wrong as error:
    raise Wrong('%s: %s' % (what, error)) from None
  return 'checkpoint'


def try_input(world, generator):
  """A damaged database for any command, or coarse model for the mapper."""
  world.copy(world.done)
  shutil.rmtree(os.path.join(world.folder, 'm'))
  name = generator.choice(['database.db', 'database.db', 'g/0/cameras.bin',
                           'g/0/images.bin', 'g/0/points3D.bin'])
  what = damage(os.path.join(world.folder, name), generator)
  commands = world.chain()
  command = (generator.choice(commands) if name == 'database.db'
             else commands[-1])
  try:
    code = world.check_refusal(world.run(command))
  except Wrong as error:
    raise Wrong('%s: %s: %s' % (command[0], what, error)) from None
  return 'input %s' % ('refused' if code else 'used')


TRIALS = [try_kill, try_limit, try_checkpoint, try_checkpoint, try_input,
          try_input, try_input]


def main():
  parser = argparse.ArgumentParser(description=__doc__)
  parser.add_argument('colmap', help='our colmap')
  parser.add_argument('--seconds', type=float, default=45.0,
                      help='no trial begins later')
  parser.add_argument('--seed', type=int, default=1, help='of the first trial')
  args = parser.parse_args()
  counts = collections.Counter()
  started = time.monotonic()
  with tempfile.TemporaryDirectory(prefix='adasfm-faults-') as folder:
    world = World(os.path.abspath(args.colmap), folder)
    seed = args.seed
    while time.monotonic() - started < args.seconds:
      generator = random.Random(seed)
      try:
        counts[TRIALS[seed % len(TRIALS)](world, generator)] += 1
      except Wrong as error:
        counts['WRONG'] += 1
        print('seed %d: %s' % (seed, error), flush=True)
      seed += 1
  print('faults: ' + ', '.join('%s %d' % item
                               for item in sorted(counts.items())))
  return 1 if counts['WRONG'] else 0


if __name__ == '__main__':
  sys.exit(main())
