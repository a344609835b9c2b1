# SPDX-License-Identifier: BSD-3-Clause
"""Estimates of the memory and time of tasks: measured (docs/guide/cluster.md)
and rounded up. For parts, the plan's own memory estimate replaces them."""

PAIRS_PER_IMAGE = 40
MATCHES_PER_PAIR = 250
IMAGES_PER_PART = 200

# A core may be slower by this factor than the core of the measurements.
SLOWNESS = 4.0
MIN_MINUTES = 10.0


def whole_mb(facts):
    """Memory of adasfm_global and of the merge: more than the estimate of
    colmap_ext/stage_memory.cc for the scene."""
    return (135 + 0.07 * facts['num_images'] +
            200e-6 * facts['num_keypoints'] +
            50e-6 * facts['num_inlier_matches'])


def memory_mb(stage, settings, facts):
    """Memory of a task, from 1.3 to 1.5 times the measured bytes of an image, a
    keypoint and an inlier."""
    images = facts['num_images']
    keypoints = facts['num_keypoints'] / 1e6
    inliers = facts['num_inlier_matches'] / 1e6
    scene = 120 + 100 * keypoints + 35 * inliers
    if stage.name == 'features':
        # For a photo of 3200 x 2400 pixels, which the detector enlarges twofold.
        return 500 + 2000 * settings.threads_per_task
    if stage.name == 'matches':
        return 500 + 0.5 * min(images, settings.pairs_per_block)
    if stage.name == 'pairs':
        return 500 + 0.1 * images
    if stage.name in ('join_features', 'join_matches'):
        return 300 + 0.01 * images
    if stage.name == 'priors':
        return 120 + 0.1 * images
    if stage.name in ('global', 'merge'):
        return whole_mb(facts)
    if stage.name == 'parts' and 'part_memory_mb' in facts:
        return 1.2 * facts['scene_memory_mb'] + facts['part_memory_mb']
    return scene + (200 if stage.name == 'parts' else 0)


# CPU seconds of an image (features: of 3200 x 2400 pixels) or a pair.
IMAGE_SECONDS = {'features': 8.0, 'join_features': 0.02, 'pairs': 0.1,
                 'join_matches': 0.05, 'priors': 0.01, 'global': 0.05,
                 'plan': 0.01, 'parts': 0.2, 'merge': 0.1}
PAIR_SECONDS = 0.25


def minutes(stage, settings, facts, num_tasks):
    """Time of the stage's longest task [min]."""
    if stage.name == 'matches':
        seconds = PAIR_SECONDS * facts['num_pairs']
    else:
        seconds = IMAGE_SECONDS[stage.name] * facts['num_images']
    return MIN_MINUTES + SLOWNESS * seconds / 60.0 / (
        num_tasks if stage.is_wide else 1)
