#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Recall of a pair list: its share of the true pairs.

    scripts/benchmark/pair_recall.py EXHAUSTIVE.db PAIRS.txt

EXHAUSTIVE.db has been matched exhaustively (match_exactly.py), or is that of
adasfm_synthesizer: its verified pairs are the truth. PAIRS.txt is the output of
adasfm_pair_generator. Prints the recall for pairs of at least 15, 30, 60, 120
and 240 verified matches, for all pairs and for pairs more than 10 images apart
(in the order of the names), and the recall of the best list with 30 partners
for every image.
"""
import sqlite3
import sys

MAX_NUM_IMAGES = 2147483647  # of COLMAP's pair ids


def read_truth(path):
    database = sqlite3.connect(f"file:{path}?mode=ro", uri=True)
    names = dict(database.execute("SELECT image_id, name FROM images"))
    rank = {name: i for i, name in enumerate(sorted(names.values()))}
    truth = {}
    for pair_id, rows in database.execute(
            "SELECT pair_id, rows FROM two_view_geometries WHERE rows >= 15"):
        id2 = pair_id % MAX_NUM_IMAGES
        id1 = (pair_id - id2) // MAX_NUM_IMAGES
        truth[frozenset((rank[names[id1]], rank[names[id2]]))] = rows
    return rank, truth


def read_pairs(path, rank):
    with open(path) as file:
        return {frozenset(rank[name] for name in line.split())
                for line in file if line.strip()}


def best_recall(truth, num_similar):
    """Recall of a list of each image's num_similar best true partners."""
    partners = {}
    for pair, rows in truth.items():
        for image in pair:
            partners.setdefault(image, []).append((rows, pair))
    kept = {pair for entries in partners.values()
            for _, pair in sorted(entries, key=lambda entry: -entry[0])
            [:num_similar]}
    return len(kept) / max(1, len(truth))


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    rank, truth = read_truth(sys.argv[1])
    pairs = read_pairs(sys.argv[2], rank)
    total = len(rank) * (len(rank) - 1) // 2
    print(f"{len(rank)} images, {len(truth)} of {total} pairs verified; "
          f"{len(pairs)} in the list, {len(pairs & truth.keys())} of them true")
    for min_gap in (0, 10):
        for min_rows in (15, 30, 60, 120, 240):
            chosen = {pair: rows for pair, rows in truth.items()
                      if rows >= min_rows and max(pair) - min(pair) > min_gap}
            recall = len(pairs & chosen.keys()) / max(1, len(chosen))
            print(f"gap > {min_gap:2d}, >= {min_rows:3d} matches: "
                  f"{len(chosen):6d} true, recall {recall:.3f}, "
                  f"best with 30 an image {best_recall(chosen, 30):.3f}")


if __name__ == "__main__":
    main()
