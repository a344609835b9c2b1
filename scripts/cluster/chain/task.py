# SPDX-License-Identifier: BSD-3-Clause
"""What one job, or one task of a job array, runs."""

import hashlib
import os
import shutil
import sys
import time

from chain import slurm, stages
from chain.settings import UserError, write_json
from chain.work import TaskError, Work


def folders(settings, stage, item):
    """Folders to make an item in: on the node's own disk and, if that fails (a
    full disk, say), in the workspace."""
    workspace = hashlib.sha256(settings.workspace.encode()).hexdigest()[:8]
    name = 'adasfm-%s-%s-%05d' % (workspace, stage.name, item)
    scratch = os.path.expandvars(settings.scratch_path) or \
        os.environ.get('TMPDIR') or '/tmp'
    return [os.path.join(scratch, name), settings.path('tmp', name)]


def run_in(folder, settings, stage, item):
    """Makes an item; returns its time and memory."""
    shutil.rmtree(folder, ignore_errors=True)
    try:
        os.makedirs(folder)
        work = Work(settings, stage.name, item, folder)
        os.makedirs(settings.path('logs'), exist_ok=True)
        begin = time.monotonic()
        stage.run(work)
    except OSError as error:
        raise TaskError(str(error)) from error
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    for path in stage.results(settings, item):
        if not os.path.exists(path):
            raise TaskError('%s was not written' % path)
    return {'seconds': round(time.monotonic() - begin, 1),
            'cpu_seconds': round(work.cpu_seconds, 1),
            'memory_mb': round(work.max_memory_mb)}


def run_item(settings, stage, item):
    attempts = stage.state(settings, item).get('attempts', 0)
    state = {'node': os.environ.get('SLURMD_NODENAME', os.uname().nodename)}
    for folder in folders(settings, stage, item):
        attempts += 1
        state.update(state='running', attempts=attempts)
        write_json(stage.state_path(settings, item), state)
        try:
            state.update(run_in(folder, settings, stage, item), state='done')
            state.pop('reason', None)
            write_json(stage.state_path(settings, item), state)
            return True
        except TaskError as error:
            state.update(state='failed', reason=str(error))
            write_json(stage.state_path(settings, item), state)
            print('%s %d failed in %s: %s' % (stage.name, item, folder, error),
                  file=sys.stderr, flush=True)
    return False


def run(settings, stage_name, index, num_tasks):
    """Makes the items index, index + num_tasks, ... of a stage that are not
    there yet."""
    stage = stages.find(settings, stage_name)
    count = stage.count(stages.prepare.facts(settings))
    if count is None:
        raise UserError('%s: the stage before has not finished' % stage_name)
    for item in range(index, count, num_tasks):
        if stage.is_done(settings, item):
            continue
        if not run_item(settings, stage, item):
            return 1
    if stage.finds_sizes:
        slurm.update_requests(settings, stage)
    return 0
