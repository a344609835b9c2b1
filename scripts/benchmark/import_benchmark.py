#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Time and memory of adasfm_prior_importer over the number of images.

A drive at 8 m/s on a winding road is written as a database without features and
as logs (images at 10 Hz, IMU at 200 Hz, wheels at 50 Hz), then imported:

    scripts/benchmark/import_benchmark.py COLMAP [10000 100000 ...]
"""

import argparse
import math
import random
import sqlite3
import struct
import subprocess
import tempfile

from benchmarking.process import Failed, run

SPEED = 8.0
SENSORS = """cam0:
  T_cam_imu: [[0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]]
  timeshift_cam_imu: 0.0
imu0:
  update_rate: 200.0
  gyroscope_noise_density: 5.0e-4
  gyroscope_random_walk: 2.0e-5
  accelerometer_noise_density: 5.0e-3
  accelerometer_random_walk: 2.0e-4
wheel0:
  type: velocity
  speed_noise: 0.05
  yaw_rate_noise: 0.02
  T_imu_wheel: [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
"""


def yaw_rate(seconds):
    return 0.2 * math.sin(0.3 * seconds)


def write_logs(folder, num_images):
    noise = random.Random(1).gauss
    end_s = 0.1 * num_images + 1.0
    with open(f"{folder}/sensors.yaml", "w") as file:
        file.write(SENSORS)
    with open(f"{folder}/imu.csv", "w") as file:
        file.write("#timestamp [ns],wx,wy,wz,ax,ay,az\n")
        for i in range(round(200 * end_s)):
            rate = yaw_rate(i / 200)
            values = [0.0, 0.0, rate, 0.0, SPEED * rate, 9.81]
            values = [v + noise(0, 0.007 if k < 3 else 0.07)
                      for k, v in enumerate(values)]
            file.write(f"{5_000_000 * i}," +
                       ",".join(f"{v:.9g}" for v in values) + "\n")
    with open(f"{folder}/wheel.csv", "w") as file:
        file.write("#timestamp [ns],v [m s^-1],omega [rad s^-1]\n")
        for i in range(round(50 * end_s)):
            file.write(f"{20_000_000 * i},{SPEED + noise(0, 0.05):.9g},"
                       f"{yaw_rate(i / 50) + noise(0, 0.02):.9g}\n")


def write_database(colmap, path, num_images):
    subprocess.run([colmap, "database_creator", "--database_path", path],
                   check=True, stdout=subprocess.DEVNULL)
    database = sqlite3.connect(path)
    camera = sqlite3.Binary(struct.pack("<4d", 500, 500, 320, 240))
    database.execute("INSERT INTO cameras VALUES (1, 1, 640, 480, ?, 1)",
                     (camera,))
    # Image names are their times in nanoseconds.
    database.executemany(
        "INSERT INTO images (image_id, name, camera_id) VALUES (?, ?, 1)",
        ((i + 1, f"{100_000_000 * i + 500_000_000:019d}.png")
         for i in range(num_images)))
    database.commit()
    database.close()


def measure(colmap, num_images):
    with tempfile.TemporaryDirectory() as folder:
        write_logs(folder, num_images)
        write_database(colmap, f"{folder}/database.db", num_images)
        try:
            usage = run(
                [colmap, "adasfm_prior_importer",
                 "--database_path", f"{folder}/database.db",
                 "--sensors_path", f"{folder}/sensors.yaml",
                 "--imu_path", f"{folder}/imu.csv",
                 "--wheel_path", f"{folder}/wheel.csv"], f"{folder}/log")
        except Failed:
            with open(f"{folder}/log") as log:
                raise SystemExit(log.read())
        print(f"{num_images:7d} images: {usage.seconds:6.1f} s, CPU "
              f"{usage.cpu_seconds:6.1f} s, peak memory "
              f"{usage.peak_mib:6.0f} MB", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("colmap", help="the installed colmap")
    parser.add_argument("num_images", nargs="*", type=int,
                        default=[10_000, 30_000, 100_000])
    arguments = parser.parse_args()
    for num_images in arguments.num_images:
        measure(arguments.colmap, num_images)


if __name__ == "__main__":
    main()
