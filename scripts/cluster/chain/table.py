# SPDX-License-Identifier: BSD-3-Clause
"""One table of progress."""

from chain import prepare, slurm, stages

HEADER = ('STAGE', 'JOB', 'ITEMS', 'DONE', 'RUNNING', 'WAITING', 'FAILED',
          'RETRIED', 'CPU_S', 'MAX_MB', 'NODES')


def row(settings, stage, queued, job):
    count = stage.count(prepare.facts(settings))
    states = [stage.state(settings, item) for item in range(count or 0)]
    done = [state for item, state in enumerate(states)
            if stage.is_done(settings, item)]
    nodes = sorted({state['node'] for state in states if 'node' in state})
    in_state = lambda *names: sum(task[2] in names for task in queued)
    retried = sum(max(0, state.get('attempts', 1) - 1) for state in states)
    return (stage.name, job, '?' if count is None else count, len(done),
            in_state('RUNNING', 'COMPLETING'), in_state('PENDING'),
            sum(state.get('state') == 'failed' for state in states), retried,
            '%.0f' % sum(state['cpu_seconds'] for state in done),
            max((state['memory_mb'] for state in done), default=0),
            ','.join(nodes[:4]) + (',...' if len(nodes) > 4 else ''))


def tasks_that_go_on(settings, queued):
    """The queued tasks, without those that wait for a job that has failed."""
    active = []
    for stage in stages.of(settings):
        tasks = [task for task in queued if task[0] == stage.name]
        if any(task[4] == 'DependencyNeverSatisfied' for task in tasks):
            break
        active += tasks
    return active


def verdict(settings, queued):
    """What to do next, in one line."""
    if all(stage.is_complete(settings) for stage in stages.of(settings)):
        return 'Finished: the model is ' + settings.path('sparse', '0')
    active = tasks_that_go_on(settings, queued)
    reasons = []
    for stage in stages.of(settings):
        for item in range(stage.count(prepare.facts(settings)) or 0):
            state = stage.state(settings, item)
            if state.get('state') == 'failed':
                reasons.append('%s %d failed: %s' %
                               (stage.name, item, state['reason']))
    if active:
        return '\n'.join(reasons[:3] + ['In the queue: %d tasks' % len(active)])
    return '\n'.join(reasons[:3] + ['Stopped: submit again (or run local) to'
                                    ' continue; logs are in ' +
                                    settings.path('logs')])


def show(settings):
    queued = slurm.tasks_in_queue(settings)
    jobs = slurm.jobs(settings)
    rows = [HEADER] + [
        tuple(map(str, row(settings, stage,
                           [task for task in queued if task[0] == stage.name],
                           jobs.get(stage.name, '-'))))
        for stage in stages.of(settings)]
    widths = [max(len(line[i]) for line in rows) for i in range(len(HEADER))]
    lines = ['  '.join(text.ljust(width) if i in (0, len(HEADER) - 1)
                       else text.rjust(width)
                       for i, (text, width) in enumerate(zip(line, widths)))
             for line in rows]
    # Printed at once, since a reader (grep -q) may stop at the line it looks for.
    print('\n'.join(lines + [verdict(settings, queued)]), flush=True)
    return 0
