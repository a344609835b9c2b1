# SPDX-License-Identifier: BSD-3-Clause
"""The user's options: read from the command line, kept in the workspace's
settings.json, and read from there by every task."""

import argparse
import json
import os
import shutil

FILE = 'settings.json'


class UserError(Exception):
    """A message of one line: what is wrong, and what to do."""


# Name, default, help. Options that change the result are fixed once a workspace
# has begun; each call may change the other options.
RESULT_OPTIONS = [
    ('--image_path', '', 'folder of the photos'),
    ('--database_path', '', 'in place of --image_path: a database with verified'
     ' matches, which is copied'),
    ('--sensors_path', '', 'folder with imu.csv, wheel.csv, times.csv and'
     ' sensors.yaml; without it there are no priors'),
    ('--camera_model', 'SIMPLE_RADIAL', "COLMAP's name, as PINHOLE"),
    ('--camera_params', '', 'its parameters [px]; empty: from EXIF'),
    ('--single_camera', 1, '1: one camera took all photos'),
    ('--max_num_features', 2048, 'features of a photo at most'),
    ('--images_per_block', 500, 'photos of a task of the features'),
    ('--pairs_per_block', 5000, 'pairs of a task of the matching'),
    ('--pair_options', '', 'more options of adasfm_pair_generator'),
    ('--global_options', '', 'more options of adasfm_global'),
    ('--mapper_options', '', 'more options of adasfm_mapper, as'
     ' "--AdaSfmPartition.max_part_size 400"'),
]
RUN_OPTIONS = [
    ('--threads', 8, 'cores of the tasks that are one per stage; 1: equal runs'
     ' give equal bytes'),
    ('--threads_per_task', 1, 'cores of a task of features, matching and parts'),
    ('--scratch_path', '', "folder on the node's own disk; empty: $TMPDIR or /tmp;"
     ' variables are those of the node'),
    ('--retries', 3, 'times that a task that fails goes back to the queue'),
    ('--max_tasks', 1000, "tasks of a job array at most (below Slurm's"
     ' MaxArraySize); a task does several blocks when there are more'),
    ('--max_running', 0, 'tasks of an array at the same time; 0: any number'),
    ('--memory_factor', 1.0, 'times the estimated memory is asked for'),
    ('--time_factor', 1.0, 'times the estimated time is asked for'),
    ('--sbatch_options', '', 'more options of sbatch, as "--partition=long'
     ' --account=me"'),
]
DEFAULTS = {name[2:]: default for name, default, _ in
            RESULT_OPTIONS + RUN_OPTIONS}
RESULT_NAMES = {name[2:] for name, _, _ in RESULT_OPTIONS}
POSITIVE = ('max_num_features', 'images_per_block', 'pairs_per_block',
            'threads', 'threads_per_task', 'max_tasks', 'memory_factor',
            'time_factor')


class Settings:
    """The options as attributes, and the workspace."""

    def __init__(self, workspace, values):
        self.workspace = workspace
        self.values = values

    def __getattr__(self, name):
        try:
            return self.__dict__['values'][name]
        except KeyError:
            raise AttributeError(name) from None

    def path(self, *parts):
        return os.path.join(self.workspace, *parts)

    def save(self):
        write_json(self.path(FILE), self.values)


def write_json(path, value):
    """Writes a file that is complete or not there."""
    os.makedirs(os.path.dirname(path), exist_ok=True)
    temporary = '%s.%s.%d.part' % (path, os.uname().nodename, os.getpid())
    with open(temporary, 'w', encoding='utf-8') as file:
        json.dump(value, file, indent=1, sort_keys=True)
        file.write('\n')
        file.flush()
        os.fsync(file.fileno())
    os.replace(temporary, path)


def read_json(path, default=None):
    try:
        with open(path, encoding='utf-8') as file:
            return json.load(file)
    except FileNotFoundError:
        return default
    except ValueError as error:
        raise UserError('%s is damaged (%s); remove it' % (path, error)) from error


def add_options(parser):
    for name, default, text in RESULT_OPTIONS + RUN_OPTIONS:
        shown = default if default != '' else 'none'
        parser.add_argument(name, type=type(default), metavar='X',
                            help=('%s (%s)' % (text, shown)).replace('%', '%%'))


def check(values):
    for name in POSITIVE:
        if not values[name] > 0:
            raise UserError('--%s must be positive' % name)
    for name in ('retries', 'max_running'):
        if values[name] < 0:
            raise UserError('--%s must not be negative' % name)
    if values['single_camera'] not in (0, 1):
        raise UserError('--single_camera must be 0 or 1')
    if bool(values['image_path']) == bool(values['database_path']):
        raise UserError('give either --image_path or --database_path')
    if values['image_path'] and not os.path.isdir(values['image_path']):
        raise UserError('--image_path %s is no folder' % values['image_path'])
    if values['database_path'] and not os.path.isfile(values['database_path']):
        raise UserError('--database_path %s is no file' % values['database_path'])
    if values['sensors_path']:
        for name in ('imu.csv', 'wheel.csv', 'times.csv', 'sensors.yaml'):
            if not os.path.isfile(os.path.join(values['sensors_path'], name)):
                raise UserError('--sensors_path %s has no %s' %
                                (values['sensors_path'], name))


def find_colmap():
    name = os.environ.get('COLMAP', 'colmap')
    path = shutil.which(name)
    if path is None:
        raise UserError('%s is no program; set the environment variable COLMAP'
                        ' to the colmap that has the adasfm_ commands' % name)
    return os.path.abspath(path)


def from_arguments(workspace, arguments):
    """The settings of a workspace, which this call may begin or change."""
    workspace = os.path.abspath(workspace)
    kept = read_json(os.path.join(workspace, FILE))
    values = {**DEFAULTS, **(kept or {})}
    for name in DEFAULTS:
        given = getattr(arguments, name)
        if given is None:
            continue
        if name.endswith('_path') and given and name != 'scratch_path':
            given = os.path.abspath(given)
        if kept and name in RESULT_NAMES and given != kept[name]:
            raise UserError('%s was begun with --%s %s; choose another'
                            ' workspace' % (workspace, name, kept[name] or 'none'))
        values[name] = given
    check(values)
    if kept is None or 'COLMAP' in os.environ:
        values['colmap'] = find_colmap()
    settings = Settings(workspace, values)
    try:
        settings.save()
    except OSError as error:
        raise UserError('cannot write to the workspace: %s' % error) from error
    return settings


def load(workspace):
    workspace = os.path.abspath(workspace)
    values = read_json(os.path.join(workspace, FILE))
    if values is None:
        raise UserError('%s is no workspace of adasfm_slurm.sh: it has no %s' %
                        (workspace, FILE))
    return Settings(workspace, values)
