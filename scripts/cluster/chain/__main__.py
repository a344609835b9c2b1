# SPDX-License-Identifier: BSD-3-Clause
"""The commands of adasfm_slurm.sh."""

import argparse
import os
import sys

from chain import local, prepare, settings, slurm, table, task


def main():
    parser = argparse.ArgumentParser(
        prog='adasfm_slurm.sh', formatter_class=argparse.RawTextHelpFormatter,
        description='The whole chain on a cluster with Slurm, or without it.')
    commands = parser.add_subparsers(dest='command', required=True)
    for name, text in (('submit', 'queues all that is left to do'),
                       ('local', 'runs the same tasks on this machine'),
                       ('status', 'one table of progress'),
                       ('cancel', 'takes the jobs back'),
                       ('task', 'what a job runs')):
        command = commands.add_parser(name, help=text)
        command.add_argument('workspace')
        if name in ('submit', 'local'):
            settings.add_options(command)
        if name == 'local':
            command.add_argument('--jobs', type=int, default=0, metavar='X',
                                 help='tasks at a time; 0: as many as cores')
        if name == 'task':
            command.add_argument('stage')
            command.add_argument('index', type=int)
            command.add_argument('num_tasks', type=int)
    arguments = parser.parse_args()
    try:
        return run(arguments)
    except settings.UserError as error:
        print('ERROR: %s' % error, file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print('ERROR: interrupted; the same command continues', file=sys.stderr)
        return 130


def run(arguments):
    if arguments.command in ('submit', 'local'):
        if arguments.command == 'submit':
            slurm.check_is_there()
        chosen = settings.from_arguments(arguments.workspace, arguments)
        try:
            prepare.prepare(chosen)
        except settings.UserError:
            # Nothing has begun, so the next call may have other options.
            os.remove(chosen.path(settings.FILE))
            raise
        if arguments.command == 'submit':
            return slurm.submit(chosen)
        return local.run(chosen, arguments.jobs)
    chosen = settings.load(arguments.workspace)
    if arguments.command == 'status':
        return table.show(chosen)
    if arguments.command == 'cancel':
        return slurm.cancel(chosen)
    return task.run(chosen, arguments.stage, arguments.index,
                    arguments.num_tasks)


sys.exit(main())
