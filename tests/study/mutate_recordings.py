#!/usr/bin/env python3
"""Spoils recordings, motions and loads, and gives them to `handsim track` and `handsim inverse`.

    mutate_recordings.py PROGRAM [--count 60] [--seed 1] [--keep DIR]

Whatever the input: the program ends by itself with status 0, 1 or 2, says why where it is not 0, and leaves no `nan` or
`inf` in what it writes. A scene that `track` wrote with status 0 passes `handsim check` and `handsim run`.
"""
import argparse
import json
import os
import pathlib
import random
import re
import subprocess
import sys
import tempfile

SOURCE = pathlib.Path(__file__).resolve().parents[2]
NUMBERS = ["", "nan", "inf", "-inf", "1e308", "-1e308", "1e-320", "0", "-0", "-1", "1e9", "1e999", "x", "0x10", "1,5", "\"", "\0", "9" * 400]
NUMBER = re.compile(r"-?\d+\.?\d*(?:e[-+]?\d+)?")
KINDS = ["csv", "json", "trc", "mot", "loads", "contacts"]


def as_json(csv):
    """The keypoints of a table as a camera tracker writes them."""
    rows = [line.split(",") for line in csv.splitlines()]
    frames = []
    for row in rows[1:]:
        hands = [{"side": side, "points": [[float(x) for x in row[i:i + 3]] for i in range(1, len(row), 3) if rows[0][i].startswith(side)]}
                 for side in ("right", "left")]
        frames.append({"time": float(row[0]), "hands": hands})
    return json.dumps({"rate": 125, "frames": frames}).replace("}]}, ", "}]},\n")


def spoil_text(text, rng):
    """One change of the text, which knows nothing of the format."""
    lines = text.split("\n")
    at = rng.randrange(len(lines))
    choice = rng.randrange(11)
    if choice == 0:
        return text[:rng.randrange(len(text))]
    if choice == 1:
        del lines[at:at + rng.choice([1, 1, 5, 100])]
    elif choice == 2:
        lines[at:at] = [lines[at]] * rng.choice([1, 3])
    elif choice == 3:
        other = rng.randrange(len(lines))
        lines[at], lines[other] = lines[other], lines[at]
    elif choice == 4:
        found = list(NUMBER.finditer(lines[at]))
        if found:
            one = rng.choice(found)
            lines[at] = lines[at][:one.start()] + rng.choice(NUMBERS) + lines[at][one.end():]
    elif choice == 5:
        head = rng.randrange(min(6, len(lines)))
        words = re.findall(r"\w+", lines[head])
        if words:
            lines[head] = lines[head].replace(rng.choice(words), rng.choice(["", "x", "right", "left", "mm", "0"] + words[:20]), 1)
    elif choice == 6:
        begin = rng.randrange(len(text))
        return text[:begin] + text[begin + rng.choice([1, 1, 40]):]
    elif choice == 7:
        begin = rng.randrange(len(text))
        return text[:begin] + rng.choice(list("\0\n,\t{}[]\":e-.x\xe9\U0001f590")) + text[begin:]
    elif choice == 8:
        return text.replace("\n", rng.choice(["\r\n", "\r", "\n\n"]))
    elif choice == 9:
        return rng.choice(["", "\n", " ", "\ufeff" + text, text + text, lines[0], "\n".join(lines[:7])])
    else:
        separator = rng.choice([",", "\t", " "])
        fields = lines[at].split(separator)
        field = rng.randrange(len(fields))
        fields[field:field + 1] = rng.choice([[], [fields[field]] * 2, [rng.choice(NUMBERS)]])
        lines[at] = separator.join(fields)
    return "\n".join(lines)


def spoil_values(text, rng):
    """One change of all times or places of a table, as a wrong unit, rate or clock makes it."""
    separator = "\t" if "\t" in text else ","
    lines = text.split("\n")
    first = next((i for i, line in enumerate(lines) if re.match(r"\s*[-\d.]+[\t,]", line)), None)
    if first is None:
        return text
    time = 1 if lines[0].startswith("PathFileType") else 0
    times, places = rng.choice([(lambda t, i: t * f + d, lambda x, i, c: x) for f, d in
                                [(1e3, 0), (1e-3, 0), (2, 0), (0.5, 0), (20, 0), (1, 1.7e9), (1, -3), (1, 99999), (1e5, 0), (-1, 0), (1e-9, 0)]] +
                               [(lambda t, i: t, lambda x, i, c, f=f, d=d: x * f + d) for f, d in
                                [(1e3, 0), (1e-3, 0), (-1, 0), (0.5, 0), (2, 0), (0, 0), (1, 900), (1, 1e7)]] +
                               [(lambda t, i: t + (5 if i > 20 else 0), lambda x, i, c: x),
                                (lambda t, i: t + (9e4 if i > 20 else 0), lambda x, i, c: x),
                                (lambda t, i: t, lambda x, i, c: x + (2 if i == 20 else 0)),
                                (lambda t, i: t, lambda x, i, c: x + (0.7 if i > 20 else 0)),
                                (lambda t, i: t, lambda x, i, c: "" if i % 3 else x),
                                (lambda t, i: t, lambda x, i, c: "" if c > 30 else x),
                                (lambda t, i: t, lambda x, i, c: x + rng.gauss(0, 0.01))])
    for i, line in enumerate(lines[first:]):
        fields = line.split(separator)
        if len(fields) < 3:
            continue
        for c, field in enumerate(fields):
            try:
                value = float(field)
            except ValueError:
                continue
            if c == time:
                fields[c] = repr(times(value, i))
            elif c > time:
                new = places(value, i, c)
                fields[c] = new if isinstance(new, str) else repr(new)
        lines[first + i] = separator.join(fields)
    return "\n".join(lines)


class Attack:
    def __init__(self, program, folder):
        self.program, self.folder, self.found = program, folder, []
        # Without gnuplot: its plots are no part of the question, and take most of the time.
        self.environment = dict(os.environ, PATH="/nonexistent")
        made = self.run("run", SOURCE / "config/bench.yaml", "--out", folder / "true", "--set", "duration=0.4", "--set", "record.contacts=true")
        assert made.returncode in (0, 1), made.stderr
        true = {name: (folder / "true" / name).read_text() for name in ("markers.csv", "markers.trc", "trajectory.mot", "contacts.csv")}
        self.texts = {"csv": true["markers.csv"], "trc": true["markers.trc"], "mot": true["trajectory.mot"], "json": as_json(true["markers.csv"]),
                      "contacts": true["contacts.csv"],
                      "loads": "time[s],body,x[m],y[m],z[m],force.x[N],force.y[N],force.z[N]\n" +
                               "".join(f"{0.05 * i:g},right.index_distal,0.1,0.1,0.2,0,0,-{i}\n" for i in range(9))}
        names = self.texts["csv"].split("\n")[0].split(",")[1::3]
        segments = [(name[:-5], name.split(".")[0], re.sub("_(mcp|pip|dip)", "", name.split(".")[1][:-5]), name[:-5].split("_")[-1]) for name in names]
        of = {"mcp": "proximal", "pip": "middle", "dip": "distal"}
        markers = [f"  - {{name: {full}, hand: {side}, segment: {'palm' if full.endswith('wrist') else finger + '_' + of[joint]}, at: [0, 0, 0]}}\n"
                   for full, side, finger, joint in segments if full.endswith("wrist") or joint in of and "thumb" not in full]
        (folder / "markers.yaml").write_text("markers:\n" + "".join(markers))

    def run(self, *arguments):
        return subprocess.run([self.program, *map(str, arguments)], capture_output=True, text=True, errors="replace", timeout=120, env=self.environment)

    def wrong(self, case, what):
        self.found.append(f"{case}: {what}")
        print("FOUND", self.found[-1], file=sys.stderr)

    def check_run(self, case, done):
        if done.returncode not in (0, 1, 2):
            self.wrong(case, f"status {done.returncode}: {done.stderr[-300:]}")
        if done.returncode != 0 and not done.stderr.strip():
            self.wrong(case, f"status {done.returncode} without a word")
        if done.returncode == 2 and "need" not in done.stderr:
            self.wrong(case, f"a refusal that does not say what it needs: {done.stderr[-300:]}")

    def check_files(self, case, out):
        for path in out.glob("*"):
            # A marked frame has no distances; they are empty.
            if path.suffix in (".mot", ".sto", ".csv", ".yaml", ".json") and re.search(r"[\s,:](?:-?nan|-?inf|null)\b", path.read_text(errors="replace"), re.I):
                self.wrong(case, f"nan or inf in {path.name}")

    def one(self, seed):
        rng = random.Random(seed)
        kind = KINDS[seed % len(KINDS)]
        text = self.texts[kind]
        for _ in range(rng.choice([1, 1, 1, 2, 4])):
            text = (spoil_values if kind != "json" and rng.random() < 0.4 else spoil_text)(text or "x", rng)
        path = self.folder / f"spoilt.{kind if kind in ('csv', 'json', 'trc', 'mot') else 'csv'}"
        path.write_text(text, errors="replace")
        out = self.folder / "out"
        for old in out.glob("*"):
            old.unlink()
        case = f"seed {seed} ({kind})"
        if kind in ("csv", "json", "trc"):
            options = rng.choice([[], [], ["--person", SOURCE / "config/persons/median_woman.yaml"], ["--markers", self.folder / "markers.yaml"],
                                  ["--no-smoothing"], ["--keep-person"]])
            done = self.run("track", path, "--out", out, *options)
            self.check_run(case, done)
            self.check_files(case, out)
            if done.returncode == 0:
                self.check_scene(case, out / "scene.yaml")
            return done.returncode
        effects = "effects=[gravity, joint_stops, passive_tissue, actuation, wrist_motion]"
        motion = ["--motion", path] if kind == "mot" else ["--motion", self.folder / "true/trajectory.mot", "--loads", path]
        done = self.run("inverse", SOURCE / "config/bench.yaml", *motion, "--out", out, "--set", effects, *rng.choice([[], ["--clamp"], ["--cutoff", "none"], ["--no-check"]]))
        self.check_run(case, done)
        if done.returncode == 0:
            self.check_files(case, out)
        return done.returncode

    def check_scene(self, case, scene):
        if not scene.exists():
            return self.wrong(case, "no scene with status 0")
        checked = self.run("check", scene)
        if checked.returncode != 0:
            return self.wrong(case, f"its scene is refused: {checked.stderr[-300:]}{checked.stdout[-300:]}")
        # A second of a long recording is enough.
        duration = re.search(r"^duration: (\S+)", scene.read_text(), re.M)
        short = ["--set", "duration=1"] if float(duration.group(1)) > 1 else []
        ran = self.run("run", scene, "--out", self.folder / "run", *short)
        if ran.returncode != 0:
            self.wrong(case, f"its scene does not run: {ran.stderr[-300:]}")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program")
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        attack = Attack(options.program, pathlib.Path(folder))
        counts = {}
        for seed in range(options.seed, options.seed + options.count):
            try:
                status = attack.one(seed)
            except subprocess.TimeoutExpired:
                attack.wrong(f"seed {seed}", "more than two minutes")
                status = "late"
            counts[status] = counts.get(status, 0) + 1
    print(f"{options.count} inputs, by status {counts}, {len(attack.found)} found")
    return 1 if attack.found else 0


if __name__ == "__main__":
    sys.exit(main())
