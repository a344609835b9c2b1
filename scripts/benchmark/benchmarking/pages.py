# SPDX-License-Identifier: BSD-3-Clause
"""Tables between two markers of a page that is otherwise written by hand."""

import os


def _markers(name):
  return '<!-- table %s: written by a script -->' % name, '<!-- end of table -->'


def write_table(path, name, text):
  """Replaces the text between the markers of a table; a page that does not
  exist is made with nothing else. Raises ValueError unless a page has the
  markers once."""
  begin, end = _markers(name)
  page = '%s\n%s\n' % (begin, end)
  if os.path.exists(path):
    with open(path) as file:
      page = file.read()
  before, found, rest = page.partition(begin)
  _, closed, after = rest.partition(end)
  if not found or not closed or begin in after:
    raise ValueError('%s has not once the lines %s and %s' % (path, begin, end))
  with open(path, 'w') as file:
    file.write('%s%s\n\n%s\n\n%s%s' % (before, begin, text.strip('\n'), end,
                                       after))
