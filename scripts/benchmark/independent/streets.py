# SPDX-License-Identifier: BSD-3-Clause
"""Routes, and the landmarks and walls along them."""

import numpy as np


def walk_streets(kind, length_m, rng):
  """Junctions, and the drive as a list of them: a random walk that never turns
  back and prefers streets that were driven the same way before."""
  size = max(4, int(np.sqrt(length_m / 180.0)) + 2)
  columns, rows = np.meshgrid(np.arange(size), np.arange(size))
  junctions = np.stack([columns.ravel(), rows.ravel()], 1) * kind['grid']
  junctions = junctions + rng.uniform(-1, 1, junctions.shape) * kind['jitter']
  route = [size + 1, size + 2]
  driven, length = set(), 0.0
  while length < length_m:
    at, before = route[-1], route[-2]
    driven.add((before, at))
    length += np.linalg.norm(junctions[at] - junctions[before])
    column, row = at % size, at // size
    ways = [at + step for step, is_inside in (
        (1, column + 1 < size), (-1, column > 0), (size, row + 1 < size),
        (-size, row > 0)) if is_inside and at + step != before]
    weights = [2.5 if (at, way) in driven else
               0.3 if (way, at) in driven else 1.0 for way in ways]
    route.append(int(rng.choice(ways, p=np.array(weights) / np.sum(weights))))
  return junctions, route


def mow(length_m):
  """Corners of lanes of 12 m, 1 m apart."""
  corners = []
  for lane in range(int(length_m / 13.0) + 2):
    ends = [(0.0, lane), (12.0, lane)]
    corners += ends if lane % 2 == 0 else ends[::-1]
  return np.array(corners, float)


class Landmarks:
  """Positions, outward normals (zero: seen from everywhere), the largest
  distance from which each is found (reach), and looks (equal: look alike)."""

  def __init__(self):
    self.parts, self.walls, self.num_looks = [], [], 0

  def new_looks(self, count):
    self.num_looks += count
    return np.arange(self.num_looks - count, self.num_looks)

  def add(self, position, normal, reach, looks=None):
    count = len(position)
    self.parts.append((position, np.broadcast_to(normal, position.shape),
                       np.broadcast_to(reach, count),
                       self.new_looks(count) if looks is None else looks))

  def finish(self):
    self.position, self.normal, self.reach, self.looks = (
        np.concatenate(values) for values in zip(*self.parts))
    self.walls = np.array(self.walls).reshape(-1, 2, 2)
    return self


def facades(kind, side, length_m, rng):
  """Walls of one side of a street as polylines, and landmarks on them and on
  poles before them: metres along, to the left and up, with normals."""
  walls, points, normals = [], [], []
  along = kind['clear']
  while along < length_m:
    end = along + rng.uniform(7, 15)
    left = side * rng.uniform(*kind['setback'])
    walls.append(np.array([(along, left + side * 5), (along, left),
                           (end, left), (end, left + side * 5)]))
    count = int(18 * (end - along))
    height = kind['height'] * rng.uniform(0, 1, count)**1.3
    points.append(np.stack([rng.uniform(along, end, count),
                            np.full(count, left - side * 0.03), height], 1))
    normals.append(np.tile([0.0, -side, 0.0], (count, 1)))
    along = end
  for pole in np.arange(rng.uniform(4, 12), length_m, 9.0):
    xy = [pole, side * (kind['setback'][0] - 1.5)] + rng.normal(0, 0.1, (14, 2))
    height = rng.uniform(0.3, min(4.5, kind['height']), 14)
    points.append(np.column_stack([xy, height]))
    normals.append(np.zeros((14, 3)))
  return walls, points, normals


def street_template(kind, length_m, rng):
  """Walls, landmarks and their normals of both sides and the ground."""
  sides = [facades(kind, side, length_m, rng) for side in (1, -1)]
  walls, points, normals = (a + b for a, b in zip(*sides))
  count = int(8 * length_m)
  points.append(np.stack([rng.uniform(0, length_m, count),
                          rng.uniform(-1, 1, count) * kind['setback'][0],
                          np.zeros(count)], 1))
  normals.append(np.tile([0.0, 0.0, 1.0], (count, 1)))
  return walls, np.concatenate(points), np.concatenate(normals)


def build_town(kind, junctions, route, rng):
  """Landmarks, and {ends: template} of the driven streets, with the ends in the
  order of the first drive."""
  landmarks = Landmarks()
  streets = []
  for ends in zip(route, route[1:]):
    if ends not in streets and ends[::-1] not in streets:
      streets.append(ends)
  num_templates = int(np.ceil(kind['alias_classes'] * len(streets)))
  templates = rng.permutation(np.arange(len(streets)) % num_templates)
  made = {}
  for (a, b), template in zip(streets, templates):
    if template not in made:
      shape = street_template(kind, 80.0, rng)
      made[template] = *shape, landmarks.new_looks(len(shape[1]))
    walls, points, normals, looks = made[template]
    way = junctions[b] - junctions[a]
    length = np.linalg.norm(way)
    way /= length
    axes = np.array([[way[0], way[1], 0], [-way[1], way[0], 0], [0, 0, 1]])
    begin, end = kind['clear'], length - kind['clear']
    inside = (points[:, 0] > begin) & (points[:, 0] < end)
    inside |= (normals[:, 2] > 0) & (points[:, 0] < length)
    is_own = rng.uniform(size=len(points)) > kind['alias_share']
    looks = np.where(is_own, landmarks.new_looks(len(points)), looks)
    landmarks.add(points[inside] @ axes + np.append(junctions[a], 0),
                  normals[inside] @ axes,
                  12.0 * 4.0**rng.uniform(size=inside.sum()), looks[inside])
    for wall in walls:
      if wall[0, 0] < end:
        wall = np.column_stack([np.minimum(wall[:, 0], end), wall[:, 1]])
        wall = wall @ axes[:2, :2] + junctions[a]
        landmarks.walls += [wall[i:i + 2] for i in range(3)]
  # Towers and hills behind the town, seen along the streets.
  angle = rng.uniform(0, 2 * np.pi, 400)
  far = rng.uniform(400, 900, 400) * np.array([np.cos(angle), np.sin(angle)])
  landmarks.add(np.column_stack([junctions.mean(0) + far.T,
                                 rng.uniform(5, 80, 400)]), np.zeros(3), 3000.0)
  return landmarks.finish(), dict(zip(streets, templates))


def build_lawn(corners, rng):
  """Grass, a fence, and trees and houses around."""
  landmarks = Landmarks()
  low, high = corners.min(0) - 3.0, corners.max(0) + 3.0
  count = int(12 * np.prod(high - low))
  landmarks.add(np.column_stack([rng.uniform(low, high, (count, 2)),
                                 rng.uniform(0, 0.06, count)]),
                np.zeros(3), 1.5 * 4.0**rng.uniform(size=count))
  for count, distance, height, reach in ((1500, (1, 2), 1.2, 25.0),
                                         (3500, (6, 30), 7.0, 90.0)):
    angle = rng.uniform(0, 2 * np.pi, count)
    way = np.stack([np.cos(angle), np.sin(angle)], 1)
    edge = 1.0 / np.max(np.abs(way) / ((high - low) / 2), axis=1)
    out = edge + rng.uniform(*distance, count)
    landmarks.add(np.column_stack([(low + high) / 2 + way * out[:, None],
                                   height * rng.uniform(size=count)]),
                  np.zeros(3), reach)
  return landmarks.finish()


def image_places(junctions, route, templates, positions, vertices):
  """For each image: its street's template, the street, metres along it, and
  whether it is driven from its first end; None near the ends."""
  places = []
  for position, vertex in zip(positions, vertices):
    driven = tuple(route[vertex:vertex + 2])
    street = driven if driven in templates else driven[::-1]
    begin, end = junctions[list(street)]
    length = np.linalg.norm(end - begin)
    along = (position[:2] - begin) @ (end - begin) / length
    places.append((templates[street], street, along, street == driven)
                  if 4 < along < length - 4 else None)
  return places
