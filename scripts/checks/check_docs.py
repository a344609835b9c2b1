#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Checks README.md and docs/ against the program:

  scripts/checks/check_docs.py COLMAP [--run] [FILE...]

Every `colmap` command of the text must exist and have the options that it is
shown with; every `--option` and `Group.option` named anywhere must exist; links
to files must lead to a file; and each option's help must explain it, with a
unit and a default. --run runs blocks of ```sh in the order of the text, in a
stand-in for a checkout, with a small rendered drive under the names that the
documentation uses; SMALLER lists the arguments that keep the runs short.
```console REASON is shown only, and listed. --run also runs ```python if the
modules that it imports are installed, and ```cmake in a separate project
against what an earlier `cmake --install` has installed. With a host COLMAP
(ADASFM_HOST_COLMAP) of 3.13 or later, options of NEWER_NAMES get its names."""
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

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / 'packaging'), str(ROOT / 'scripts/benchmark')]
from command_help import read_commands, read_host_options  # noqa: E402
from docs_drive import (  # noqa: E402
    make_checkout, make_drive, write_program)

# Options of other programs that the text may name; the options of our scripts
# are read from the scripts.
OTHER_OPTIONS = {
    'Group.name', 'option', 'install', 'prefix', 'build', 'target', 'simulate',
    'benchmark_filter'}
# Programs that the text may call, besides ours and paths in this repository.
OTHER_PROGRAMS = {
    'cmake', 'export', 'sudo', 'cd', 'cp', 'cpack', 'mkdir', 'sqlite3'}
COMMAND = re.compile(
    r'((colmap|colmap-adasfm|cmake|cpack|sudo)\s|scripts/\w'
    r'|[\w./$"-]*/bin/\w)')
# Arguments appended to a command that is run, so that it takes seconds.
SMALLER = {
    'scripts/benchmark/benchmark.py':
        '--max_num_images 100 --methods adasfm_no_candidates',
    'scripts/benchmark/global_tables.py': '--sizes 100 --num_seeds 1',
    'scripts/benchmark/import_benchmark.py': '200',
    'scripts/benchmark/profile.sh': '20',
    'scripts/setup.sh': '--configure-only',
    'cmake --build build ': '--target adasfm_core',
    'build-fuzz/bin/': '-max_total_time=2',
    'build/bin/benchmark_sensors':
        '--benchmark_min_time=0 --benchmark_filter=/1000/',
    'build/bin/benchmark_global':
        '--benchmark_min_time=0 --benchmark_filter=Tracks/500',
    'build/bin/benchmark_partition': '--benchmark_min_time=0',
    'build/bin/benchmark_colmap_ext':
        '--benchmark_min_time=0 --benchmark_filter=/100/',
    'sudo apt install': '--simulate',
}
# Options that COLMAP 3.13 has moved, which the text names beside the older ones.
NEWER_NAMES = {'SiftExtraction.use_gpu': 'FeatureExtraction.use_gpu',
               'SiftMatching.use_gpu': 'FeatureMatching.use_gpu'}
# Commands that run in fresh/, where nothing has been built yet.
FRESH = re.compile(r'scripts/setup\.sh|cmake -[SB]')
# Blocks with the word are left out, with a message, if the command fails.
NEEDS = [('clang++', ['clang++', '--version']),
         ('profile.sh', ['perf', 'record', '-q', '-e', 'cpu-clock', '-o',
                         '/dev/null', 'true'])]
# The message of our program when it was built without an optional library.
NOT_BUILT = 'this build cannot read ROS bags'
# Units by the suffix of an option's name; the longest suffix that fits counts,
# so _m_s is not _s.
UNITS = {'px': r'\[px', 'deg': r'\[deg', 'm': r'\[m', 's': r'\[s',
         'm_s': r'\[m/s', 'm_s2': r'\[m/s\^2', 'rad_s': r'\[rad/s', 'per_m': r'/m\]',
         'm_s_sqrt_hz': r'\[m/s/sqrt\(Hz', 'rad_sqrt_s': r'\[rad/sqrt\(s',
         'hz': r'\[Hz', 'rad': r'\[rad', 'gb': r'\[GB'}

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


def spell_for(colmap):
    """A function that replaces option names in a line by the host's names."""
    is_newer = ('FeatureExtraction.use_gpu' in
                set(read_host_options(colmap, 'feature_extractor')))

    def spell(line):
        for older, newer in NEWER_NAMES.items() if is_newer else ():
            line = line.replace(older, newer)
        return line
    return spell


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
        self.known = set(OTHER_OPTIONS).union(
            NEWER_NAMES, NEWER_NAMES.values())
        self.spell = spell_for(colmap)
        for script in sorted((ROOT / 'scripts').rglob('*.[ps][yh]')):
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
        lines = list(map(self.spell, read_lines(lines)))
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
            for script in re.findall(r'`(scripts/[\w./]+)', line):
                if not (ROOT / script).exists():
                    fail(where, 'there is no ' + script)
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
                suffixes = [suffix for suffix in UNITS
                            if option.name.endswith('_' + suffix)]
                if suffixes and not re.search(UNITS[max(suffixes, key=len)],
                                              option.help):
                    fail(where, 'has no unit in its help: ' + option.help)


def make_smaller(line):
    line = re.sub(r'\s+# .*', '', line)
    for beginning, arguments in SMALLER.items():
        if (line + ' ').startswith(beginning):
            return line + ' ' + arguments
    return line


def is_there(command):
    try:
        return subprocess.run(command, stdout=subprocess.DEVNULL, check=False,
                              stderr=subprocess.DEVNULL).returncode == 0
    except FileNotFoundError:
        return False


class Runner:
    """Runs blocks in a folder that looks like a checkout."""

    def __init__(self, colmap, folder):
        self.folder = folder
        self.log = folder / 'log'
        colmap = pathlib.Path(colmap).resolve()
        build = colmap.parent.parent
        make_checkout(ROOT, folder, build)
        self.words = {'FX,FY,CX,CY': make_drive(colmap, folder)}
        self.spell = spell_for(colmap)
        cache = (build / 'CMakeCache.txt').read_text()
        self.colmap_dir = re.search(r'^COLMAP_DIR:\w+=(.*)$', cache,
                                    re.MULTILINE)[1]
        if self.colmap_dir.endswith('/share/colmap'):
            self.words['PREFIX'] = self.colmap_dir[:-len('/share/colmap')]
        programs = folder / 'programs'
        programs.mkdir()
        (programs / 'colmap').symlink_to(colmap)
        # Commands run without root; apt only simulates (SMALLER).
        write_program(programs / 'sudo', 'exec "$@"')
        self.environment = dict(
            os.environ, PATH='%s:%s' % (programs, os.environ['PATH']),
            # cmake --install installs into the folder, not into the system.
            DESTDIR=str(folder / 'installed'),
            # ccache reuses objects of a run in another folder.
            CCACHE_BASEDIR=str(folder), CCACHE_NOHASHDIR='1')
        for name in ('ADASFM_BUILD_DIR', 'COLMAP'):
            self.environment.pop(name, None)

    def call(self, command, folder):
        with open(self.log, 'wb') as file:
            return subprocess.run(command, cwd=folder, stdout=file,
                                  stderr=file, env=self.environment,
                                  check=False).returncode

    def build_project(self, lines):
        project = self.folder / 'mine'
        project.mkdir()
        (project / 'CMakeLists.txt').write_text('\n'.join(
            ['cmake_minimum_required(VERSION 3.18)', 'project(mine CXX)',
             'add_executable(mine main.cc)'] + lines))
        (project / 'main.cc').write_text('int main() { return 0; }\n')
        code = self.call(
            ['cmake', '-S', '.', '-B', 'build', '-DCMAKE_PREFIX_PATH=%s' %
             (self.folder / 'installed/usr/local'),
             '-DCOLMAP_DIR=' + self.colmap_dir], project)
        return code or self.call(['cmake', '--build', 'build'], project)

    def run(self, language, lines):
        """The exit code, and why the block was left out."""
        if language == 'python':
            text = '\n'.join(lines)
            modules = re.findall(r'^import (\w+)', text, re.MULTILINE)
            if not all(map(importlib.util.find_spec, modules)):
                return 0, 'its modules are not installed'
            return self.call([sys.executable, '-c', text], self.folder), ''
        if language == 'cmake':
            return self.build_project(lines), ''
        text = self.spell('\n'.join(map(make_smaller, read_lines(lines))))
        for word, value in self.words.items():
            text = text.replace(word, value)
        if 'PREFIX' in text:
            return 0, 'COLMAP_DIR of the build does not end in share/colmap'
        if 'bin/benchmark_' in text and not (
                self.folder / 'build/bin/benchmark_global').exists():
            return 0, 'the benchmarks are not built'
        for word, command in NEEDS:
            if word in text and not is_there(command):
                return 0, command[0] + ' cannot be used here'
        folder = self.folder / 'fresh' if FRESH.search(text) else self.folder
        code = self.call(['bash', '-euo', 'pipefail', '-c', text], folder)
        if code and NOT_BUILT in self.log.read_text():
            return 0, NOT_BUILT
        return code, ''


def run_blocks(colmap, files):
    with tempfile.TemporaryDirectory() as name:
        runner = Runner(colmap, pathlib.Path(name))
        for path in files:
            for number, language, lines in read_blocks(path):
                if language not in ('sh', 'python', 'cmake'):
                    continue
                where = '%s:%d' % (path.name, number)
                start = time.monotonic()
                code, why = runner.run(language, lines)
                print('left out, as %s: %s' % (why, where) if why else
                      'ran %s (%.1f s)' % (where, time.monotonic() - start),
                      flush=True)
                if code:
                    fail(where, 'exit code %d:\n%s' %
                         (code, runner.log.read_text()[-2000:]))


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument('colmap')
    parser.add_argument('files', nargs='*', type=pathlib.Path)
    parser.add_argument('--run', action='store_true')
    arguments = parser.parse_intermixed_args()
    files = arguments.files or [ROOT / 'README.md'] + sorted(
        (ROOT / 'docs').rglob('*.md'))
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
