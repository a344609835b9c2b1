# SPDX-License-Identifier: BSD-3-Clause
"""Cuts a drive into several, each with its own database, logs and camera, and
merges their databases."""

import os
import shutil
import sqlite3

from benchmarking.methods import log_options
from benchmarking.process import run
from benchmarking.spoil import edit_rows, shift_clocks

# The logs of a drive go on beyond its images by this [s].
MARGIN_S = 1.0
LOGS = ('imu.csv', 'wheel.csv')
MAX_NUM_IMAGES = 2147483647  # of COLMAP's pair ids


def read_times(source):
  """[(time [ns], name)] of a drive's images."""
  with open(os.path.join(source, 'times.csv')) as file:
    rows = [line.split(',') for line in file.read().splitlines()[1:] if line]
  return [(int(time), name) for time, name in rows]


def cut(names, num_drives):
  """The images of drives that begin where the last one ended."""
  bounds = [round(k * len(names) / num_drives) for k in range(num_drives + 1)]
  return [names[a:b] for a, b in zip(bounds, bounds[1:])]


def copy_logs(source, folder, names):
  """Makes a drive's folder: times of these images, the logs from its first to
  its last image, calibration. A drive that begins with the source has all logs
  before, too."""
  os.makedirs(folder)
  for name in ('times.csv', 'sensors.yaml') + LOGS:
    shutil.copy(os.path.join(source, name), folder)
  times = read_times(source)
  mine = [time for time, name in times if name in set(names)]
  begin_ns = mine[0] - MARGIN_S * 1e9 if mine[0] > times[0][0] else 0
  end_ns = mine[-1] + MARGIN_S * 1e9
  edit_rows(folder, 'times.csv', lambda rows: [
      row for row in rows if row[1] in set(names)])
  for name in LOGS:
    edit_rows(folder, name, lambda rows: [
        row for row in rows if begin_ns <= int(row[0]) <= end_ns])


def begin_together(folders):
  """Shifts the clock of each drive, so that all begin with the first."""
  begins = [read_times(folder)[0][0] for folder in folders]
  for folder, begin_ns in zip(folders, begins):
    shift_clocks(folder, ('times.csv',) + LOGS, (begins[0] - begin_ns) / 1e6)


def delete_pairs(connection, is_kept):
  """Deletes the pairs for which is_kept(image id, image id) is false."""
  for table in ('matches', 'two_view_geometries'):
    pairs = connection.execute('SELECT pair_id FROM ' + table).fetchall()
    connection.executemany(
        'DELETE FROM %s WHERE pair_id = ?' % table,
        [pair for pair in pairs if not is_kept(*divmod(pair[0],
                                                       MAX_NUM_IMAGES))])


def keep_images(database, names):
  """Deletes all other images of a database."""
  connection = sqlite3.connect(database)
  ids = dict(connection.execute('SELECT name, image_id FROM images'))
  kept = {ids[name] for name in names}
  others = [(image_id,) for image_id in ids.values() if image_id not in kept]
  for table in ('images', 'keypoints', 'descriptors'):
    connection.executemany('DELETE FROM %s WHERE image_id = ?' % table, others)
  delete_pairs(connection, lambda id1, id2: id1 in kept and id2 in kept)
  connection.commit()
  connection.close()


def drive_of(name):
  return name.split('/')[0]


def count_pairs_between(database):
  """Verified pairs of images of two drives."""
  connection = sqlite3.connect(database)
  drives = {image_id: drive_of(name) for image_id, name in connection.execute(
      'SELECT image_id, name FROM images')}
  pairs = connection.execute(
      'SELECT pair_id FROM two_view_geometries WHERE rows > 0').fetchall()
  connection.close()
  return sum(len({drives[i] for i in divmod(pair, MAX_NUM_IMAGES)}) > 1
             for pair, in pairs)


def keep_pairs_between(database, drives):
  """Keeps the pairs between drives, {prefix: names}; names get the prefixes,
  and each drive its own copy of the camera."""
  connection = sqlite3.connect(database)
  (camera_id, *camera), = connection.execute('SELECT * FROM cameras').fetchall()
  for prefix, names in drives.items():
    camera_id = connection.execute(
        'INSERT INTO cameras VALUES (NULL%s)' % (', ?' * len(camera)),
        camera).lastrowid
    connection.executemany(
        'UPDATE images SET name = ?, camera_id = ? WHERE name = ?',
        [(prefix + name, camera_id, name) for name in names])
  connection.execute('DELETE FROM cameras WHERE camera_id NOT IN '
                     '(SELECT camera_id FROM images)')
  ids = {image_id: drive_of(name) for image_id, name in connection.execute(
      'SELECT image_id, name FROM images')}
  delete_pairs(connection, lambda id1, id2: ids[id1] != ids[id2])
  connection.commit()
  connection.close()


def write_true_poses(source, drives, path):
  """gt.txt of drives {prefix: names}, whose images have the prefixes."""
  prefixes = {name: prefix for prefix, names in drives.items()
              for name in names}
  with open(os.path.join(source, 'gt.txt')) as file:
    lines = [line for line in file if line.split()[0] in prefixes]
  with open(path, 'w') as file:
    file.writelines(prefixes[line.split()[0]] + line for line in lines)


def import_logs(folders, args, log_path):
  for folder in folders:
    run([args.colmap, 'adasfm_prior_importer', '--database_path',
         os.path.join(folder, 'database.db')] + log_options(folder), log_path)


def merge(databases, output, args, log_path):
  """Merges databases {prefix: path} into a database, which may exist."""
  run([args.colmap, 'adasfm_database_merger', '--input_paths',
       ','.join(databases.values()), '--prefixes', ','.join(databases),
       '--output_path', output], log_path)
