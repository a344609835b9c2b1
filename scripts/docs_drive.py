# SPDX-License-Identifier: BSD-3-Clause
"""The small drive that check_docs.py runs the documentation's commands on."""
import os
import re
import sqlite3
import struct
import subprocess
import sys

NUM_IMAGES = 12
PAIR_BASE = 2147483647  # of COLMAP's pair ids


def call(colmap, folder, *arguments):
    result = subprocess.run([os.path.abspath(colmap), *arguments], cwd=folder, check=False,
                            capture_output=True, text=True)
    if result.returncode != 0:
        sys.exit(result.stdout + result.stderr)


def make_drive(colmap, folder):
    """Photos, logs and calibration under the names of the documentation, and
    what learned models would give; returns the camera's parameters."""
    call(colmap, folder, 'adasfm_synthesizer', '--output_path', '.',
         '--num_images', str(NUM_IMAGES), '--spacing', '1', '--image_width',
         '400', '--image_height', '250', '--render', '1')
    (folder / 'images').rename(folder / 'photos')
    camera = re.search(r'intrinsics: *\[(.*)\]',
                       (folder / 'sensors.yaml').read_text())[1]
    camera = camera.replace(' ', '')
    write_learned(colmap, folder, camera)
    return camera


def write_learned(colmap, folder, camera):
    """features/, matches.txt, vectors.txt and an HDF5 file as if made by
    networks; they are SIFT's, and descriptors that go by the order."""
    call(colmap, folder, 'feature_extractor', '--database_path', 'learned.db',
         '--image_path', 'photos', '--ImageReader.single_camera', '1',
         '--ImageReader.camera_model', 'PINHOLE', '--ImageReader.camera_params',
         camera, '--SiftExtraction.use_gpu', '0',
         '--SiftExtraction.max_num_features', '500')
    call(colmap, folder, 'sequential_matcher', '--database_path', 'learned.db',
         '--SequentialMatching.overlap', '4', '--SiftMatching.use_gpu', '0')
    database = sqlite3.connect(folder / 'learned.db')
    names = dict(database.execute('SELECT image_id, name FROM images'))
    write_features(database, names, folder / 'features')
    with open(folder / 'matches.txt', 'w') as file:
        for pair_id, data in database.execute(
                'SELECT pair_id, data FROM matches WHERE rows > 0'):
            file.write('%s %s\n' % (names[pair_id // PAIR_BASE],
                                    names[pair_id % PAIR_BASE]))
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
