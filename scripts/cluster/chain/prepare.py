# SPDX-License-Identifier: BSD-3-Clause
"""What is known before the first task: the photos in blocks, or the copy of a
database that has its matches."""

import os
import sqlite3

from chain import costs
from chain.settings import UserError, read_json, write_json

PHOTO_ENDINGS = ('.jpg', '.jpeg', '.png', '.bmp', '.ppm', '.pgm', '.tif',
                 '.tiff')


def facts(settings):
    """Facts that stages have written: numbers of images, blocks, parts."""
    known = {}
    folder = settings.path('facts')
    for name in sorted(os.listdir(folder)) if os.path.isdir(folder) else []:
        if name.endswith('.json'):
            known.update(read_json(os.path.join(folder, name)))
    return known


def write_facts(settings, stage, values):
    write_json(settings.path('facts', stage + '.json'), values)


def write_blocks(settings, kind, lines, size):
    """Cuts lines into files of `size` lines each; returns how many files."""
    os.makedirs(settings.path('blocks'), exist_ok=True)
    count = (len(lines) + size - 1) // size
    for i in range(count):
        path = block_path(settings, kind, i)
        with open(path + '.part', 'w', encoding='utf-8') as file:
            file.write('\n'.join(lines[i * size:(i + 1) * size]) + '\n')
        os.replace(path + '.part', path)
    return count


def block_path(settings, kind, index):
    return settings.path('blocks', '%s_%05d.txt' % (kind, index))


def find_photos(folder):
    names = []
    for path, _, files in os.walk(folder, followlinks=True):
        for file in files:
            if file.lower().endswith(PHOTO_ENDINGS):
                names.append(os.path.relpath(os.path.join(path, file), folder))
    return sorted(names)


def copy_database(source, target):
    """Copies a database in whatever state its last writer left it."""
    temporary = target + '.part'
    if os.path.exists(temporary):
        os.remove(temporary)
    try:
        with sqlite3.connect('file:%s?mode=ro' % source.replace('?', '%3f'),
                             uri=True) as old:
            if old.execute("SELECT 1 FROM sqlite_master WHERE name ="
                           " 'adasfm_two_view_geometries'").fetchone():
                raise UserError('adasfm_global has rewritten %s; put the'
                                ' originals back with adasfm_restorer' % source)
            new = sqlite3.connect(temporary)
            old.backup(new)
            new.execute('PRAGMA journal_mode = DELETE')
            new.close()
    except sqlite3.Error as error:
        raise UserError('cannot copy the database %s: %s' %
                        (source, error)) from error
    os.replace(temporary, target)


def count_database(path):
    """Facts of a database that has its matches."""
    try:
        with sqlite3.connect('file:%s?mode=ro' % path, uri=True) as database:
            number = lambda sql: database.execute(sql).fetchone()[0] or 0
            return {
                'num_images': number('SELECT COUNT(*) FROM images'),
                'num_keypoints': number('SELECT SUM(rows) FROM keypoints'),
                'num_verified_pairs':
                    number('SELECT COUNT(*) FROM two_view_geometries'
                           ' WHERE rows > 0'),
                'num_inlier_matches':
                    number('SELECT SUM(rows) FROM two_view_geometries')}
    except sqlite3.Error as error:
        raise UserError('%s is no database of COLMAP: %s' %
                        (path, error)) from error


def prepare(settings):
    """Makes the blocks or the database's copy, unless that is done already."""
    if os.path.exists(settings.path('facts', 'prepare.json')):
        return
    if settings.database_path:
        copy_database(settings.database_path, settings.path('database.db'))
        known = count_database(settings.path('database.db'))
    else:
        names = find_photos(settings.image_path)
        known = {'num_images': len(names),
                 'image_blocks': write_blocks(settings, 'images', names,
                                              settings.images_per_block)}
    if known['num_images'] < 2:
        raise UserError('%s has %d photos, but a model needs two' %
                        (settings.image_path or settings.database_path,
                         known['num_images']))
    write_facts(settings, 'prepare', known)


def expected(settings):
    """The facts, with upper estimates in place of those that are not known
    yet."""
    known = facts(settings)
    num_images = known['num_images']
    num_pairs = known.get('num_pairs', min(num_images * costs.PAIRS_PER_IMAGE,
                                           num_images * (num_images - 1) // 2))
    estimates = {
        'num_keypoints': num_images * settings.max_num_features,
        'num_pairs': num_pairs,
        'num_inlier_matches': num_pairs * costs.MATCHES_PER_PAIR}
    estimates.update(known)
    return estimates
