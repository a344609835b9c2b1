# SPDX-License-Identifier: BSD-3-Clause
"""Runs a command and measures it."""

import os
import signal
import subprocess
import threading
import time
from collections import namedtuple

Usage = namedtuple('Usage', 'seconds cpu_seconds peak_mib')


class Failed(Exception):
  """A command that did not end well; its output is in the log."""

  def __init__(self, message, usage):
    super().__init__(message)
    self.usage = usage


def run(arguments, log_path, timeout=None, environment=None):
  """Runs a command, with additional environment variables; returns its Usage.
  Raises Failed for an exit code other than 0 and after the timeout [s]."""
  started = time.monotonic()
  with open(log_path, 'ab') as log:
    log.write(('$ ' + ' '.join(arguments) + '\n').encode())
    log.flush()
    process = subprocess.Popen(arguments, stdout=log, stderr=log,
                               stdin=subprocess.DEVNULL,
                               env=dict(os.environ, **(environment or {})))
    # wait4 gives this child's own peak memory, but has no timeout.
    killed = threading.Event()

    def kill():
      killed.set()
      os.kill(process.pid, signal.SIGKILL)

    timer = threading.Timer(timeout, kill) if timeout else None
    if timer:
      timer.start()
    _, status, usage = os.wait4(process.pid, 0)
    if timer:
      timer.cancel()
  process.returncode = os.waitstatus_to_exitcode(status)
  usage = Usage(time.monotonic() - started, usage.ru_utime + usage.ru_stime,
                usage.ru_maxrss / 1024)
  if killed.is_set():
    raise Failed('%s took more than %g s' % (arguments[1], timeout), usage)
  if process.returncode != 0:
    # Tables and figures keep the message, so it omits the log's path.
    raise Failed('%s ended with %d' % (arguments[1], process.returncode), usage)
  return usage
