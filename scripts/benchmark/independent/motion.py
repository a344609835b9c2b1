# SPDX-License-Identifier: BSD-3-Clause
"""How the machine moves, and what its IMU and wheels log."""

import collections

import numpy as np

GRAVITY = 9.81  # m/s^2
STANDSTILL_S = 3.2
RATE_HZ = 1000  # Of the motion.
IMU_STEP, WHEEL_STEP = 5, 20  # Of its samples: 200 and 50 Hz.
TRACK_WIDTH_M = 1.1
GYRO_NOISE, GYRO_WALK = 5e-4, 2e-5  # rad/s/sqrt(Hz), rad/s^2/sqrt(Hz)
ACCEL_NOISE, ACCEL_WALK = 5e-3, 2e-4  # m/s^2/sqrt(Hz), m/s^3/sqrt(Hz)
WHEEL_NOISE = 0.05  # m/s

# Times [s], position (n, 3) and world_from_wheel (n, 3, 3) of the wheel frame
# (x forward, z up), speed [m/s], and the polyline's vertex last passed.
Motion = collections.namedtuple('Motion', 't position rotation speed vertex')
# By arc length [m]: positions (n, 2), heading, highest speed, vertex.
Path = collections.namedtuple('Path', 'length position yaw limit vertex')


def euler(yaw, pitch, roll):
  """Rz(yaw) Ry(pitch) Rx(roll), of arrays or numbers: shape (..., 3, 3)."""
  cy, sy, cp, sp = np.cos(yaw), np.sin(yaw), np.cos(pitch), np.sin(pitch)
  cr, sr = np.cos(roll), np.sin(roll)
  rows = [[cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
          [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
          [-sp, cp * sr, cp * cr]]
  return np.stack([np.stack(np.broadcast_arrays(*r), -1) for r in rows], -2)


def smooth(values, sigma):
  """Gaussian average along the first axis; the end values are repeated."""
  radius = int(4 * sigma) + 1
  kernel = np.exp(-0.5 * (np.arange(-radius, radius + 1) / sigma)**2)
  padded = np.pad(values, [(radius, radius)] + [(0, 0)] * (values.ndim - 1),
                  mode='edge')
  columns = padded.reshape(len(padded), -1).T
  return np.stack([np.convolve(c, kernel / kernel.sum(), 'valid')
                   for c in columns], -1).reshape(values.shape)


def lengths(points):
  """Arc length of a polyline at its points."""
  return np.append(0, np.cumsum(np.linalg.norm(np.diff(points, axis=0),
                                               axis=1)))


def smooth_path(kind, polyline, rng):
  """The polyline with rounded corners and a slow lateral weave."""
  step = kind['corner'] / 10.0
  at_vertex = lengths(polyline)
  s = np.arange(0, at_vertex[-1], step)
  path = np.stack([np.interp(s, at_vertex, polyline[:, i]) for i in (0, 1)], 1)
  path = smooth(path, kind['corner'] / step)
  tangent = np.gradient(path, axis=0)
  normal = np.stack([-tangent[:, 1], tangent[:, 0]], 1)
  normal /= np.linalg.norm(normal, axis=1)[:, None]
  weave = smooth(rng.normal(size=len(s)), 6.0 / step)
  path += (kind['weave'] * weave / weave.std())[:, None] * normal
  tangent = np.gradient(path, axis=0)
  length = lengths(path)
  yaw = smooth(np.unwrap(np.arctan2(tangent[:, 1], tangent[:, 0])),
               0.25 * kind['corner'] / step)
  # At most 2 m/s^2 to the side and 0.8 rad/s, but at least 15 % of the speed.
  curvature = np.abs(np.gradient(yaw) / np.gradient(length)) + 1e-3
  limit = np.minimum(kind['speed'], np.minimum(np.sqrt(2.0 / curvature),
                                               0.8 / curvature))
  limit = smooth(np.maximum(limit, 0.15 * kind['speed']),
                 0.5 * kind['speed'] / step)
  vertex = np.searchsorted(at_vertex, s, 'right') - 1
  return Path(length, path, yaw, limit, vertex)


def follow(path, count):
  """Speed and arc length at 1 kHz: first stationary, then accelerating."""
  dt = 1.0 / RATE_HZ
  ramp = np.clip((np.arange(count) * dt - STANDSTILL_S) / 2.5, 0, 1)
  ramp = ramp**3 * (10 - 15 * ramp + 6 * ramp**2)
  speed, where = np.zeros(count), 0.0
  for begin in range(0, count, 20):  # Limits hardly change within 20 ms.
    part = slice(begin, begin + 20)
    speed[part] = ramp[part] * np.interp(where, path.length, path.limit)
    where += speed[part].sum() * dt
  if where >= path.length[-1]:
    raise ValueError('the route is too short')
  speed = smooth(speed, 40.0)
  return speed, np.append(0, np.cumsum(0.5 * (speed[1:] + speed[:-1]) * dt))


def drive(kind, polyline, duration_s, rng):
  """Motion along a polyline over gentle hills, with a shaking body and, for
  spoil > 0, a small rotation during the standstill."""
  path = smooth_path(kind, polyline, rng)
  count = int((duration_s + STANDSTILL_S) * RATE_HZ)
  t = np.arange(count) / RATE_HZ
  speed, along = follow(path, count)
  heading = smooth(np.interp(along, path.length, path.yaw), 40.0)
  forward = np.stack([np.cos(heading), np.sin(heading)], 1)
  side = np.stack([-forward[:, 1], forward[:, 0]], 1)
  velocity = speed[:, None] * forward
  xy = np.zeros((count, 2))
  xy[1:] = np.cumsum(0.5 * (velocity[1:] + velocity[:-1]) / RATE_HZ, axis=0)
  xy += path.position[0]
  z, slope = np.zeros(count), np.zeros((count, 2))
  for _ in range(4):
    wave, phase = rng.uniform(-0.12, 0.12, 2), rng.uniform(0, 6)
    z += kind['hills'] * np.sin(xy @ wave + phase)
    slope += (kind['hills'] * np.cos(xy @ wave + phase))[:, None] * wave
  shake = 0.004 * np.minimum(1, speed / 2)
  pitch = (shake * np.sin(2 * np.pi * 1.3 * t + rng.uniform(0, 6)) -
           np.arctan(np.sum(slope * forward, 1)))
  roll = (shake * np.sin(2 * np.pi * 1.7 * t + rng.uniform(0, 6)) +
          np.arctan(np.sum(slope * side, 1)))
  still = np.minimum(t, STANDSTILL_S)
  settle = (kind['spoil'] * rng.choice([-1, 1]) *
            (5e-4 * still + 1e-4 * np.exp(-still) * np.sin(18 * still)))
  rotation = euler(heading + settle - settle[-1], pitch, roll)
  vertex = path.vertex[np.searchsorted(path.length, along)]
  return Motion(t, np.column_stack([xy, z]), rotation, speed, vertex)


def random_walk(count, density, dt, rng):
  return np.cumsum(density * np.sqrt(dt) * rng.normal(size=(count, 3)), axis=0)


def imu_log(motion, wheel_from_imu, spoil, rng):
  """Times, gyroscope and accelerometer: finite differences of the motion, a
  constant bias, a random walk and white noise."""
  dt = 1.0 / RATE_HZ
  at = motion.position + motion.rotation @ wheel_from_imu[:3, 3]
  world_from_imu = motion.rotation @ wheel_from_imu[:3, :3]
  turn = np.swapaxes(world_from_imu[:-2], 1, 2) @ world_from_imu[2:]
  rate = np.stack([turn[:, 2, 1] - turn[:, 1, 2], turn[:, 0, 2] - turn[:, 2, 0],
                   turn[:, 1, 0] - turn[:, 0, 1]], 1) / (4 * dt)
  force = (at[2:] - 2 * at[1:-1] + at[:-2]) / dt**2 + [0, 0, GRAVITY]
  force = np.einsum('nji,nj->ni', world_from_imu[1:-1], force)
  rows = np.arange(0, len(rate), IMU_STEP)
  step = IMU_STEP * dt
  def log(truth, bias, walk, noise):
    factor = 1.0 + 0.5 * spoil
    return (truth[rows] + rng.normal(0, bias, 3) +
            random_walk(len(rows), factor * walk, step, rng) +
            factor * noise / np.sqrt(step) * rng.normal(size=(len(rows), 3)))
  return (motion.t[1:-1][rows], log(rate, 4e-3, GYRO_WALK, GYRO_NOISE),
          log(force, 0.04, ACCEL_WALK, ACCEL_NOISE))


def wheel_log(motion, kind, rng):
  """Times, speeds of both wheels, and begin and end of slips. The speeds have
  unequal radii (for spoil > 0), white noise, and slips of one wheel or both."""
  velocity = np.gradient(motion.position, 1.0 / RATE_HZ, axis=0)
  forward = np.sum(velocity * motion.rotation[:, :, 0], 1)
  yaw_rate = np.sum(np.gradient(motion.rotation[:, :, 0], 1.0 / RATE_HZ, axis=0) *
                    motion.rotation[:, :, 1], 1)
  rows = np.arange(3, len(motion.t) - 3, WHEEL_STEP)
  t = motion.t[rows]
  wheels = np.stack([forward - yaw_rate * TRACK_WIDTH_M / 2,
                     forward + yaw_rate * TRACK_WIDTH_M / 2], 1)[rows]
  wheels *= 1.0 + kind['spoil'] * np.array([0.012, 0.008])
  wheels += rng.normal(0, 0.6 * WHEEL_NOISE, wheels.shape)
  wheels[motion.speed[rows] < 0.01] = 0.0
  slips = []
  for _ in range(kind['num_slips']):
    begin = rng.uniform(0.15, 0.95) * t[-1]
    end = begin + rng.uniform(0.5, 1.5)
    inside = (t > begin) & (t < end)
    which = [[0, 1], [0], [1]][rng.integers(3)]
    wheels[np.ix_(inside, which)] *= rng.uniform(1.3, 1.8)
    slips.append([round(begin, 2), round(end, 2)])
  return t, wheels, sorted(slips)
