# SPDX-License-Identifier: BSD-3-Clause
"""Rows of tables: run once per version, never mixed with other versions.

A ledger is a file of JSON lines, one for each row that was run: its key, its
parameters (spec), its records, and the stamp of our sources and the machine.
The last line of a key counts. A row with the current stamp and spec is not run
again; a table of rows with two stamps is an error.
"""

import datetime
import hashlib
import json
import os
import platform
import subprocess

# The sources that a figure can depend on.
PRODUCT = ('CMakeLists.txt', 'cmake', 'core', 'sensors', 'global', 'partition',
           'synthetic', 'colmap_ext', 'scripts/clean_database.sh',
           'scripts/drop_weak_joins.py', 'scripts/mapper_start.py')


class MixedVersions(Exception):
  """Rows of one table, or parts of a row, come from different sources or
  machines."""


def hash_sources(root):
  """Hash of names and contents of PRODUCT's files, tracked by git or not."""
  paths = []
  for name in PRODUCT:
    top = os.path.join(root, name)
    if os.path.isfile(top):
      paths.append(top)
    for folder, _, files in os.walk(top):
      paths += [os.path.join(folder, file) for file in files]
  digest = hashlib.sha256()
  for path in sorted(paths):
    with open(path, 'rb') as file:
      content = hashlib.sha256(file.read()).hexdigest()
    digest.update(('%s %s\n' % (os.path.relpath(path, root), content)).encode())
  return digest.hexdigest()[:16]


def commit_of(root):
  """The last commit that changed PRODUCT, with '+' if files differ from it."""
  def git(*arguments):
    result = subprocess.run(['git', '-C', root, *arguments, '--', *PRODUCT],
                            capture_output=True, text=True, check=False)
    return result.stdout.strip()
  try:
    commit = git('log', '-1', '--format=%h')
    return commit and commit + ('+' if git('status', '--porcelain') else '')
  except OSError:
    return ''


def describe_machine():
  model = platform.processor() or platform.machine()
  try:
    with open('/proc/cpuinfo') as file:
      model = next((line.split(':', 1)[1].strip() for line in file
                    if line.startswith('model name')), model)
  except OSError:
    pass
  return '%d cores, %s' % (os.cpu_count(), model)


def make_stamp(root):
  return {'sources': hash_sources(root), 'commit': commit_of(root),
          'machine': describe_machine()}


def _identity(stamp):
  return stamp['sources'], stamp['machine']


class Ledger:

  def __init__(self, path, stamp, root=None):
    """root: run() rejects a row if the sources there change while it runs."""
    self.path = path
    self.stamp = stamp
    self.root = root
    self.last = {}
    if os.path.exists(path):
      with open(path) as file:
        for line in file:
          try:
            entry = json.loads(line)
          except ValueError:
            continue  # the last line of a run that was cut short
          self.last[entry['key']] = entry

  def find(self, key, spec=None):
    """The records of a row that need not be run again, or None."""
    entry = self.last.get(key)
    if (entry and entry['spec'] == spec and
        _identity(entry['stamp']) == _identity(self.stamp)):
      return entry['records']
    return None

  def run(self, key, function, spec=None):
    """The row's records: stored ones, or function()'s, which are stored."""
    records = self.find(key, spec)
    if records is None:
      entry = {'key': key, 'spec': spec, 'stamp': self.stamp,
               'date': datetime.date.today().isoformat(),
               'load': round(os.getloadavg()[0], 1)}
      records = entry['records'] = function()
      if self.root and hash_sources(self.root) != self.stamp['sources']:
        raise MixedVersions('the sources changed while %s ran: run it again' %
                            key)
      line = json.dumps(entry) + '\n'
      if self._ends_within_a_line():
        line = '\n' + line
      with open(self.path, 'a') as file:
        file.write(line)
      self.last[key] = entry
    return records

  def _ends_within_a_line(self):
    if not os.path.exists(self.path) or os.path.getsize(self.path) == 0:
      return False
    with open(self.path, 'rb') as file:
      file.seek(-1, os.SEEK_END)
      return file.read() != b'\n'

  def current(self):
    """All rows of the current version and machine."""
    return [entry for entry in self.last.values()
            if _identity(entry['stamp']) == _identity(self.stamp)]

  def entries(self, keys):
    """The rows of a table, in order. Raises MixedVersions if they are of
    different versions or not run yet."""
    missing = [key for key in keys if key not in self.last]
    if missing:
      raise MixedVersions('%s: not run yet: %s' %
                          (self.path, ', '.join(missing)))
    entries = [self.last[key] for key in keys]
    kinds = {}
    for entry in entries:
      kinds.setdefault(_identity(entry['stamp']), []).append(entry['key'])
    if len(kinds) > 1:
      raise MixedVersions('%s: a table of different versions: %s' % (
          self.path, '; '.join('%s has %s' % (' on '.join(kind),
                                              ', '.join(keys_of))
                               for kind, keys_of in kinds.items())))
    return entries


def describe(entries):
  """A sentence for a table: where and when its rows were run."""
  dates = sorted({entry['date'] for entry in entries})
  loads = max(entry['load'] for entry in entries)
  return 'Run on %s, %s%s.' % (
      entries[0]['stamp']['machine'], ' to '.join(dates[:1] + dates[1:][-1:]),
      '' if loads < 1.5 * os.cpu_count() else
      ' (the machine was busy: only CPU times compare)')
