#!/usr/bin/env python3
"""Runs an accuracy study and replaces its part of a table of costs, which engine auto reads.

    docs/costs.py stops config/accuracy_stops.yaml

Error: RMS error of the rates over their RMS in the reference. Of each engine the rows remain that no other row beats in
both error and cost. Needs python3-yaml.
"""
import argparse
import csv
import json
import math
import re
import shlex
import subprocess
import tempfile
from pathlib import Path

import yaml

ROOT = Path(__file__).resolve().parent.parent


def overrides(settings):
    """`--set` of a mapping of keys to values."""
    return [word for key, value in settings.items() for word in ("--set", f"{key}={json.dumps(value)}")]


def seconds(text):
    """A time such as "10 ms"."""
    number, unit = re.fullmatch(r"([\d.e+-]+) ?(\w*)", str(text)).groups()
    return float(number) * {"": 1, "s": 1, "ms": 1e-3, "us": 1e-6}[unit]


def rms_of_reference(study, scene, handsim, out):
    """RMS of the rates that the study compares, and the end of the reference."""
    if study["reference"] == "method":
        subprocess.run([handsim, "run", scene, "--out", out, "--quiet", *overrides(study["reference_set"]),
                        "--set", f"record.every={seconds(study.get('sample_every', '10 ms'))}"], check=True)
        rows = list(csv.DictReader(open(out / "trajectory.csv")))
        wanted = [name for name in rows[0] if ".rate[" in name and name.startswith(study.get("observe", ""))]
        rates, end = [[float(row[name]) for name in wanted] for row in rows], float(rows[-1]["time[s]"])
    else:
        table = ROOT / f"src/handsim/study/accuracy/{study['reference']}.csv"
        rates = [[float(row["vx[m/s]"])] for row in csv.DictReader(open(table))]
        end = 0.01 * (len(rates) - 1)
    values = [rate for row in rates for rate in row]
    return math.sqrt(sum(rate * rate for rate in values) / len(values)), end


def settings_of(command, handsim, out):
    """The solver of a row, with all its defaults."""
    words = shlex.split(command)[1:]
    words[words.index("--out") + 1] = str(out)
    step = next(word for word in words if word.startswith("solver.step=")).split("=")[1]
    subprocess.run([handsim, *words, "--quiet", "--set", f"duration={step}"], stdout=subprocess.DEVNULL)
    return yaml.safe_load(open(out / "resolved.yaml"))["solver"]


def part(kind, path, handsim):
    """The study's part of the table."""
    study = yaml.safe_load(open(path))
    scene = path.parent / study["scene"]
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)
        subprocess.run([handsim, "accuracy", path, "--out", out], check=True)
        result, commands = (json.load(open(out / name)) for name in ("accuracy.json", "study.json"))
        signal, end = rms_of_reference(study, scene, handsim, out / "reference")
        rows = []
        for row, command in zip(result["rows"], commands["rows"]["accuracy.csv"]):
            if "fault" in row or row["own_reference"] or row["is_reference"]:
                continue
            solver = settings_of(command, handsim, out / "row")
            rows.append({"error": row["rate_error_rms"] / signal, "cost": row["cpu_seconds_per_second"], "solver": solver})
    best = [row for row in rows if not any(
        other["solver"]["engine"] == row["solver"]["engine"] and other["error"] <= row["error"] and
        other["cost"] <= row["cost"] and (other["error"], other["cost"]) != (row["error"], row["cost"])
        for other in rows)]
    text = f"  - kind: {kind}\n    scene: \"{scene.name}\"\n    duration: {end:.12g}\n    rows:\n"
    for row in sorted(best, key=lambda row: -row["error"]):
        text += f"      - error: {row['error']:.3g}\n        cost: {row['cost']:.3g}\n"
        for key in ("engine", "method", "step", "erp", "cfm", "iterations", "projection", "tolerance", "speculative"):
            if key in row["solver"]:
                value = row["solver"][key]
                shown = f"{value:.12g}" if isinstance(value, float) else str(value).lower()
                text += f"        {key}: {shown}\n"
    return text


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("kind", choices=["tree", "loop", "stops", "contact"], help="kind of the study's scene")
    parser.add_argument("study", type=Path)
    parser.add_argument("--table", type=Path, default=ROOT / "config/accuracy_costs.yaml")
    parser.add_argument("--handsim", default=str(ROOT / "build/release/src/handsim"))
    asked = parser.parse_args()
    new = part(asked.kind, asked.study, asked.handsim)
    head, *parts = re.split(r"(?=^  - kind: )", asked.table.read_text(), flags=re.M)
    others = [each for each in parts if not each.startswith(f"  - kind: {asked.kind}\n")]
    order = ["tree", "loop", "stops", "contact"]
    parts = sorted(others + [new], key=lambda each: order.index(each.split("\n")[0].split()[-1]))
    asked.table.write_text(head + "".join(parts))
    subprocess.run([asked.handsim, "check", asked.table], check=True)


if __name__ == "__main__":
    main()
