#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Writes the manual page, and one of each command, from the commands' own help,
so that they cannot go stale: make_man_page.py COLMAP VERSION FOLDER"""
import gzip
import pathlib
import re
import sys

from command_help import read_commands

INTRODUCTION = r'''.SH NAME
colmap\-adasfm \- Structure from Motion with IMU and wheel priors
.SH SYNOPSIS
.B colmap\-adasfm
.I command
.RI [ \-\-option
.IR value ]...
.br
.B colmap\-adasfm
.I command
.B \-h
.SH DESCRIPTION
Runs the commands below itself and hands every other command line, unchanged,
to COLMAP's own
.BR colmap .
All work on ordinary COLMAP databases and write ordinary COLMAP models. Logs of
an IMU and of wheel encoders make the result reliable and metric; without them
everything still runs.
.PP
In a folder of its own,
.IR lib/adasfm/bin ,
the program is installed under the name
.B colmap
as well: with that folder first on the PATH there is one
.B colmap
with all commands.
'''

END = r'''.SH PROJECT FILES
.B \-\-project_path
names an .ini file with a command's options:
.IR name=value ,
and sections
.RI [ Group ]
for
.IR \-\-Group.name .
The command line wins.
.SH ENVIRONMENT
.TP
.B ADASFM_HOST_COLMAP
COLMAP's own executable. Without it the one that was there when the program was
built, else the first other
.B colmap
on the PATH.
.SH EXIT STATUS
0 on success, 1 on failure, with one line on standard error that says what, which
file, and what to do.
.SH SEE ALSO
.BR colmap (1);
the documentation in
.I share/doc/colmap\-adasfm/docs
'''


def escape(text):
    text = text.replace('\\', r'\e').replace('-', r'\-')
    return re.sub(r"^([.'])", r'\\&\1', text)


def format_option(option):
    name = r'\fB\-\-' + escape(option.name) + r'\fR'
    if option.name == 'help':
        name = r'\fB\-h\fR, ' + name
    elif option.default is None:
        name += r' \fIvalue\fR'
    else:
        name += r' \fIvalue\fR'
        if option.default:
            name += ' (' + escape(option.default) + ')'
    return '.TP\n%s\n%s\n' % (name, escape(option.help or ' '))


def make_command_page(command):
    """A page of its own, for `man adasfm_mapper`."""
    name = escape(command.name)
    page = '.SH NAME\n%s \\- %s\n' % (name, escape(command.summary))
    page += '.SH SYNOPSIS\n.B colmap\\-adasfm %s\n' % name
    page += '.RI [ \\-\\-option\n.IR value ]...\n'
    page += '.SH DESCRIPTION\n%s\n' % escape(command.description)
    page += '.SH OPTIONS\nDefaults stand in parentheses.\n'
    page += ''.join(map(format_option, command.options))
    return page + '.SH SEE ALSO\n.BR colmap\\-adasfm (1)\n'


def write_page(folder, name, version, text):
    page = '.\\" Made from the commands\' own help.\n'
    page += '.TH %s 1 "" "adasfm %s" "User commands"\n' % (
        escape(name.upper()), version)
    # Without a time stamp, the same page is the same file.
    with gzip.GzipFile(folder / (name + '.1.gz'), 'wb', 9, mtime=0) as file:
        file.write((page + text).encode())


def main():
    colmap, version, folder = sys.argv[1:]
    folder = pathlib.Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    commands = read_commands(colmap)
    if not commands:
        sys.exit('make_man_page.py: %s lists no commands' % colmap)
    page = INTRODUCTION + '.SH COMMANDS\nDefaults stand in parentheses.\n'
    for command in commands:
        page += '.SS %s\n%s\n' % (escape(command.name),
                                  escape(command.description))
        page += ''.join(map(format_option, command.options))
        write_page(folder, command.name, version, make_command_page(command))
    write_page(folder, 'colmap-adasfm', version, page + END)


if __name__ == '__main__':
    main()
