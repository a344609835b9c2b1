# SPDX-License-Identifier: BSD-3-Clause
"""Queues the stages as dependent job arrays, and reads their state."""

import os
import re
import shlex
import shutil
import subprocess
import sys

from chain import costs, stages
from chain.settings import UserError, read_json, write_json

# A task that fails goes back to the queue; Slurm itself requeues tasks whose node
# is lost or taken away.
SCRIPT = """#!/bin/bash
export PYTHONPATH={package} PYTHONDONTWRITEBYTECODE=1
{python} -m chain task {workspace} {stage} "$SLURM_ARRAY_TASK_ID" {num_tasks}
code=$?
if [ $code != 0 ] && [ "${{SLURM_RESTART_COUNT:-0}}" -lt {retries} ]; then
  scontrol requeue "${{SLURM_ARRAY_JOB_ID}}_$SLURM_ARRAY_TASK_ID" && sleep 60
fi
exit $code
"""


def call(*arguments, text=None):
    """The output of a command of Slurm; raises UserError with its message."""
    try:
        result = subprocess.run(arguments, input=text, text=True, check=False,
                                stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    except OSError as error:
        raise UserError('%s: %s' % (arguments[0], error)) from error
    if result.returncode != 0:
        message = result.stderr.strip().splitlines() or ['no message']
        raise UserError('%s: %s' % (arguments[0], message[-1]))
    return result.stdout


def check_is_there():
    if shutil.which('sbatch') is None:
        raise UserError('this machine has no Slurm (sbatch is missing); use'
                        ' `adasfm_slurm.sh local`, or a login node')


def jobs(settings):
    """{stage: job} of the stages that were queued."""
    return read_json(settings.path('jobs.json'), {})


def tasks_in_queue(settings):
    """(stage, task, state, node, reason) of the workspace's tasks."""
    stage_of_job = {job: name for name, job in jobs(settings).items()}
    if not stage_of_job or shutil.which('squeue') is None:
        return []
    found = []
    for line in call('squeue', '-h', '-r', '-o', '%F|%K|%T|%N|%r').splitlines():
        job, index, state, node, reason = line.split('|')
        if job in stage_of_job:
            found.append((stage_of_job[job], index, state, node, reason))
    return found


def largest_node_mb():
    sizes = [int(size) for size in
             re.findall(r'\d+', call('sinfo', '-h', '-N', '-o', '%m'))]
    return max(sizes, default=0) or sys.maxsize


def requested_memory_mb(settings, stage, largest):
    wanted = costs.memory_mb(stage, settings, stages.prepare.expected(settings))
    return min(largest, int(wanted * settings.memory_factor) + 1)


def array_text(settings, stage, num_tasks):
    """sbatch's --array: the tasks that have items left to make."""
    count = stage.count(stages.prepare.facts(settings))
    indices = range(num_tasks)
    if count is not None:
        indices = sorted({item % num_tasks for item in range(count)
                          if not stage.is_done(settings, item)})
    text = ','.join(map(str, indices))
    if len(indices) == num_tasks:
        text = '0-%d' % (num_tasks - 1)
    return text + ('%%%d' % settings.max_running if settings.max_running else '')


def submit_stage(settings, stage, after, most_tasks, largest):
    num_tasks = stage.num_tasks(settings, most_tasks)
    minutes = costs.minutes(stage, settings,
                            stages.prepare.expected(settings), num_tasks)
    script = SCRIPT.format(
        package=shlex.quote(os.path.dirname(os.path.dirname(
            os.path.abspath(__file__)))),
        python=shlex.quote(sys.executable), num_tasks=num_tasks,
        workspace=shlex.quote(settings.workspace), stage=stage.name,
        retries=settings.retries)
    arguments = ['sbatch', '--parsable', '--requeue', '--open-mode=append',
                 '--job-name=adasfm-' + stage.name,
                 '--chdir=' + settings.workspace,
                 '--output=' + settings.path('logs', 'slurm-%x-%a.log'),
                 '--array=' + array_text(settings, stage, num_tasks),
                 '--nodes=1', '--ntasks=1',
                 '--cpus-per-task=%d' % stage.cores(settings),
                 '--mem=%dM' % requested_memory_mb(settings, stage, largest),
                 '--time=%d' % (minutes * settings.time_factor + 1)]
    if after:
        arguments.append('--dependency=afterok:' + after)
    arguments += shlex.split(settings.sbatch_options)
    return call(*arguments, text=script).strip().split(';')[0]


def submit(settings):
    """Queues the remaining stages; tasks that wait already are queued anew."""
    queued = tasks_in_queue(settings)
    if any(state in ('RUNNING', 'COMPLETING') for _, _, state, _, _ in queued):
        raise UserError('tasks of this workspace are running; see'
                        ' `adasfm_slurm.sh status`, or cancel them first')
    if queued:
        cancel(settings)
    config = call('scontrol', 'show', 'config')
    array_size = re.search(r'MaxArraySize\s*=\s*(\d+)', config)
    most_tasks = min(settings.max_tasks,
                     int(array_size.group(1)) - 1 if array_size else 1000)
    largest = largest_node_mb()
    os.makedirs(settings.path('logs'), exist_ok=True)
    after, ids = None, {}
    for stage in stages.of(settings):
        if after is None and stage.is_complete(settings):
            continue
        after = submit_stage(settings, stage, after, most_tasks, largest)
        ids[stage.name] = after
        write_json(settings.path('jobs.json'), ids)
    if not ids:
        print('Nothing is left to do: the model is ' + settings.path('sparse', '0'))
    else:
        print('Queued: ' + ', '.join('%s %s' % item for item in ids.items()))
    return 0


def cancel(settings):
    ids = list(jobs(settings).values())
    if ids:
        subprocess.run(['scancel', '--quiet', *ids], check=False)
    return 0


def update_requests(settings, done):
    """Sets the memory of the jobs after the stage `done` to the new estimates.
    Slurm lets users lower the memory; if it refuses, the old estimate stays."""
    if 'SLURM_JOB_ID' not in os.environ:
        return
    largest = largest_node_mb()
    chain = stages.of(settings)
    for stage in chain[chain.index(done) + 1:]:
        job = jobs(settings).get(stage.name)
        if job is None:
            continue
        memory = requested_memory_mb(settings, stage, largest)
        try:
            call('scontrol', 'update', 'JobId=' + job,
                 'MinMemoryNode=%d' % memory)
            print('%s asks for %d MB' % (stage.name, memory))
        except UserError as error:
            # For a whole array scontrol reports success as an error.
            if 'No error' not in str(error):
                print('%s keeps what it asks for: %s' % (stage.name, error))
