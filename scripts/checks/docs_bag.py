# SPDX-License-Identifier: BSD-3-Clause
"""A ROS 1 bag (format 2.0) of a drive's logs, without ROS."""
import math
import struct

IMU = ('/imu/data', 'sensor_msgs/Imu', '6a62c6daae103f4ff57a132d6f95cec2')
ODOMETRY = ('/odom', 'nav_msgs/Odometry', 'cd5e73d190d741a2f92e81eda573aca7')
NS = 10 ** 9


def pack_record(fields, data):
    """Header fields are name=value; numbers are little-endian."""
    header = b''
    for name, value in fields.items():
        if isinstance(value, str):
            value = value.encode()
        field = name.encode() + b'=' + value
        header += struct.pack('<I', len(field)) + field
    return (struct.pack('<I', len(header)) + header +
            struct.pack('<I', len(data)) + data)


def u32(*values):
    return struct.pack('<%dI' % len(values), *values)


def u64(value):
    return struct.pack('<Q', value)


def pack_time(time_ns):
    return u32(time_ns // NS, time_ns % NS)


def pack_fields(fields):
    return pack_record(fields, b'')[4:-4]


def pack_header(number, time_ns):
    frame = b'base'
    return u32(number) + pack_time(time_ns) + u32(len(frame)) + frame


def pack_imu(number, time_ns, gyro, acceleration):
    return (pack_header(number, time_ns) +
            struct.pack('<4d', 0, 0, 0, 1) + bytes(72) +
            struct.pack('<3d', *gyro) + bytes(72) +
            struct.pack('<3d', *acceleration) + bytes(72))


def pack_odometry(number, time_ns, x, y, yaw):
    child = b'wheels'
    return (pack_header(number, time_ns) + u32(len(child)) + child +
            struct.pack('<7d', x, y, 0, 0, 0, math.sin(yaw / 2),
                        math.cos(yaw / 2)) + bytes(36 * 8) +
            bytes(6 * 8) + bytes(36 * 8))


def write_bag(path, messages):
    """messages: (time_ns, topic as above, serialised message)."""
    topics = [IMU, ODOMETRY]
    connections = [pack_record(
        {'op': b'\x07', 'conn': u32(i), 'topic': topic},
        pack_fields({'topic': topic, 'type': name, 'md5sum': md5,
                     'message_definition': ''}))
        for i, (topic, name, md5) in enumerate(topics)]
    chunk = b''.join(connections)
    index = [b'', b'']
    for time_ns, topic, data in messages:
        i = topics.index(topic)
        index[i] += pack_time(time_ns) + u32(len(chunk))
        chunk += pack_record({'op': b'\x02', 'conn': u32(i),
                              'time': pack_time(time_ns)}, data)
    counts = [len(entries) // 12 for entries in index]
    body = pack_record({'op': b'\x05', 'compression': 'none',
                        'size': u32(len(chunk))}, chunk)
    body += b''.join(pack_record(
        {'op': b'\x04', 'ver': u32(1), 'conn': u32(i), 'count': u32(counts[i])},
        index[i]) for i in range(2))
    magic = b'#ROSBAG V2.0\n'
    chunk_position = len(magic) + 4096
    header = {'op': b'\x03', 'index_pos': u64(chunk_position + len(body)),
              'conn_count': u32(2), 'chunk_count': u32(1)}
    padding = b' ' * (4096 - len(pack_record(header, b'')))
    times = [time_ns for time_ns, _, _ in messages]
    info = pack_record(
        {'op': b'\x06', 'ver': u32(1), 'chunk_pos': u64(chunk_position),
         'start_time': pack_time(min(times)), 'end_time': pack_time(max(times)),
         'count': u32(2)}, u32(0, counts[0], 1, counts[1]))
    with open(path, 'wb') as file:
        file.write(magic + pack_record(header, padding) + body +
                   b''.join(connections) + info)


def read_log(path):
    """(time_ns, values) of each line."""
    rows = [line.split(',') for line in path.read_text().splitlines()
            if not line.startswith('#')]
    return [(int(row[0]), list(map(float, row[1:]))) for row in rows]


def write_drive_bag(folder, track_width):
    """drive.bag from imu.csv and wheel.csv: speeds become poses."""
    messages = [(time_ns, IMU, pack_imu(i, time_ns, v[:3], v[3:]))
                for i, (time_ns, v) in enumerate(read_log(folder / 'imu.csv'))]
    x = y = yaw = 0.0
    last_ns = None
    for i, (time_ns, (left, right)) in enumerate(
            read_log(folder / 'wheel.csv')):
        step_s = (time_ns - last_ns) / NS if last_ns else 0.0
        last_ns = time_ns
        turn = (right - left) / track_width * step_s
        x += (left + right) / 2 * step_s * math.cos(yaw + turn / 2)
        y += (left + right) / 2 * step_s * math.sin(yaw + turn / 2)
        yaw += turn
        messages.append((time_ns, ODOMETRY,
                         pack_odometry(i, time_ns, x, y, yaw)))
    write_bag(folder / 'drive.bag', sorted(messages))
