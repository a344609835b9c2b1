# SPDX-License-Identifier: BSD-3-Clause
"""Damages files as disks, editors, other programs and attackers do."""

import os
import re
import sqlite3
import struct

ODD_NUMBERS = [0, 1, -1, 2, 127, 255, 65535, 2**31 - 1, 2**31, 2**32 - 1, 2**32,
               2**61, 2**63 - 1, -2**31, -2**63]
ODD_DOUBLES = [0.0, -0.0, 1e-320, 1e-30, 1e30, 1e300, -1e300, float('nan'),
               float('inf'), float('-inf')]
ODD_WORDS = ['', ' ', 'nan', 'inf', '-inf', '-1', '0', '1e308', '1e-308',
             '9' * 40, '0x10', 'abc', '"', "'", ',', ';', '\t', '\\', '\0',
             '\r', '\ufeff', '[', '{', '%', '#', '../..', 'ä' * 300, '1.5.2',
             '1,5', '--', '!!binary', '&a', '*a']


def pack_odd(generator):
  """The bytes of an unusual number."""
  if generator.random() < 0.5:
    return struct.pack('<d', generator.choice(ODD_DOUBLES))
  number = generator.choice(ODD_NUMBERS)
  if generator.random() < 0.5:
    return struct.pack('<I', number & 0xffffffff)
  return struct.pack('<Q', number & 0xffffffffffffffff)


def damage_bytes(path, generator):
  """Damages the bytes of any file; returns the kind of damage."""
  with open(path, 'rb') as file:
    data = bytearray(file.read())
  what = generator.choice(['empty', 'cut', 'bytes', 'number', 'number',
                           'longer', 'doubled', 'hole', 'swapped'])
  at = generator.randrange(max(1, len(data)))
  to = min(len(data), at + generator.choice([1, 8, 64, 1000]))
  if what == 'empty':
    data = bytearray()
  elif what == 'cut':
    del data[at:]
  elif what == 'bytes':
    for _ in range(generator.choice([1, 10, 1000])):
      if data:
        data[generator.randrange(len(data))] = generator.randrange(256)
  elif what == 'number':
    # Half of the time near the beginning, where counts are.
    if generator.random() < 0.5:
      at = generator.randrange(max(1, min(len(data), 200)))
    odd = pack_odd(generator)
    data[at:at + len(odd)] = odd
  elif what == 'longer':
    data += bytes(generator.randrange(256) for _ in range(50))
  elif what == 'doubled':
    data[at:at] = data[at:to]
  elif what == 'hole':
    del data[at:to]
  else:
    other = generator.randrange(max(1, len(data)))
    part = data[other:other + to - at]
    data[other:other + to - at] = data[at:to]
    data[at:to] = part
  with open(path, 'wb') as file:
    file.write(data)
  return what


def damage_text(path, generator):
  """Replaces words, or drops, repeats or exchanges lines."""
  with open(path, encoding='utf8', errors='surrogateescape', newline='') as file:
    lines = file.read().split('\n')
  at = generator.randrange(len(lines))
  if generator.random() < 0.3:
    at = min(at, generator.randrange(4))
  what = generator.choice(['word', 'word', 'word', 'drop', 'repeat', 'exchange',
                           'all words'])
  words = re.split(r'([,\s:\[\]{}]+)', lines[at])
  odd = generator.choice(ODD_WORDS)
  if what == 'word':
    words[generator.randrange(len(words))] = odd
    lines[at] = ''.join(words)
  elif what == 'drop':
    del lines[at:at + generator.choice([1, 1, 10, 1000])]
  elif what == 'repeat':
    lines[at:at] = [lines[at]] * generator.choice([1, 2, 1000])
  elif what == 'exchange':
    other = generator.randrange(len(lines))
    lines[at], lines[other] = lines[other], lines[at]
  else:
    column = generator.randrange(len(words))
    for i in range(at, len(lines)):
      words = re.split(r'([,\s:\[\]{}]+)', lines[i])
      if column < len(words):
        words[column] = odd
      lines[i] = ''.join(words)
  with open(path, 'w', encoding='utf8', errors='surrogateescape',
            newline='') as file:
    file.write('\n'.join(lines))
  return '%s %r in line %d' % (what, odd[:10], at + 1)


def damage_cell(path, generator):
  """Damages a database: one cell, all cells of a column, a row or a table."""
  database = sqlite3.connect(path)
  try:
    tables = [row[0] for row in database.execute(
        "SELECT name FROM sqlite_master WHERE type = 'table' AND name NOT LIKE "
        "'sqlite%' ORDER BY name")]
    table = generator.choice(tables)
    rows = [row[0] for row in database.execute(
        'SELECT rowid FROM "%s" ORDER BY rowid' % table)]
    if not rows or generator.random() < 0.03:
      database.execute('DROP TABLE "%s"' % table)
      database.commit()
      return 'no table %s' % table
    row = generator.choice(rows)
    if generator.random() < 0.1:
      database.execute('DELETE FROM "%s" WHERE rowid = ?' % table, (row,))
      database.commit()
      return 'no row %d of %s' % (row, table)
    column = generator.choice(list(database.execute(
        'PRAGMA table_info("%s")' % table)))[1]
    old = database.execute('SELECT "%s" FROM "%s" WHERE rowid = ?' %
                           (column, table), (row,)).fetchone()[0]
    value = odd_cell(old, generator)
    where = '' if generator.random() < 0.1 else ' WHERE rowid = %d' % row
    database.execute('UPDATE OR IGNORE "%s" SET "%s" = ?%s' %
                     (table, column, where), (value,))
    database.commit()
    return '%s.%s of row %s is %s' % (table, column, row if where else 'all',
                                      repr(value)[:40])
  finally:
    database.close()


def odd_cell(old, generator):
  if isinstance(old, bytes) and old and generator.random() < 0.8:
    data = bytearray(old)
    odd = pack_odd(generator)
    at = generator.randrange(len(data))
    at -= at % len(odd)
    what = generator.randrange(4)
    if what == 0:
      del data[at:]
    elif what == 1:
      data += data[at:]
    else:
      data[at:at + len(odd)] = odd
    return bytes(data)
  if isinstance(old, str) and generator.random() < 0.8:
    return generator.choice(ODD_WORDS).encode('utf8', 'surrogateescape').decode(
        'utf8', 'replace')
  return generator.choice([
      None, '', 'abc', b'', b'\0' * 7, bytes(96),
      *[max(-2**63, min(2**63 - 1, number)) for number in ODD_NUMBERS],
      *ODD_DOUBLES])


def damage(path, generator):
  """Damages a file, often by its format; returns what was damaged."""
  if path.endswith('.db') and generator.random() < 0.75:
    try:
      return damage_cell(path, generator)
    except (sqlite3.Error, OverflowError):
      pass  # SQLite rejects this value
  if (path.endswith(('.csv', '.yaml', '.txt', '.json', '.ini')) and
      os.path.getsize(path) and generator.random() < 0.75):
    return damage_text(path, generator)
  return damage_bytes(path, generator)
