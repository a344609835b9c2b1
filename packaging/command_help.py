# SPDX-License-Identifier: BSD-3-Clause
"""Reads the commands' own help: `colmap help`, `colmap X -h`."""
import collections
import re
import subprocess

Option = collections.namedtuple('Option', 'name default help')
Command = collections.namedtuple('Command', 'name summary description options')


def run(*arguments, stderr=subprocess.DEVNULL):
    return subprocess.run(arguments, check=False, text=True,
                          stdout=subprocess.PIPE, stderr=stderr).stdout


def parse_options(text):
    """Options in a help text of boost::program_options, in its order, of our
    commands or COLMAP's. Help of several lines is joined."""
    options = []
    for line in text.splitlines():
        match = re.match(
            r'  (?:-\w \[ )?--([\w.]+)(?: \])?(?: arg)?(?: \(=(.*?)\))?'
            r'(?:\s+(\S.*))?$', line)
        if match:
            options.append([match[1], match[2], match[3] or ''])
        elif options and re.match(r' {10,}\S', line):
            options[-1][2] = (options[-1][2] + ' ' + line.strip()).strip()
    return [Option(*option) for option in options]


def read_commands(colmap):
    """Our commands, with all information of their help."""
    commands = []
    for name, summary in re.findall(r'^  (adasfm_\w+)\s+(\S.*)$',
                                    run(colmap, 'help'), re.MULTILINE):
        text = run(colmap, name, '-h')
        description = text.split('Options:')[0].split('\n', 1)[1].strip()
        commands.append(Command(name, summary, description,
                                parse_options(text)))
    return commands


def read_host_options(colmap, name):
    """The names of the options of one of COLMAP's own commands, which COLMAP 4
    prints on standard error."""
    text = run(colmap, name, '-h', stderr=subprocess.STDOUT)
    return [option.name for option in parse_options(text)]
