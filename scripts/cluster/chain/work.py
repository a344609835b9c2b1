# SPDX-License-Identifier: BSD-3-Clause
"""What each stage does for one of its items. A result is made in a folder of
the task's own and moved into place when it is complete, so that a task can be
killed and repeated at any time."""

import json
import os
import re
import shlex
import shutil
import sqlite3
import subprocess

from chain import costs, prepare


class TaskError(Exception):
    """Why an item could not be made, in one line."""


class Work:
    """One item: its folder, and the time and memory used so far."""

    def __init__(self, settings, stage, item, folder):
        self.settings = settings
        self.item = item
        self.folder = folder
        self.log_path = settings.path('logs', '%s-%05d.log' % (stage, item))
        self.cpu_seconds = 0.0
        self.max_memory_mb = 0.0

    def scratch(self, name):
        return os.path.join(self.folder, name)

    def run(self, command, *arguments, options=''):
        """Runs a command of COLMAP and returns what it printed."""
        line = [self.settings.colmap, command, *map(str, arguments),
                *shlex.split(options)]
        with open(self.log_path, 'a+', encoding='utf-8',
                  errors='replace') as log:
            log.write('$ %s\n' % shlex.join(line))
            log.flush()
            begin = log.tell()
            with subprocess.Popen(line, stdout=log, stderr=log,
                                  stdin=subprocess.DEVNULL) as process:
                _, status, usage = os.wait4(process.pid, 0)
                process.returncode = os.waitstatus_to_exitcode(status)
            log.seek(begin)
            text = log.read()
        self.cpu_seconds += usage.ru_utime + usage.ru_stime
        self.max_memory_mb = max(self.max_memory_mb, usage.ru_maxrss / 1024)
        if process.returncode != 0:
            lines = [part for part in text.splitlines() if part.strip()]
            errors = [part for part in lines if part.startswith('ERROR')]
            reason = 'killed by signal %d' % -process.returncode
            if process.returncode > 0:
                reason = (errors or lines or ['no message'])[-1]
            raise TaskError('%s: %s' % (command, reason))
        return text

    def put(self, name, *parts):
        """Moves a file of the scratch folder into the workspace."""
        target = self.settings.path(*parts)
        os.makedirs(os.path.dirname(target), exist_ok=True)
        # The same item on a lost node has a temporary file of another name.
        temporary = '%s.%s.%d.part' % (target, os.uname().nodename, os.getpid())
        shutil.copyfile(self.scratch(name), temporary)
        with open(temporary, 'rb') as file:
            os.fsync(file.fileno())
        os.replace(temporary, target)


def option_groups(work):
    """COLMAP 3.13 and later have some options in other groups."""
    text = subprocess.run([work.settings.colmap, 'feature_extractor', '-h'],
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                          check=False).stdout
    if b'FeatureExtraction.use_gpu' in text:
        return 'FeatureExtraction', 'FeatureMatching'
    return 'SiftExtraction', 'SiftMatching'


def features(work):
    settings = work.settings
    group, _ = option_groups(work)
    arguments = ['--database_path', work.scratch('shard.db'),
                 '--image_path', settings.image_path,
                 '--image_list_path',
                 prepare.block_path(settings, 'images', work.item),
                 '--ImageReader.single_camera', settings.single_camera,
                 '--ImageReader.camera_model', settings.camera_model,
                 '--SiftExtraction.max_num_features', settings.max_num_features,
                 '--%s.use_gpu' % group, 0,
                 '--%s.num_threads' % group, settings.threads_per_task]
    if settings.camera_params:
        arguments += ['--ImageReader.camera_params', settings.camera_params]
    work.run('feature_extractor', *arguments)
    put_database(work, 'features')


def put_database(work, folder, sql=''):
    """Moves the shard into the workspace without a write-ahead log, which
    network file systems do not have."""
    database = sqlite3.connect(work.scratch('shard.db'), isolation_level=None)
    try:
        database.execute('PRAGMA journal_mode = DELETE')
        if sql:
            database.executescript(sql)
    except sqlite3.Error as error:
        raise TaskError('writing %s: %s' % (work.scratch('shard.db'), error)) \
            from error
    finally:
        database.close()
    work.put('shard.db', folder, '%05d.db' % work.item)


def join(work, folder, count):
    paths = [work.settings.path(folder, '%05d.db' % i) for i in range(count)]
    missing = [path for path in paths if not os.path.exists(path)]
    if missing:
        raise TaskError('%s is missing; submit again to make it' % missing[0])
    with open(work.scratch('list'), 'w', encoding='utf-8') as file:
        file.write('\n'.join(paths) + '\n')
    work.run('adasfm_database_merger', '--input_list_path',
             work.scratch('list'), '--output_path',
             work.settings.path('database.db'))


def join_features(work):
    join(work, 'features', prepare.facts(work.settings)['image_blocks'])


def pairs(work):
    settings = work.settings
    arguments = ['--database_path', settings.path('database.db'),
                 '--output_path', work.scratch('pairs.txt'),
                 '--num_threads', settings.threads]
    if settings.sensors_path:
        arguments += ['--image_times_path',
                      os.path.join(settings.sensors_path, 'times.csv')]
    work.run('adasfm_pair_generator', *arguments, options=settings.pair_options)
    with open(work.scratch('pairs.txt'), encoding='utf-8') as file:
        lines = [line for line in file.read().splitlines() if line]
    if not lines:
        raise TaskError('no pairs to match; see %s' % work.log_path)
    count = prepare.write_blocks(settings, 'pairs', lines,
                                 settings.pairs_per_block)
    prepare.write_facts(settings, 'pairs',
                        {'pair_blocks': count, 'num_pairs': len(lines)})


# The rows of the whole database that a block of pairs needs. COLMAP 3.12 and
# later have rigs and frames.
SUBSET = """
INSERT INTO main.images SELECT * FROM whole.images WHERE name IN
  (SELECT name FROM temp.wanted) ORDER BY image_id;
{frames}
INSERT INTO main.cameras SELECT * FROM whole.cameras WHERE camera_id IN
  (SELECT camera_id FROM main.images {cameras});
INSERT INTO main.keypoints SELECT * FROM whole.keypoints WHERE image_id IN
  (SELECT image_id FROM main.images);
INSERT INTO main.descriptors SELECT * FROM whole.descriptors WHERE image_id IN
  (SELECT image_id FROM main.images);
"""
SUBSET_FRAMES = """
INSERT INTO main.frame_data SELECT * FROM whole.frame_data WHERE data_id IN
  (SELECT image_id FROM main.images);
INSERT INTO main.frames SELECT * FROM whole.frames WHERE frame_id IN
  (SELECT frame_id FROM main.frame_data);
INSERT INTO main.rigs SELECT * FROM whole.rigs WHERE rig_id IN
  (SELECT rig_id FROM main.frames);
INSERT INTO main.rig_sensors SELECT * FROM whole.rig_sensors WHERE rig_id IN
  (SELECT rig_id FROM main.rigs);
"""
SUBSET_CAMERAS = """UNION SELECT ref_sensor_id FROM main.rigs
  UNION SELECT sensor_id FROM main.rig_sensors"""


def cut_subset(source, target, names):
    """A database with the features of some images only."""
    uri = 'file:%s?immutable=1' % source.replace('?', '%3f')
    database = sqlite3.connect('file:' + target, uri=True, isolation_level=None)
    try:
        database.execute('ATTACH ? AS whole', (uri,))
        version = database.execute('PRAGMA whole.user_version').fetchone()[0]
        database.execute('BEGIN')
        for (sql,) in database.execute(
                "SELECT sql FROM whole.sqlite_master WHERE sql IS NOT NULL AND"
                " name NOT LIKE 'sqlite_%' AND tbl_name NOT LIKE 'adasfm_%'"
                " ORDER BY type DESC").fetchall():
            database.execute(sql)
        database.execute('CREATE TEMP TABLE wanted (name TEXT PRIMARY KEY)')
        database.executemany('INSERT INTO wanted VALUES (?)',
                             [(name,) for name in sorted(names)])
        has_frames = database.execute("SELECT 1 FROM whole.sqlite_master WHERE"
                                      " name = 'frames'").fetchone()
        script = SUBSET.format(frames=SUBSET_FRAMES if has_frames else '',
                               cameras=SUBSET_CAMERAS if has_frames else '')
        for statement in script.split(';'):
            database.execute(statement)
        database.execute('COMMIT')
        database.execute('PRAGMA user_version = %d' % version)
    except sqlite3.Error as error:
        raise TaskError('cutting %s out of %s: %s' % (target, source, error)) \
            from error
    finally:
        database.close()


def matches(work):
    settings = work.settings
    block = prepare.block_path(settings, 'pairs', work.item)
    with open(block, encoding='utf-8') as file:
        names = set(file.read().split())
    cut_subset(settings.path('database.db'), work.scratch('shard.db'), names)
    _, group = option_groups(work)
    work.run('matches_importer', '--database_path', work.scratch('shard.db'),
             '--match_list_path', block, '--match_type', 'pairs',
             '--%s.use_gpu' % group, 0,
             '--%s.num_threads' % group, settings.threads_per_task)
    put_database(work, 'matches', 'DELETE FROM keypoints;'
                 ' DELETE FROM descriptors; VACUUM')


def join_matches(work):
    join(work, 'matches', prepare.facts(work.settings)['pair_blocks'])
    prepare.write_facts(work.settings, 'join_matches', prepare.count_database(
        work.settings.path('database.db')))


def priors(work):
    sensors = work.settings.sensors_path
    arguments = ['--database_path', work.settings.path('database.db')]
    for option, name in (('image_times', 'times.csv'), ('imu', 'imu.csv'),
                         ('wheel', 'wheel.csv'), ('sensors', 'sensors.yaml')):
        arguments += ['--%s_path' % option, os.path.join(sensors, name)]
    work.run('adasfm_prior_importer', *arguments)


def memory_budget(settings, group, options):
    """Limits the adjustments of a large model to the memory that Slurm gives.
    Its MiB are passed on as MB, which are 5 % smaller; the difference remains
    for the task itself."""
    given_mb = float(os.environ.get('SLURM_MEM_PER_NODE', 0))
    if (given_mb < costs.whole_mb(prepare.expected(settings)) or
            'max_memory_gb' in options):
        return []
    return ['--%s.max_memory_gb' % group, '%.3f' % (given_mb / 1e3)]


def global_stage(work):
    settings = work.settings
    work.run('adasfm_global', '--database_path', settings.path('database.db'),
             '--output_path', settings.path('global'),
             '--AdaSfmGlobal.num_threads', settings.threads,
             *memory_budget(settings, 'AdaSfmGlobal', settings.global_options),
             options=settings.global_options)


def mapper(work, stage, threads, *more):
    settings = work.settings
    return work.run('adasfm_mapper', '--database_path',
                    settings.path('database.db'), '--input_path',
                    settings.path('global', '0'), '--output_path',
                    settings.path('sparse'), '--AdaSfmMapper.stage', stage,
                    '--num_threads', threads, *more,
                    options=settings.mapper_options)


def plan(work):
    text = mapper(work, 'plan', 1)
    # "4 parts, 2 at a time, up to 63 MB each".
    estimate = re.search(r'up to (\d+) MB each', text)
    if estimate is None:
        raise TaskError('adasfm_mapper did not say what memory the parts need;'
                        ' see ' + work.log_path)
    path = work.settings.path('sparse', 'checkpoints', 'plan.json')
    with open(path, encoding='utf-8') as file:
        num_parts = len(json.load(file)['parts'])
    prepare.write_facts(work.settings, 'plan',
                        {'num_parts': num_parts,
                         'part_memory_mb': int(estimate.group(1)),
                         'scene_memory_mb': round(work.max_memory_mb)})


def parts(work):
    mapper(work, 'part', work.settings.threads_per_task,
           '--AdaSfmMapper.part_index', work.item)


def merge(work):
    settings = work.settings
    mapper(work, 'merge', settings.threads,
           *memory_budget(settings, 'AdaSfmMapper', settings.mapper_options))
