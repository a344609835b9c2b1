#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Matches all images of a COLMAP database with each other.

    scripts/benchmark/match_exactly.py DATABASE MATCHES.txt [MAX_NUM_FEATURES]

Exact nearest neighbours among the MAX_NUM_FEATURES (500) largest features of
every image, with COLMAP's tests: angle at most 0.7 rad, ratio to the second
best at most 0.8, best in both directions, 15 matches. On a CPU this is several
times as fast as exhaustive_matcher, and repeatable. COLMAP verifies the result:

    colmap matches_importer --match_type raw --match_list_path MATCHES.txt
"""
import sqlite3
import sys

import numpy as np

MAX_ANGLE = 0.7
MAX_RATIO = 0.8
MIN_NUM_MATCHES = 15


def scales(keypoints):
    if keypoints.shape[1] == 6:  # x, y and an affine shape
        return np.abs(keypoints[:, 2] * keypoints[:, 5] -
                      keypoints[:, 3] * keypoints[:, 4])
    return keypoints[:, 2] if keypoints.shape[1] > 2 else np.ones(
        len(keypoints))


def read_features(path, max_num_features):
    """{name: (indices of the largest features, unit descriptors)}."""
    database = sqlite3.connect('file:%s?mode=ro' % path, uri=True)
    features = {}
    for name, rows, columns, points, descriptors in database.execute(
            'SELECT images.name, keypoints.rows, keypoints.cols, '
            'keypoints.data, descriptors.data FROM images '
            'JOIN keypoints USING (image_id) JOIN descriptors USING (image_id)'):
        points = np.frombuffer(points, np.float32).reshape(rows, columns)
        largest = np.argsort(-scales(points), kind='stable')[:max_num_features]
        vectors = np.frombuffer(descriptors, np.uint8).reshape(rows, -1)
        vectors = vectors[largest].astype(np.float32)
        vectors /= np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True),
                              1e-9)
        features[name] = largest, vectors
    return features


def best_in_rows(cosines):
    """Index of each row's best match, and whether it passes both tests."""
    rows = np.arange(len(cosines))
    best = np.argmax(cosines, axis=1)
    first = np.arccos(np.minimum(cosines[rows, best], 1))
    others = cosines.copy()
    others[rows, best] = -1
    second = np.arccos(np.clip(others.max(axis=1), -1, 1))
    return best, (first <= MAX_ANGLE) & (first < MAX_RATIO * second)


def match(vectors1, vectors2):
    cosines = vectors1 @ vectors2.T
    best12, good12 = best_in_rows(cosines)
    best21, good21 = best_in_rows(np.ascontiguousarray(cosines.T))
    rows = np.arange(len(vectors1))
    mutual = good12 & good21[best12] & (best21[best12] == rows)
    return rows[mutual], best12[mutual]


def main():
    if len(sys.argv) not in (3, 4):
        sys.exit(__doc__)
    features = read_features(
        sys.argv[1], int(sys.argv[3]) if len(sys.argv) == 4 else 500)
    names = sorted(features)
    with open(sys.argv[2], 'w') as file:
        for i, name1 in enumerate(names):
            for name2 in names[i + 1:]:
                largest1, vectors1 = features[name1]
                largest2, vectors2 = features[name2]
                if not len(vectors1) or not len(vectors2):
                    continue
                rows1, rows2 = match(vectors1, vectors2)
                if len(rows1) < MIN_NUM_MATCHES:
                    continue
                file.write('%s %s\n' % (name1, name2))
                for pair in zip(largest1[rows1], largest2[rows2]):
                    file.write('%d %d\n' % pair)
                file.write('\n')


if __name__ == '__main__':
    main()
