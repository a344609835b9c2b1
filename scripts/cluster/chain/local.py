# SPDX-License-Identifier: BSD-3-Clause
"""Runs the tasks on this machine, several at a time."""

import os
import subprocess
import sys
import time

from chain import stages, table
from chain.settings import UserError

SECONDS_BETWEEN_LOOKS = 0.05


def command(settings, stage, index, num_tasks):
    return [sys.executable, '-m', 'chain', 'task', settings.workspace,
            stage.name, str(index), str(num_tasks)]


def run_stage(settings, stage, num_jobs):
    """Makes the missing items; True if all items are there in the end."""
    count = stage.count(stages.prepare.facts(settings))
    waiting = [item for item in range(count)
               if not stage.is_done(settings, item)]
    os.makedirs(settings.path('logs'), exist_ok=True)
    running, failed, retries = {}, False, {}
    while running or (waiting and not failed):
        while waiting and len(running) < num_jobs and not failed:
            item = waiting.pop(0)
            with open(settings.path('logs', 'local.log'), 'ab') as log:
                running[item] = subprocess.Popen(
                    command(settings, stage, item, count), stdout=log,
                    stderr=log, stdin=subprocess.DEVNULL)
        time.sleep(SECONDS_BETWEEN_LOOKS)
        for item, process in list(running.items()):
            if process.poll() is None:
                continue
            del running[item]
            if process.returncode == 0:
                continue
            retries[item] = retries.get(item, 0) + 1
            if retries[item] <= settings.retries:
                waiting.append(item)
            else:
                failed = True
    return not failed and stage.is_complete(settings)


def run(settings, num_jobs):
    cores = os.cpu_count() or 1
    for stage in stages.of(settings):
        if stage.is_complete(settings):
            continue
        print('%s ...' % stage.name, flush=True)
        at_a_time = num_jobs or max(1, cores // stage.cores(settings))
        if not run_stage(settings, stage, at_a_time):
            table.show(settings)
            raise UserError('%s failed; the same command continues' % stage.name)
    return table.show(settings)
