# SPDX-License-Identifier: BSD-3-Clause
"""What the camera sees, and which keypoints match."""

import numpy as np

WIDTH, HEIGHT = 800, 520
# COLMAP's id and parameters.
CAMERAS = {
    'PINHOLE': (1, [470.0, 468.0, 402.0, 257.0]),
    'SIMPLE_RADIAL': (2, [455.0, 400.0, 260.0, -0.06]),
    'OPENCV': (4, [450.0, 452.0, 396.0, 263.0, -0.12, 0.03, 4e-4, -3e-4]),
    'OPENCV_FISHEYE': (5, [310.0, 309.0, 401.0, 258.0, 0.02, -0.006, 1e-3,
                           -2e-4]),
}


def project(model, points):
  """Pixels of points in the camera's frame (z forward), shape (n, 2)."""
  params = CAMERAS[model][1]
  x, y = (points[:, :2] / points[:, 2:]).T
  r2 = x * x + y * y
  if model == 'SIMPLE_RADIAL':
    factor = params[0] * (1.0 + params[3] * r2)
    return np.stack([x * factor, y * factor], 1) + params[1:3]
  if model == 'OPENCV_FISHEYE':
    theta = np.arctan(np.sqrt(r2))
    powers = theta[:, None]**(2 * np.arange(1, 5))
    factor = theta * (1.0 + powers @ params[4:]) / np.sqrt(r2 + 1e-24)
    x, y = x * factor, y * factor
  elif model == 'OPENCV':
    k1, k2, p1, p2 = params[4:]
    radial = 1.0 + k1 * r2 + k2 * r2 * r2
    x, y = (x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
            y * radial + 2 * p2 * x * y + p1 * (r2 + 2 * y * y))
  return np.stack([params[0] * x + params[2], params[1] * y + params[3]], 1)


def cross(u, v):
  return u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]


def hidden(camera, points, walls):
  """Whether a wall is between the camera and each point, seen from above."""
  near = np.min(np.linalg.norm(walls - camera, axis=2), axis=1) < 70
  ray = (points - camera)[:, None]
  wall = (walls[near, 1] - walls[near, 0])[None]
  to_wall = (walls[near, 0] - camera)[None]
  with np.errstate(divide='ignore', invalid='ignore'):
    along_ray = cross(to_wall, wall) / cross(ray, wall)
    along_wall = cross(to_wall, ray) / cross(ray, wall)
  return np.any((along_ray > 0) & (along_ray < 0.999) & (along_wall > 0) &
                (along_wall < 1), axis=1)


def visible(center, cam_from_world, landmarks, model):
  """Indices of the landmarks in the image, and their pixels."""
  way = landmarks.position - center
  distance = np.linalg.norm(way, axis=1)
  # In the range of distances where a landmark is found, not seen at too flat an
  # angle, in front of the camera.
  found = (distance < landmarks.reach) & (distance > landmarks.reach / 7)
  facing = -np.sum(way * landmarks.normal, 1) / distance
  found &= ((facing > np.where(landmarks.normal[:, 2] > 0.5, 0.06, 0.2)) |
            ~np.any(landmarks.normal, axis=1))
  found &= way @ cam_from_world[2] > 0.35 * distance
  seen = np.flatnonzero(found)
  pixels = project(model, way[seen] @ cam_from_world.T)
  inside = np.all((pixels > 0) & (pixels < [WIDTH, HEIGHT]), axis=1)
  seen, pixels = seen[inside], pixels[inside]
  if len(landmarks.walls):
    free = ~hidden(center[:2], landmarks.position[seen, :2], landmarks.walls)
    seen, pixels = seen[free], pixels[free]
  return seen, pixels


def take_image(center, cam_from_world, landmarks, args, rng):
  """The strongest args.num_keypoints keypoints: pixels, looks, azimuth of the
  view relative to the landmark's normal, log2 of the distance."""
  seen, pixels = visible(center, cam_from_world, landmarks, args.camera_model)
  # A landmark's strength is the same in all images but for a little noise; each
  # image misses a fifth of the landmarks.
  strength = (seen * 0.6180339887) % 1.0 + 0.15 * rng.normal(size=len(seen))
  strength[rng.uniform(size=len(seen)) < 0.2] = -np.inf
  order = np.argsort(-strength)[:min(args.num_keypoints,
                                     np.isfinite(strength).sum())]
  best = np.sort(order)
  seen, pixels = seen[best], pixels[best]
  sigma = args.pixel_noise * np.where(rng.uniform(size=len(seen)) < 0.05, 3, 1)
  way = landmarks.position[seen] - center
  normal = landmarks.normal[seen]
  azimuth = (np.arctan2(way[:, 1], way[:, 0]) -
             np.arctan2(normal[:, 1], normal[:, 0]))
  return dict(pixels=pixels + sigma[:, None] * rng.normal(size=pixels.shape),
              looks=landmarks.looks[seen], azimuth=azimuth,
              log_distance=np.log2(np.linalg.norm(way, axis=1)))


def darken(image, number, rng):
  """Keeps a few keypoints, as noise: no other image has their new looks."""
  few = rng.permutation(len(image['looks']))[:int(rng.integers(0, 40))]
  image = {key: value[few] for key, value in image.items()}
  image['looks'] = -1000 * (number + 1) - np.arange(len(few))
  return image


def nearest(pixels, targets, count):
  """Indices of the pixels nearest to each target, unordered; shape (targets,
  count)."""
  apart = np.sum((pixels[None] - targets[:, None])**2, axis=2)
  return np.argpartition(apart, count - 1, axis=1)[:, :count]


def match(image1, image2, outlier_ratio, rng):
  """Matches as rows of keypoints: those with the same looks, and wrong ones. Of
  the wrong ones a third is near the right place, as on repeated windows."""
  _, rows1, rows2 = np.intersect1d(image1['looks'], image2['looks'],
                                   return_indices=True)
  turn = image1['azimuth'][rows1] - image2['azimuth'][rows2]
  turn = np.arctan2(np.sin(turn), np.cos(turn))
  zoom = image1['log_distance'][rows1] - image2['log_distance'][rows2]
  found = rng.uniform(size=len(rows1)) < 0.9 * np.exp(
      -(turn / np.radians(32.0))**2 - (zoom / 1.1)**2)
  rows1, rows2 = rows1[found], rows2[found]
  free1 = np.setdiff1d(np.arange(len(image1['looks'])), rows1)
  free2 = np.setdiff1d(np.arange(len(image2['looks'])), rows2)
  count = min(int(len(rows1) * outlier_ratio / (1.0 - outlier_ratio)),
              len(free1), len(free2))
  if count == 0:
    return np.column_stack([rows1, rows2])
  wrong1, wrong2 = rng.permutation(free1)[:count], rng.permutation(free2)[:count]
  similar = count // 3
  beside = rows2[nearest(image1['pixels'][rows1],
                         image1['pixels'][wrong1[:similar]], 1)[:, 0]]
  around = nearest(image2['pixels'][free2], image2['pixels'][beside],
                   min(6, len(free2)))
  pick = rng.integers(around.shape[1], size=similar)
  wrong2[:similar] = free2[around[np.arange(similar), pick]]
  _, once = np.unique(wrong2, return_index=True)
  return np.column_stack([np.append(rows1, wrong1[once]),
                          np.append(rows2, wrong2[once])])


def candidate_pairs(poses, places, spacing, rng):
  """Pairs of neighbours in time, of nearby earlier images, of aliased places,
  and some random pairs. places: as of image_places."""
  count = len(poses)
  centers = np.array([center for center, _ in poses])
  forward = np.array([rotation[2] for _, rotation in poses])
  pairs = {(i, j) for i in range(count)
           for j in range(i + 1, min(i + 13, count))}
  for i in range(16, count):
    apart = np.linalg.norm(centers[:i - 15] - centers[i], axis=1)
    apart[forward[:i - 15] @ forward[i] < 0.75] = np.inf
    pairs |= {(j, i) for j in np.argsort(apart)[:8] if apart[j] < 11 * spacing}
    if places[i] is not None:
      template, street, along, way = places[i]
      alike = sorted((abs(places[j][2] - along), j) for j in range(i - 15)
                     if places[j] is not None and places[j][0] == template and
                     places[j][1] != street and places[j][3] == way)
      pairs |= {(j, i) for gap, j in alike[:4] if gap < 5 * spacing}
  pairs |= {tuple(sorted(rng.choice(count, 2, replace=False)))
            for _ in range(count // 5)}
  return sorted((int(i), int(j)) for i, j in pairs)
