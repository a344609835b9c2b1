# SPDX-License-Identifier: BSD-3-Clause
"""The worlds of stress_worlds.py, each with one difficulty (dial)."""

# Without logs the scale drifts, so only errors above this share of the distance
# driven count as folds.
MAX_DRIFT_WITHOUT_LOGS = 0.005
ALL_LOGS = ('imu', 'wheel')


# One world: the figures of world.json that describe the dial, and options of the
# synthesizer.
def dial(figures=(), images=150, logs=ALL_LOGS, bar_m=0.5,
         max_drift=MAX_DRIFT_WITHOUT_LOGS, **options):
  return {'figures': list(figures), 'images': images, 'logs': list(logs), 'bar_m': bar_m,
          'max_drift': max_drift, 'options': options}


# A rendered world, for effects that only photos have; one command maps it from
# the photos.
def photos(figures, **options):
  return dial(figures, 60, render=1, spacing=1, image_width=640,
              image_height=400, **options)


DIALS = {
    'plain': dial(('mean_overlap',)),
    'mower, lanes 1 m apart': dial(
        ('driven_m', 'num_revisit_pairs'), 300, bar_m=0.1, trajectory='lanes',
        spacing=0.5, image_interval=0.5),
    'mower on gravel': dial(
        ('driven_m',), 300, bar_m=0.1, trajectory='lanes', spacing=0.5,
        image_interval=0.5, wheel_slip_noise=0.1, wheel_slips=6),
    'mower, 5 turns on the spot, 2 stops': dial(
        ('standing_s',), 300, bar_m=0.1, trajectory='lanes', spacing=0.5,
        image_interval=0.5, spins=5, stops=2),
    'parallel streets': dial(
        ('alias_pair_ratio', 'num_images_with_false_pairs'),
        trajectory='parallel', street_blocks=2, spacing=3, num_neighbors=6,
        alias_ratio=0.3),
    'parallel streets, half of the pairs false': dial(
        ('alias_pair_ratio', 'num_images_with_false_pairs'),
        trajectory='parallel', street_blocks=2, spacing=3, num_neighbors=3,
        alias_ratio=0.45, spurious_ratio=0.05),
    'parallel streets, three blackouts': dial(
        ('alias_pair_ratio', 'num_images_without_texture'),
        trajectory='parallel', street_blocks=2, spacing=3, num_neighbors=6,
        alias_ratio=0.2, num_blackouts=3, blackout_images=10),
    # Both parts pass a corner where both streets look alike.
    'parallel streets alike around corners, a blackout between': dial(
        ('alias_pair_ratio', 'num_images_without_texture'), 200,
        trajectory='parallel', street_blocks=2, spacing=3, num_neighbors=6,
        alias_ratio=0.2, num_blackouts=1, blackout_images=10),
    'two parallel streets, 180 images alike, a blackout between': dial(
        ('alias_pair_ratio', 'num_images_with_false_pairs'), 400,
        trajectory='parallel', spacing=1, num_neighbors=4, alias_ratio=0.2,
        num_blackouts=1, blackout_images=40),
    'floors of a car park': dial(
        ('alias_pair_ratio', 'num_images_with_false_pairs'), 220,
        max_drift=0, trajectory='floors', spacing=3, num_neighbors=6,
        alias_ratio=0.3),
    'town, 40 % look-alikes': dial(
        ('alias_pair_ratio',), 200, alias_ratio=0.4),
    'half of the pairs spurious': dial(
        ('spurious_pair_ratio',), spurious_ratio=0.5),
    '70 % of the pairs false': dial(
        ('alias_pair_ratio', 'spurious_pair_ratio'), 200, alias_ratio=0.2,
        spurious_ratio=0.5),
    '62 % of the pairs false': dial(
        ('alias_pair_ratio', 'spurious_pair_ratio'), 200, alias_ratio=0.12,
        spurious_ratio=0.5),
    'turns on the spot': dial(('standing_s',), 200, spins=1, spin_duration=4),
    'long standstill': dial(('standing_s',), 200, stops=1, stop_duration=12),
    'two hours at rest, a photo every two minutes': dial(
        ('standing_s',), 200, stops=1, stop_duration=7200,
        stop_image_interval=120),
    'two hours at rest without a photo': dial(
        ('standing_s',), 200, stops=1, stop_duration=7200,
        stop_image_interval=10000),
    'a minute at rest, five photos a second': dial(
        ('standing_s',), 700, stops=1, stop_duration=60,
        stop_image_interval=0.2),
    'wheels on gravel': dial((), wheel_slip_noise=0.03, wheel_slips=4),
    'cars carry most matches': dial(
        ('moving_keypoint_ratio', 'moving_match_ratio'), moving_ratio=0.45),
    'rolling shutter of 30 ms': dial((), rolling_shutter=0.03),
    'focal length breathes by 1 %': dial(
        ('max_focal_error_percent',), focal_breathing=0.01),
    'focal length jumps 20 times, by up to 1 %': dial(
        ('max_focal_error_percent',), focal_breathing=0.01, focal_steps=20),
    'few keypoints inside parts': dial(
        ('num_images_without_texture',), 200, num_blackouts=4,
        blackout_images=12, blackout_keypoints=14),
    'gyroscope drifts by 0.6 deg/s a minute': dial((), gyro_drift=1.75e-4),
    'rates of the gyroscope 2 % too large': dial((), gyro_scale=0.02),
    'a third of the rotations wrong': dial(
        ('rotation_outlier_ratio',), rotation_outliers=0.33),
    '80 % outliers': dial(('outlier_match_ratio',), outlier_ratio=0.8,
                          num_keypoints=600),
    'GNSS with jumps, no other log': dial(
        ('num_gnss_fixes',), logs=('gnss',), gnss_rate=1, gnss_jumps=1,
        bar_m=1.0),
    'photos': photos(('mean_overlap',)),
    'photos, exposure jumps by 3 at every fifth': photos(
        ('exposure_jump_ratio', 'max_exposure_factor'), exposure_jumps=0.2,
        exposure_factor=3),
    'photos, exposure jumps by 8 at every second': photos(
        ('exposure_jump_ratio', 'max_exposure_factor'), exposure_jumps=0.5,
        exposure_factor=8),
    'photos, shutter open for 20 ms': photos(
        ('mean_blur_px', 'max_blur_px', 'blurred_photo_ratio'),
        exposure_time=0.02),
    'photos, shutter open for 60 ms': photos(
        ('mean_blur_px', 'max_blur_px', 'blurred_photo_ratio'),
        exposure_time=0.06),
}
