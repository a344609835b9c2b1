#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Checks that README.md and docs/ say what the program does:

  scripts/check_docs.py COLMAP [--run] [FILE...]

Every `colmap` command of the text must exist and have the options that it is
shown with; every `--option` and `Group.option` named anywhere must exist; links
to files must lead somewhere; and each option's help must explain it, with a unit
and a default. Blocks of commands are ```sh, which --run runs in the order of the
text, on a small rendered drive that lies in the folder under the names the
documentation uses; or ```console REASON, which are shown only, and listed.
```python is run as well where the modules that it wants are installed."""
import argparse
import importlib.util
import os
import pathlib
import re
import shlex
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / 'packaging'))
from command_help import read_commands, read_host_options  # noqa: E402
from docs_drive import make_drive  # noqa: E402

# Options of other programs that the text may name; those of our scripts are read
# from them.
OTHER_OPTIONS = {
    'import_path', 'Group.name', 'option', 'install', 'prefix', 'bag',
    'topics', 'models', 'cam', 'imu', 'target', 'build', 'host',
    'benchmark_filter'}
# What the first word of a shown command may be, besides ours and paths in this
# repository.
OTHER_PROGRAMS = {
    'cmake', 'export', 'sudo', 'cd', 'cp', 'cpack', 'mkdir', 'rosrun',
    'sqlite3'}
COMMAND = re.compile(
    r'((colmap|colmap-adasfm|cmake|cpack|sudo|rosrun)\s|scripts/\w'
    r'|[\w./$"-]*/bin/\w)')
UNITS = {'px': r'\[px', 'deg': r'\[deg', 'm': r'\[m', 's': r'\[s',
         'm_s': r'\[m/s', 'hz': r'\[Hz', 'rad': r'\[rad', 'gb': r'\[GB'}

failures = []


def fail(where, what):
    failures.append('%s: %s' % (where, what))
    print(failures[-1], file=sys.stderr)


def read_blocks(path):
    """(line number, language, lines) of each fenced or indented block."""
    blocks, fence, indented = [], None, None
    for number, line in enumerate(path.read_text().splitlines(), 1):
        match = re.match(r'\s*```(.*)', line)
        if match and fence is None:
            fence = (number + 1, match[1].strip(), [])
        elif match:
            blocks.append(fence)
            fence = None
        elif fence is not None:
            fence[2].append(line)
        elif line.startswith('    ') and line.strip():
            if indented is None:
                indented = (number, '', [])
                blocks.append(indented)
            indented[2].append(line.strip())
        elif line.strip():
            indented = None
    return blocks


def read_lines(lines):
    """Logical lines: continuations joined, comments and empty ones left out."""
    text = '\n'.join(lines).replace('\\\n', ' ')
    return [line.strip() for line in text.split('\n')
            if line.strip() and not line.strip().startswith('#')]


class Checker:
    def __init__(self, colmap):
        self.colmap = colmap
        self.commands = {c.name: c for c in read_commands(colmap)}
        if not self.commands:
            sys.exit('%s lists no commands' % colmap)
        self.host_options = {}
        self.shown = []  # where, and why not run
        self.known = set(OTHER_OPTIONS)
        for script in sorted((ROOT / 'scripts').glob('*.[ps][yh]')):
            self.known.update(re.findall(r'--([a-z][\w-]+)',
                                         script.read_text()))
        for command in self.commands.values():
            self.known.update(option.name for option in command.options)

    def options_of(self, name):
        if name in self.commands:
            return {option.name for option in self.commands[name].options}
        if name not in self.host_options:
            self.host_options[name] = set(read_host_options(self.colmap, name))
            self.known.update(self.host_options[name])
        return self.host_options[name]

    def check_command(self, where, words):
        name = words[1] if len(words) > 1 else 'help'
        if name in ('help', '-h', 'gui'):
            return
        if name.startswith('adasfm_') and name not in self.commands:
            fail(where, 'there is no command ' + name)
            return
        options = self.options_of(name)
        if not options:
            fail(where, 'COLMAP has no command ' + name)
        for word in words[2:]:
            option = re.match(r'--([\w.]+)', word)
            if option and option[1] not in options:
                fail(where, '%s has no option %s' % (name, word))

    def check_block(self, path, block):
        number, language, lines = block
        where = '%s:%d' % (path.name, number)
        language, _, reason = language.partition(' ')
        lines = read_lines(lines)
        if language == 'console':
            self.shown.append('%s: %s' % (where, reason))
            if not reason:
                fail(where, 'does not say why it is shown only')
        elif language != 'sh':
            if language in ('', 'bash') and any(map(COMMAND.match, lines)):
                fail(where, 'commands are ```sh, or ```console with a reason')
            return
        for line in lines:
            try:
                words = shlex.split(line, comments=True)
            except ValueError as error:
                fail(where, str(error))
                continue
            program = words[0] if words else ''
            if os.path.basename(program) in ('colmap', 'colmap-adasfm'):
                self.check_command(where, words)
            elif program.startswith('scripts/'):
                if not (ROOT / program).exists():
                    fail(where, 'there is no ' + program)
            elif not (program in OTHER_PROGRAMS or '=' in program or
                      program.startswith('build')):
                fail(where, 'unknown program: ' + program)

    def check_names(self, path):
        """Options and files that the text names."""
        for number, line in enumerate(path.read_text().splitlines(), 1):
            where = '%s:%d' % (path.name, number)
            names = re.findall(r'(?<![\w-])--([A-Za-z][\w.-]*\w)', line)
            names += re.findall(r'\b(AdaSfm\w+\.\w+)', line)
            for name in names:
                if name not in self.known and not name.startswith('Kalibr'):
                    if not any(known.startswith(name + '.')
                               for known in self.known):
                        fail(where, 'no command has the option --' + name)
            for command in re.findall(r'`(colmap adasfm_[^`]*)`', line):
                self.check_command(where, command.split())
            for link in re.findall(r'\]\(([^)#]+)(?:#[^)]*)?\)', line):
                if not re.match(r'\w+:', link) and not (
                        path.parent / link).exists():
                    fail(where, 'the link leads nowhere: ' + link)

    def check_help(self):
        for command in self.commands.values():
            for option in command.options:
                where = '%s --%s' % (command.name, option.name)
                # One word, or values alone, explain nothing.
                if len(re.findall(r'[a-z]{2,}', option.help)) < 3:
                    fail(where, 'is not explained by: ' + option.help)
                if (option.default is None and '(required)' not in option.help
                        and option.name not in ('help', 'project_path')):
                    fail(where, 'has no default and is not required')
                for suffix, unit in UNITS.items():
                    if option.name.endswith('_' + suffix) and not re.search(
                            unit, option.help):
                        # _m_s is no _s.
                        if suffix == 's' and option.name.endswith(
                                ('_m_s', '_rad_s')):
                            continue
                        fail(where, 'has no unit in its help: ' + option.help)


def run_block(folder, language, text, log):
    """The exit code; None when it needs what is not installed."""
    if language == 'python':
        modules = re.findall(r'^import (\w+)', text, re.MULTILINE)
        if not all(map(importlib.util.find_spec, modules)):
            compile(text, 'block', 'exec')
            return None
        command = [sys.executable, '-c', text]
    else:
        command = ['bash', '-euo', 'pipefail', '-c', text]
    environment = dict(os.environ, PATH='%s/bin:%s' %
                       (folder, os.environ['PATH']))
    with open(log, 'wb') as file:
        return subprocess.run(command, cwd=folder, env=environment,
                              stdout=file, stderr=file, check=False).returncode


def run_blocks(colmap, files):
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        camera = make_drive(colmap, folder)
        (folder / 'bin').mkdir()
        (folder / 'bin/colmap').symlink_to(pathlib.Path(colmap).resolve())
        (folder / 'scripts').symlink_to(ROOT / 'scripts')
        log = folder / 'log'
        for path in files:
            for number, language, lines in read_blocks(path):
                if language not in ('sh', 'python'):
                    continue
                text = '\n'.join(lines).replace('FX,FY,CX,CY', camera)
                where = '%s:%d' % (path.name, number)
                start = time.monotonic()
                code = run_block(folder, language, text, log)
                print('%s %s (%.1f s)' % (
                    'compiled, modules are missing:' if code is None else
                    'ran', where, time.monotonic() - start), flush=True)
                if code:
                    fail(where, 'exit code %d:\n%s' %
                         (code, log.read_text()[-2000:]))


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument('colmap')
    parser.add_argument('files', nargs='*', type=pathlib.Path)
    parser.add_argument('--run', action='store_true')
    arguments = parser.parse_intermixed_args()
    files = arguments.files or [ROOT / 'README.md'] + sorted(
        (ROOT / 'docs').glob('*.md'))
    checker = Checker(arguments.colmap)
    checker.check_help()
    for path in files:
        for block in read_blocks(path):
            checker.check_block(path, block)
    for path in files:
        checker.check_names(path)
    print('shown, not run:', *checker.shown, sep='\n  ')
    if arguments.run and not failures:
        run_blocks(arguments.colmap, files)
    if failures:
        sys.exit('docs: %d mistakes' % len(failures))
    print('docs: ok')


if __name__ == '__main__':
    main()
