# SPDX-License-Identifier: BSD-3-Clause
"""Our commands on tiny worlds, and their undisturbed results."""

import hashlib
import os
import resource
import shutil
import signal
import sqlite3
import subprocess
import threading
import time

NUM_IMAGES = '30'
# Far more than any command takes on such a world [s].
TIMEOUT_S = 120
# Commands on such a world need less than half of this [bytes].
MAX_ADDRESS_SPACE = 8 << 30
ONE_THREAD = ['--num_threads', '1']
# Limits so low that the world has several parts.
SMALL_PARTS = ['--AdaSfmPartition.max_num_images_undivided', '12',
               '--AdaSfmPartition.max_part_size', '16',
               '--AdaSfmPartition.min_part_size', '8']
DATABASE = ['--database_path', 'database.db']
# Command: (command whose result it starts from, arguments). The result of each
# command is kept in a folder named after the command.
CASES = {
    'adasfm_synthesizer': ('empty', [
        '--output_path', 'world', '--num_images', NUM_IMAGES,
        '--num_keypoints', '150', '--gnss_rate', '1', '--seed', '3']),
    'adasfm_prior_importer': ('adasfm_synthesizer', [
        *DATABASE, '--image_times_path', 'times.csv', '--imu_path', 'imu.csv',
        '--wheel_path', 'wheel.csv', '--sensors_path', 'sensors.yaml',
        '--gnss_path', 'gnss.csv']),
    'adasfm_global': ('adasfm_prior_importer', [
        *DATABASE, '--output_path', 'g', '--AdaSfmGlobal.num_threads', '1']),
    'adasfm_mapper': ('adasfm_global', [
        *DATABASE, *ONE_THREAD, *SMALL_PARTS, '--input_path', 'g/0',
        '--output_path', 'm']),
    'adasfm_evaluator': ('adasfm_mapper', [
        '--input_path', 'm/0', '--ground_truth_path', 'gt.txt', '--json_path',
        'evaluation.json']),
    'adasfm_reporter': ('adasfm_mapper', [
        '--input_path', 'm', '--coarse_path', 'g', *DATABASE, '--output_path',
        'report.html', '--ground_truth_path', 'gt.txt']),
    'adasfm_georeferencer': ('adasfm_mapper', [
        '--input_path', 'm/0', '--output_path', 'turned', '--frame', 'utm']),
    'adasfm_restorer': ('adasfm_global', DATABASE),
    'adasfm_database_merger': ('adasfm_prior_importer', [
        '--input_paths', 'database.db,other.db', '--prefixes', 'a/,b/',
        '--output_path', 'merged.db']),
    'adasfm_automatic_reconstructor': ('photos', [
        '--image_path', 'images', '--workspace_path', 'ws', *ONE_THREAD,
        '--camera_model', 'PINHOLE', '--camera_params', '192,192,160,100',
        '--image_times_path', 'times.csv', '--imu_path', 'imu.csv',
        '--wheel_path', 'wheel.csv', '--sensors_path', 'sensors.yaml',
        '--max_num_features', '500', '--num_similar_images', '4']),
    # Starts from the only database with descriptors.
    'adasfm_pair_generator': ('adasfm_automatic_reconstructor', [
        '--database_path', 'ws/database.db', *ONE_THREAD, '--output_path',
        'pairs.txt', '--image_times_path', 'times.csv']),
}
PHOTOS = ['--output_path', 'world', '--num_images', '10', '--render', '1',
          '--image_width', '320', '--image_height', '200', '--seed', '4']


class Wrong(Exception):
  """A command behaved as it must not."""


class Outcome:
  """How a process ended."""

  def __init__(self, code, error, max_rss_kb, command):
    self.code = code
    self.error = error
    self.max_rss_kb = max_rss_kb
    self.command = command

  def __str__(self):
    return '%s: exit code %d: %s' % (self.command, self.code,
                                     self.error.strip()[-400:])

  def require_success(self):
    if self.code != 0:
      raise Wrong(str(self))

  def require_answer(self):
    """True for exit code 0, False for 1 with an ERROR line; else Wrong."""
    if self.code == 0 or self.code == 1 and 'ERROR: ' in self.error:
      return self.code == 0
    raise Wrong(str(self))


class Process:
  def __init__(self, colmap, folder, command, arguments, environment=None,
               limits=()):
    def prepare():
      for name, value in ((resource.RLIMIT_AS, MAX_ADDRESS_SPACE),
                          (resource.RLIMIT_CORE, 0), *limits):
        resource.setrlimit(name, (value, value))
    self.command = command
    self.process = subprocess.Popen(
        [colmap, command, *arguments], cwd=folder, stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, preexec_fn=prepare,
        env=dict(os.environ, **(environment or {})), start_new_session=True)
    # A pipe, not a file: a limit of file sizes would cut its own error message.
    self.error = b''
    self.reader = threading.Thread(target=self.read_error)
    self.reader.start()

  def read_error(self):
    self.error = self.process.stderr.read()

  def wait(self, kill_after=None):
    """Waits for the end; kills the process after kill_after [s]. Without it, a
    process that runs longer than TIMEOUT_S is killed and raises Wrong."""
    deadline = time.monotonic() + (kill_after or TIMEOUT_S)
    pause = 0.002
    while True:
      pid, status, usage = os.wait4(self.process.pid, os.WNOHANG)
      if pid:
        break
      if time.monotonic() > deadline:
        os.killpg(self.process.pid, signal.SIGKILL)
        _, status, usage = os.wait4(self.process.pid, 0)
        if kill_after is None:
          raise Wrong('%s hangs' % self.command)
        break
      time.sleep(pause)
      pause = min(0.02, 1.5 * pause)
    code = os.waitstatus_to_exitcode(status)
    self.process.returncode = code  # for Popen, which did not wait itself
    self.reader.join()
    self.process.stderr.close()
    return Outcome(code, self.error.decode('utf8', 'replace'),
                   usage.ru_maxrss, self.command)


def digest(path):
  """Hash of a file's bytes, or of a database's tables and rows."""
  sha = hashlib.sha1()
  if path.endswith('.db'):
    database = sqlite3.connect('file:%s?mode=ro' % path, uri=True, timeout=10)
    try:
      for line in database.iterdump():
        sha.update(line.encode('utf8', 'surrogateescape'))
    except sqlite3.Error as error:
      return str(error)
    finally:
      database.close()
  else:
    with open(path, 'rb') as file:
      sha.update(file.read())
  return sha.hexdigest()


def digests(folder):
  """{path: digest} of all files except locks and SQLite's files beside a
  database. Of logs only the existence counts, since they contain durations and
  repeated work."""
  found = {}
  for parent, _, names in os.walk(folder):
    for name in names:
      path = os.path.join(parent, name)
      if name.startswith('.adasfm') or name.endswith(('-wal', '-shm',
                                                      '-journal')):
        continue
      found[os.path.relpath(path, folder)] = (
          'log' if name.endswith('.log') else digest(path))
  return found


class World:
  """Folders before and after each command; trials work on a copy."""

  def __init__(self, colmap, folder, commands=tuple(CASES)):
    self.colmap = colmap
    self.root = folder
    self.folder = os.path.join(folder, 'trial')
    self.seconds = {}
    self.max_rss_kb = {}
    self.expected = {}
    self.names = {}
    os.makedirs(self.state('empty'))
    needed = set(commands)
    for command in reversed(list(CASES)):
      if command in needed:
        needed.add(CASES[command][0])
    self.commands = [command for command in CASES if command in needed]
    if 'photos' in needed:
      self.make_photos()
    for command in self.commands:
      self.run_undisturbed(command)

  def state(self, name):
    return os.path.join(self.root, 'state_' + name)

  def make_photos(self):
    self.copy('empty')
    self.start('adasfm_synthesizer', PHOTOS).wait().require_success()
    world = os.path.join(self.folder, 'world')
    os.rename(world, self.state('photos'))

  def run_undisturbed(self, command):
    runs = []
    for _ in range(2):
      self.copy(CASES[command][0])
      started = time.monotonic()
      outcome = self.start(command).wait()
      outcome.require_success()
      self.seconds[command] = time.monotonic() - started
      self.max_rss_kb[command] = outcome.max_rss_kb
      runs.append(digests(self.folder))
    self.names[command] = set(runs[0])
    # Files with times of day or durations differ, and are not compared.
    self.expected[command] = {name: value for name, value in runs[0].items()
                              if runs[1].get(name) == value}
    source = self.folder
    if command == 'adasfm_synthesizer':
      # The next commands run in the folder of the world.
      source = os.path.join(self.folder, 'world')
      shutil.copy(os.path.join(source, 'database.db'),
                  os.path.join(source, 'other.db'))
    shutil.copytree(source, self.state(command))

  def copy(self, state):
    """Makes the trial's folder anew, as a copy of the result of a command."""
    shutil.rmtree(self.folder, ignore_errors=True)
    shutil.copytree(self.state(state), self.folder)

  def begin(self, command):
    """Makes the trial's folder anew, with the input of the command."""
    self.copy(CASES[command][0])

  def start(self, command, arguments=None, environment=None, limits=()):
    return Process(self.colmap, self.folder, command,
                   arguments or CASES[command][1], environment, limits)

  def check_model(self, command, folder):
    """Raises Wrong unless this model is the undisturbed one."""
    found = digests(os.path.join(self.folder, folder))
    for name, value in self.expected[command].items():
      if (os.path.dirname(name) == folder and
          found.get(os.path.basename(name)) != value):
        raise Wrong('%s: %s is not as undisturbed' % (command, name))

  def check(self, command):
    """Raises Wrong unless the trial's folder is as after the undisturbed
    command."""
    found = digests(self.folder)
    for name, value in self.expected[command].items():
      if name not in found:
        raise Wrong('%s: %s is missing' % (command, name))
      if found[name] != value:
        raise Wrong('%s: %s is not as undisturbed' % (command, name))
    strange = set(found) ^ self.names[command]
    if strange:
      raise Wrong('%s: other files than undisturbed: %s' %
                  (command, ' '.join(sorted(strange)[:5])))

  def check_after_rerun(self, command):
    """The same command, run again, must give the undisturbed result."""
    self.start(command).wait().require_success()
    self.check(command)
