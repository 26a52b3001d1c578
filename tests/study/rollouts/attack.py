#!/usr/bin/env python3
"""Mutated studies and summaries for `handsim rollouts`: attack.py PROGRAM [--inputs N] [--seed S].

Oracles: the program ends by itself, with status 0, 1 or 2; status 2 writes no file, and its message has a place or
names a file or an option; status 0 leaves a table with a row for each rollout and with columns of different names.
Damaged rows that are to be resumed: tests/python/test_rollouts.py.
"""
import argparse
import csv
import json
import random
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

SCENE = """title: two balls
objects:
  - {name: ball, shape: sphere, radius: 0.03, mass: 0.1, position: [0, 0, 0.2]}
  - {name: box, shape: box, edges: [0.1, 0.1, 0.1], density: 500, position: [0, 0.3, 0.2]}
ground: {}
effects: [gravity, object_contact, ground_contact, friction]
solver: {step: "2 ms"}
duration: 0.01
criteria: {lcp_failures: 0}
"""
STUDY = """title: a study
scene: ball.yaml
set: {solver.erp: 0.3, record.every: "2 ms"}
count: 3
seed: 5
vary:
  objects.0.mass: {uniform: ["100 g", "500 g"]}
  objects.1.position: {normal: {sd: ["1 mm", 0, 0]}}
  gravity: {each: [[0, 0, -9.81], [0, 0, -1.62]]}
  objects.*.friction: {log_uniform: [0.1, 1]}
  objects.0.radius: {choice: [0.02, 0.03]}
  duration: {linspace: [0.01, 0.02, 2]}
record: {figures: all, trajectories: 1}
"""
WORDS = ["", "~", "[]", "{}", "..", "*", "-1", "0", "1e999", "nan", "\"\"", "objects", "objects.0", "objects.0.mass",
         "objects.0.position.2", "objects.9.mass", "objects.00.mass", "objects.*.mass", "*.mass", "hands.*.person",
         "effects", "solver", "solver.engine", "solver.seed", "scene", "[1, 2]", "[[1, 2], [3, 4]]", "[a, b]",
         "{uniform: [1, 2]}", "{each: [1, \"x\", [1]]}", "{normal: {}}", "{normal: {sd: 1e9}}", "true", "stop: {lost: true}",
         "{population: ansur2}", "&a [*a]", "\u00e9\u0301", "\x00", "'", "\"", "- ", ": ", "1 mm", "[0.1, 1, 3]", "x" * 5000]
PLACE = re.compile(r"^\S.*:\d+:\d+: |^--[a-z]+|^\S*[./]\S*: got |: got .*, need ", re.M)


class Attack:
    def __init__(self, program, folder, seed):
        self.program, self.folder, self.random = program, folder, random.Random(seed)
        self.findings, self.statuses = [], {}

    def run(self, *words):
        try:
            done = subprocess.run([self.program, "rollouts", *map(str, words)], capture_output=True, timeout=60,
                                  text=True, errors="replace")
        except subprocess.TimeoutExpired:
            return None, "no end within 60 s"
        self.statuses[done.returncode] = self.statuses.get(done.returncode, 0) + 1
        return done.returncode, done.stderr

    def find(self, what, text, message):
        """Keeps the input beside the message."""
        path = Path(tempfile.gettempdir()) / f"rollouts_finding_{len(self.findings)}"
        path.write_bytes(text if isinstance(text, bytes) else text.encode("utf-8", "surrogateescape"))
        self.findings.append(f"{what}: {message.strip()[:300]} ({path})")

    def mutated_text(self, text):
        for _ in range(self.random.choice([1, 1, 2, 4])):
            kind = self.random.randrange(6)
            lines = text.splitlines(keepends=True) or [""]
            i = self.random.randrange(len(lines))
            if kind == 0:
                del lines[i]
            elif kind == 1:
                lines.insert(self.random.randrange(len(lines) + 1), lines[i])
            elif kind == 2:
                lines[i] = lines[i][:self.random.randrange(len(lines[i]) + 1)] + "\n"
            else:
                # A token of one line takes the place of another.
                tokens = list(re.finditer(r"[^\s,{}\[\]]+", lines[i]))
                if tokens:
                    at = self.random.choice(tokens)
                    others = re.findall(r"[^\s,{}\[\]]+", text) or [""]
                    word = self.random.choice(WORDS if kind < 5 else others)
                    lines[i] = lines[i][:at.start()] + word + (":" if at.group().endswith(":") else "") + lines[i][at.end():]
            text = "".join(lines)
        return text

    def study(self):
        text = self.mutated_text(STUDY)
        if re.search(r"linspace: \[[^\]]*\b\d{4,}\]", text):
            return
        file, out = self.folder / "study.yaml", self.folder / "out"
        file.write_text(text, encoding="utf-8")
        shutil.rmtree(out, ignore_errors=True)
        status, message = self.run(file, "--out", out, "--count", 2, "--jobs", 1)
        if status not in (0, 1, 2):
            return self.find("study", text, f"status {status}: {message}")
        if status == 2:
            if any(p.is_file() for p in out.rglob("*")):
                self.find("study", text, "status 2 has left files")
            if not PLACE.search(message):
                self.find("study", text, "a message without a place: " + message)
        if status == 1:
            self.find("study", text, "status 1: " + message)
        if status == 0:
            rows = list(csv.reader((out / "rollouts.csv").open(newline="")))
            if len(set(rows[0])) != len(rows[0]):
                self.find("study", text, f"two columns of one name: {rows[0]}")
            if len(rows) - 1 != json.loads((out / "summary.json").read_text())["rollouts"]:
                self.find("study", text, "rows are missing")

    def prepare(self):
        (self.folder / "ball.yaml").write_text(SCENE)
        (self.folder / "whole.yaml").write_text(STUDY)
        self.finished = self.folder / "finished"
        assert self.run(self.folder / "whole.yaml", "--out", self.finished)[0] == 0
        self.table = (self.finished / "rollouts.csv").read_bytes()
        self.summary = (self.finished / "summary.json").read_bytes()

    def mutated_bytes(self, data):
        data = bytearray(data)
        for _ in range(self.random.choice([1, 1, 3])):
            at = self.random.randrange(len(data) + 1)
            kind = self.random.randrange(6)
            if kind == 0:
                data = data[:at]
            elif kind == 1 and at < len(data):
                data[at] ^= 1 << self.random.randrange(8)
            elif kind == 2:
                data[at:at + 8] = self.random.choice([0, 1, 1 << 20, 1 << 33, (1 << 64) - 1]).to_bytes(8, "little")
            elif kind == 3:
                end = self.random.randrange(at, len(data) + 1)
                data[at:at] = data[at:end]
            elif kind == 4:
                data += bytes(self.random.randrange(5000))
            else:
                data += self.summary[self.random.randrange(len(self.summary)):]
            data = data or bytearray(b"\0")
        return bytes(data)

    def finish(self):
        """A damaged summary of a finished study: --resume says so, or has nothing to do, and changes no table."""
        data = self.mutated_bytes(self.summary)
        (self.finished / "summary.json").write_bytes(data)
        status, message = self.run(self.folder / "whole.yaml", "--out", self.finished, "--resume")
        if status not in (0, 2):
            self.find("summary", data, f"status {status}: {message}")
        if (self.finished / "rollouts.csv").read_bytes() != self.table:
            self.find("summary", data, "another table")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program")
    parser.add_argument("--inputs", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        attack = Attack(arguments.program, Path(folder), arguments.seed)
        attack.prepare()
        for i in range(arguments.inputs):
            (attack.study, attack.study, attack.finish)[i % 3]()
        print(f"{arguments.inputs} inputs, programs by exit status: {dict(sorted(attack.statuses.items()))}")
        print(*attack.findings, sep="\n")
        return 1 if attack.findings else 0


if __name__ == "__main__":
    sys.exit(main())
