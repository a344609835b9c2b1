# SPDX-License-Identifier: BSD-3-Clause
"""The small drive that check_docs.py runs the documentation's commands on."""
import os
import re
import sqlite3
import struct
import subprocess
import sys

from benchmarking.host_options import feature_groups
from docs_bag import write_drive_bag
from pair_recall import MAX_NUM_IMAGES

# The drive's last images lie in a bend: on a straight road COLMAP's own mapper
# finds no pair to begin with.
NUM_IMAGES = 12
NUM_RENDERED = 40
SEED = 2


def call(colmap, folder, *arguments):
    result = subprocess.run([os.path.abspath(colmap), *arguments], cwd=folder, check=False,
                            capture_output=True, text=True)
    if result.returncode != 0:
        sys.exit(result.stdout + result.stderr)


def make_drive(colmap, folder):
    """Photos, logs and calibration under the names of the documentation, and
    stand-ins for outputs of learned models; returns the camera's parameters."""
    call(colmap, folder, 'adasfm_synthesizer', '--output_path', '.',
         '--num_images', str(NUM_RENDERED), '--seed', str(SEED), '--image_width',
         '400', '--image_height', '250', '--render', '1')
    (folder / 'images').rename(folder / 'photos')
    for photo in sorted((folder / 'photos').iterdir())[:-NUM_IMAGES]:
        photo.unlink()
    for name in ('times.csv', 'gt.txt'):
        lines = (folder / name).read_text().splitlines(keepends=True)
        (folder / name).write_text(''.join(
            [line for line in lines if line.startswith('#')] +
            lines[-NUM_IMAGES:]))
    calibration = (folder / 'sensors.yaml').read_text()
    (folder / 'odometry.yaml').write_text(
        calibration.replace('type: differential', 'type: odometry'))
    write_drive_bag(folder, float(re.search(r'track_width: *(\S+)',
                                            calibration)[1]))
    intrinsics = re.search(r'intrinsics: *\[(.*)\]', calibration)[1]
    # Calibration tools put pixel centres at whole numbers, COLMAP at 0.5.
    camera = ','.join(
        '%.12g' % (float(number) + shift) for number, shift in
        zip(intrinsics.split(','), (0.0, 0.0, 0.5, 0.5)))
    write_learned(colmap, folder, camera)
    return camera


def make_checkout(root, folder, build):
    """Links to the repository, except to what the commands write. The folder is
    like a checkout after setup.sh: build/ has links to the build, so that
    packages end up here, and its setup.sh does nothing. fresh/ is like a new
    clone: it has no build, and the real setup.sh."""
    fresh = folder / 'fresh'
    fresh.mkdir()
    for item in root.iterdir():
        if item.name.startswith('build') or item.name == '.git':
            continue
        (fresh / item.name).symlink_to(item)
        if item.name not in ('docs', 'scripts', 'benchmark'):
            (folder / item.name).symlink_to(item)
    for results in ('docs/results', 'benchmark/results'):
        (folder / results).mkdir(parents=True)
    for source, target in ((root / 'scripts', folder / 'scripts'),
                           (build, folder / 'build')):
        target.mkdir()
        for item in source.iterdir():
            if item.name not in ('setup.sh', '_CPack_Packages'):
                (target / item.name).symlink_to(item)
    write_program(folder / 'scripts/setup.sh', ':')


def write_program(path, text):
    path.write_text('#!/bin/sh\n' + text + '\n')
    path.chmod(0o755)


def write_learned(colmap, folder, camera):
    """features/, matches.txt, vectors.txt and, with h5py, an HDF5 file as if
    made by networks. Features and matches are SIFT's; the global descriptors
    depend only on the order of the images."""
    extraction, matching = feature_groups(os.path.abspath(colmap))
    call(colmap, folder, 'feature_extractor', '--database_path', 'learned.db',
         '--image_path', 'photos', '--ImageReader.single_camera', '1',
         '--ImageReader.camera_model', 'PINHOLE', '--ImageReader.camera_params',
         camera, '--%s.use_gpu' % extraction, '0',
         '--SiftExtraction.max_num_features', '500')
    call(colmap, folder, 'sequential_matcher', '--database_path', 'learned.db',
         '--SequentialMatching.overlap', '4',
         '--%s.use_gpu' % matching, '0')
    database = sqlite3.connect(folder / 'learned.db')
    names = dict(database.execute('SELECT image_id, name FROM images'))
    write_features(database, names, folder / 'features')
    with open(folder / 'matches.txt', 'w') as file:
        for pair_id, data in database.execute(
                'SELECT pair_id, data FROM matches WHERE rows > 0'):
            file.write('%s %s\n' % (names[pair_id // MAX_NUM_IMAGES],
                                    names[pair_id % MAX_NUM_IMAGES]))
            for match in struct.iter_unpack('<2I', data):
                file.write('%d %d\n' % match)
            file.write('\n')
    database.close()
    (folder / 'learned.db').unlink()
    vectors = {name: (1.0, float(i)) for i, name in
               enumerate(sorted(names.values()))}
    (folder / 'vectors.txt').write_text(''.join(
        '%s %g %g\n' % (name, *vector) for name, vector in vectors.items()))
    try:
        import h5py
    except ImportError:
        return
    with h5py.File(folder / 'global-feats-netvlad.h5', 'w') as file:
        for name, vector in vectors.items():
            file.create_group(name)['global_descriptor'] = vector


def write_features(database, names, folder):
    """A text file for each image, as feature_importer reads them."""
    folder.mkdir()
    for image, rows, columns, points, descriptors in database.execute(
            'SELECT keypoints.image_id, keypoints.rows, keypoints.cols, '
            'keypoints.data, descriptors.data FROM keypoints '
            'JOIN descriptors USING (image_id)'):
        points = list(struct.iter_unpack('<%df' % columns, points))
        with open(folder / (names[image] + '.txt'), 'w') as file:
            file.write('%d 128\n' % rows)
            for i, point in enumerate(points):
                file.write('%g %g 1 0 %s\n' % (
                    point[0], point[1],
                    ' '.join(map(str, descriptors[128 * i:128 * i + 128]))))
