#!/usr/bin/python3
"""Damages the files of runs and makes reports of them.

attack.py HANDSIM SOURCE FOLDER [--every N] [--seed S] [--browser]: of all damages each N-th one, with --browser each accepted
page is opened in Chromium. Oracles: `report` ends within its time and memory with status 0 or 2; with 2 it names the damaged file
or its folder, and leaves the page that was there as it was; with 0 its page has parsable data and no tag of the damage; the
browser reports nothing.
"""
import argparse
import json
import os
import pathlib
import random
import resource
import shutil
import socket
import subprocess
import sys

HOSTILE = '</script><script>window.hostile=1</script><img src=x onerror="window.hostile=1">'
SECONDS, BYTES = 60, 3 << 30
VALUES = [None, True, -1, 1e308, '', HOSTILE, [], {}, [1], {'a': 1}]


def special(kind):
    def make(path):
        path.unlink()
        if kind == 'fifo':
            os.mkfifo(path)
        elif kind == 'folder':
            path.mkdir()
        elif kind == 'socket':
            with socket.socket(socket.AF_UNIX) as server:
                os.chdir(path.parent)
                server.bind(path.name)
        elif kind == 'sparse':
            with path.open('wb') as file:
                file.truncate(20 << 30)
        elif kind == 'sparse_line':
            with path.open('wb') as file:
                file.truncate(1 << 30)
        elif kind == 'unreadable' and os.getuid() == 0:
            path.symlink_to('/proc/self/mem')
        elif kind == 'unreadable':
            path.touch(0)
        elif kind != 'missing':
            path.symlink_to({'zero': '/dev/zero', 'terminal': '/dev/tty', 'loop': path.name, 'broken': 'nowhere', 'long': '/' + 300 * 'x',
                             'below': path.name + '/x', 'self': '.'}[kind])
    return make


def content(change):
    return lambda path: path.write_bytes(change(path.read_bytes()))


def cells(change):
    """Changes the table's rows, each a list of fields, after its head."""
    def apply(path):
        text, separator = path.read_text(), ',' if path.suffix == '.csv' else '\t'
        head, rows = ('', text) if path.suffix == '.csv' else text.split('endheader\n')
        rows = change([line.split(separator) for line in rows.splitlines()])
        path.write_text((head and head + 'endheader\n') + ''.join(separator.join(row) + '\n' for row in rows))
    return apply


def cell(row, column, value):
    def change(rows):
        rows[row if abs(row) < len(rows) else -1][column] = value
        return rows
    return cells(change)


def key(path_of_key, value, remove=False):
    def apply(path):
        data = json.loads(path.read_text())
        at = data
        for step in path_of_key[:-1]:
            at = at[step]
        if remove:
            del at[path_of_key[-1]]
        else:
            at[path_of_key[-1]] = value
        path.write_text(json.dumps(data))
    return apply


def keys(data, depth=3):
    """Keys of a JSON text, of lists the first entry alone."""
    items = data.items() if isinstance(data, dict) else list(enumerate(data))[:1] if isinstance(data, list) else []
    for name, value in items:
        yield [name]
        if depth > 1:
            yield from ([name, *rest] for rest in keys(value, depth - 1))


def damages(run, other, chance):
    """(file, what, function) for each damage of a run's folder; `other` is the folder of another scene's run."""
    files = sorted(path.name for path in run.iterdir() if path.suffix in ('.csv', '.sto', '.json', '.yaml'))
    for name in files:
        for kind in ('fifo', 'folder', 'socket', 'sparse', 'sparse_line', 'unreadable', 'missing', 'zero', 'terminal', 'loop', 'broken', 'long',
                     'below', 'self'):
            yield name, kind, special(kind)
        for share in (0, 0.001, 0.3, 0.7, 0.999):
            yield name, f'cut at {share}', content(lambda b, share=share: b[:int(share * len(b))])
        yield name, 'NUL', content(lambda b: bytes(len(b)))
        yield name, 'CR LF', content(lambda b: b.replace(b'\n', b'\r\n'))
        yield name, 'BOM', content(lambda b: b'\xef\xbb\xbf' + b)
        yield name, 'twice', content(lambda b: b + b)
        yield name, 'a tag', content(lambda b: HOSTILE.encode() + b)
        for i in range(6):
            seed = chance.randrange(1 << 30)
            yield name, f'noise {seed}', content(lambda b, seed=seed: noise(b, seed))
        for source in [*(run / f for f in files if f != name), other / name]:
            if source.exists():
                yield name, f'as {source.parent.name}/{source.name}', (lambda path, source=source: shutil.copy(source, path))
        if name.endswith(('.csv', '.sto')):
            for value in ('nan', '-nan', 'inf', '1e308', '-1e39', '1e-320', '', ' 1', '0x1p3', HOSTILE, 'x' * 100_000):
                for row, column in ((1, 0), (1, 1), (5, -1), (-1, 0), (-1, 3), (-1, 5)):
                    yield name, f'{value[:20]} at {row}, {column}', cell(row, column, value)
            for column in (0, 1, -1):
                yield name, f'a tag in the head at {column}', cell(0, column, HOSTILE)
            yield name, 'rows backwards', cells(lambda rows: rows[:1] + rows[:0:-1])
            yield name, 'rows twice', cells(lambda rows: rows[:1] + [row for row in rows[1:] for _ in (0, 1)])
            yield name, 'head alone', cells(lambda rows: rows[:1])
            yield name, 'one row', cells(lambda rows: rows[:2])
            yield name, 'a column less', cells(lambda rows: [row[:-1] for row in rows])
            yield name, 'a column more', cells(lambda rows: [row + row[-1:] for row in rows])
            yield name, 'a field less', cells(lambda rows: rows[:-1] + [rows[-1][:-1]])
            yield name, 'zeros', cells(lambda rows: rows[:1] + [[row[0]] + ['0'] * (len(row) - 1) for row in rows[1:]])
            yield name, 'times near each other', cells(lambda rows: rows[:1] + [[f'{1e9 + 1e-6 * i:.12g}', *r[1:]] for i, r in enumerate(rows[1:])])
        if name == 'summary.json':
            for steps in keys(json.loads((run / name).read_text())):
                yield name, f'{steps} removed', key(steps, None, True)
                for value in VALUES:
                    yield name, f'{steps} is {str(value)[:20]}', key(steps, value)
            for text in ('null', '[]', '{}', '"x"', '[' * 100_000, '{"criteria": []}', '{"a":' * 100_000):
                yield name, text[:20], content(lambda b, text=text: text.encode())
    for name in ('control.sto', 'muscles.sto', 'contacts.csv', 'monitor.csv'):
        if not (run / name).exists():
            yield name, 'of another run', lambda path: shutil.copy(other / path.name, path) if (other / path.name).exists() else path.touch()


def noise(data, seed):
    out, chance = bytearray(data), random.Random(seed)
    for _ in range(chance.choice((1, 5, 50))):
        out[chance.randrange(len(out))] = chance.choice((chance.randrange(256), ord('0'), ord('-'), ord(','), ord('\n'), ord('e'), ord('9')))
    return bytes(out)


class Attack:
    def __init__(self, handsim, source, folder):
        self.handsim, self.source, self.folder = handsim, source, folder
        self.counts, self.faults, self.pages = {0: 0, 2: 0}, [], []
        # The shadow memory of a sanitized program is larger than any limit.
        self.bytes = None if b'__asan_init' in handsim.read_bytes() else BYTES

    def run(self, *words, seconds=SECONDS, bytes_of_memory=None):
        limit = bytes_of_memory and (lambda: resource.setrlimit(resource.RLIMIT_AS, (bytes_of_memory, bytes_of_memory)))
        return subprocess.run([self.handsim, *map(str, words)], capture_output=True, text=True, errors='replace', cwd=self.source,
                              timeout=seconds, preexec_fn=limit, stdin=subprocess.DEVNULL)

    def make_runs(self):
        shutil.rmtree(self.folder, ignore_errors=True)
        self.folder.mkdir(parents=True)
        out = []
        for name, scene, *settings in (('contacts', 'dropped_hand', 'duration=0.4', 'record.bodies=true', 'record.every=0.02'),
                                       ('muscles', 'muscle_poses', 'duration=0.1')):
            words = [word for setting in settings for word in ('--set', setting)]
            done = self.run('run', f'config/{scene}.yaml', '--out', self.folder / name, '--report', '--quiet', *words, seconds=600)
            assert done.returncode in (0, 1) and (self.folder / name / 'report.html').exists(), done.stderr
            out.append(self.folder / name)
        return out

    def damage(self, run, name, what, change, keep):
        """Reports on a damaged copy; `keep`: where to put its page."""
        copy = self.folder / 'copy'
        shutil.rmtree(copy, ignore_errors=True)
        shutil.copytree(run, copy)
        change(copy / name)
        page = copy / 'report.html'
        before = page.read_bytes()
        where = f'{run.name}/{name}: {what}'
        try:
            done = self.run('report', copy, bytes_of_memory=self.bytes)
        except subprocess.TimeoutExpired:
            self.faults.append(f'{where}: takes longer than {SECONDS} s')
            return
        self.counts[done.returncode] = self.counts.get(done.returncode, 0) + 1
        if done.returncode == 2:
            if str(copy) not in done.stderr or not done.stderr.isprintable() and not done.stderr.replace('\n', '').isprintable():
                self.faults.append(f'{where}: message {done.stderr[:300]!r}')
            if page.read_bytes() != before:
                self.faults.append(f'{where}: refused, but the page has changed')
        elif done.returncode == 0:
            text = page.read_text()
            data = text.split('id="data">')[1].split('</script>')[0]
            try:
                json.loads(data)
            except ValueError as error:
                self.faults.append(f'{where}: data {error}')
            if text.count('<script') != before.decode().count('<script') or '<img' in data:
                self.faults.append(f'{where}: a tag in the page')
            if keep:
                shutil.copy(page, keep)
                self.pages.append((where, keep))
        else:
            self.faults.append(f'{where}: status {done.returncode}: {done.stderr[:300]!r}')

    def open_pages(self):
        from chromium import DRAWN, browser
        driver = browser()
        for where, page in self.pages:
            driver.get_log('browser')
            driver.get(page.as_uri())
            driver.execute_async_script(DRAWN)
            problems = [entry['message'] for entry in driver.get_log('browser') if entry['level'] == 'SEVERE']
            if problems or driver.execute_script('return window.hostile || !window.handsimReport'):
                self.faults.append(f'{where}: in the browser: {problems}')
        driver.quit()


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('paths', nargs=3, type=pathlib.Path, metavar=('HANDSIM SOURCE FOLDER'.split()))
    parser.add_argument('--every', type=int, default=1)
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--browser', action='store_true')
    arguments = parser.parse_args()
    attack = Attack(*(path.resolve() for path in arguments.paths))
    runs, chance = attack.make_runs(), random.Random(arguments.seed)
    all_damages = [(run, *damage) for run, other in zip(runs, runs[::-1]) for damage in damages(run, other, chance)]
    chosen = all_damages[arguments.seed % arguments.every::arguments.every]
    for i, damage in enumerate(chosen):
        attack.damage(*damage, attack.folder / f'page_{i}.html' if arguments.browser else None)
    if arguments.browser:
        attack.open_pages()
    print(f'{len(chosen)} of {len(all_damages)} damages: {attack.counts[0]} accepted, {attack.counts[2]} refused, {len(attack.faults)} faults')
    for fault in attack.faults:
        print('FAULT', fault)
    return 1 if attack.faults else 0


if __name__ == '__main__':
    sys.exit(main())
