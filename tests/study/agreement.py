#!/usr/bin/env python3
"""Do engines agree on what is held? Random grasps around a scene, each run on ODE and on the articulated engine.

    PYTHONPATH=build/release/python python3 tests/study/agreement.py --draws 100 --seed 2201 --out out/agree

A draw has another place of the object in the hand, another mass and another friction. A draw that the scene's grip
refuses is replaced by the next one. Each draw also runs on the articulated engine at a quarter of the step, and those of
which the engines differ run on ODE at a quarter of the step, which costs four times all the rest; `--quarter-steps N`
adds that run to the first N draws. OUT/agreement.csv has a row for each draw, OUT/agreement.json the counts.
"""
import argparse
import csv
import json
import os
import shlex
import statistics
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import yaml

import handsim as hs

BOX = Path(__file__).resolve().parents[2] / "config" / "agreement" / "box.yaml"
SHIFT = 6e-3                                 # of the object along each axis of the palm, to either side [m]
MASS, FRICTION = (0.15, 0.6), (0.3, 1.0)     # [kg]; of every surface
SHAKE = [{"acceleration": "9.8 m/s2", "frequency": "2.5 Hz"}]
SLIP_FLOOR = 1e-6                            # below it, friction's compliance creeps, in each engine by another amount [m/s]
TENTH = 0.1
WAYS = {"ode": ("ode", 1), "articulated": ("articulated", 1), "articulated/4": ("articulated", 0.25), "ode/4": ("ode", 0.25)}


def overrides_of(draw, base):
    place = [float(x) for x in draw["place_m"]]
    return {**base, "grasps.0.at.position": place, "objects.0.mass": draw["mass_kg"], "grasps.0.shake.levels": SHAKE}


def command_of(scene, base, draw):
    """Repeats a draw on the articulated engine."""
    sets = {**overrides_of(draw, base), "solver.engine": "articulated"}
    words = [word for key, value in sets.items() for word in ("--set", f"{key}={value if isinstance(value, str) else json.dumps(value)}")]
    return shlex.join(["handsim", "grasp", str(scene), "--friction", str(draw["friction"]), *words, "--out", "again"])


def draws_of(scene, base, count, seed):
    """The draws, and why the grip refused others. The draws depend on scene and seed alone."""
    stated = yaml.safe_load(hs.load(scene, base).resolved)["grasps"]
    if len(stated) != 1:
        raise SystemExit(f"agreement: {scene}: {len(stated)} grasps, need one")
    middle = np.array(stated[0]["at"]["position"], float)
    random = np.random.default_rng(seed)
    draws, refused = [], []
    while len(draws) < count:
        draw = {"place_m": (middle + random.uniform(-SHIFT, SHIFT, 3)).tolist(), "mass_kg": random.uniform(*MASS),
                "friction": random.uniform(*FRICTION)}
        try:
            hs.load(scene, overrides_of(draw, base), engine="articulated")
            draws.append(draw)
        except hs.Error as error:
            if error.kind != "input" or len(refused) > count:
                raise
            refused.append(str(error))
    return draws, refused


def run(scene, base, draw, quarter):
    """The draw with what each way says of it, what turns the articulated engine's verdict, and its CPU time."""
    start = time.process_time()
    draw = {**draw, "turning": "", "says": {}}
    step = hs.load(scene, base).step
    for way, (engine, share) in WAYS.items():
        says = draw["says"]
        if way == "ode/4" and not quarter and says["ode"]["held"] == says["articulated"]["held"]:
            continue
        settings = {**overrides_of(draw, base), "solver.engine": engine, "solver.step": share * step}
        with tempfile.TemporaryDirectory() as folder:
            study = hs.study.grasps(scene, settings, friction=draw["friction"], margin=way == "articulated", out=folder)
            row = study.summary[0]
            grip = json.loads((Path(folder) / row["scene"] / "summary.json").read_text())["grasps"][0]
        draw["turning"] = row.get("turning", draw["turning"])
        says[way] = {key: row[key] for key in ("outcome", "held", "margin")}
        says[way].update(slip=grip["slip_m_per_s"], shift=grip["shift_m"], grip=grip["end_of_hold"]["normal_force_N"])
    draw["cpu_s"] = time.process_time() - start
    return draw


def compare(rows, way, other):
    """How often two ways say the same, and by how much grip and slip differ where both hold."""
    count = lambda same: {"same": sum(same), "of": len(same)}
    pairs = [(row["says"][way], row["says"][other]) for row in rows]
    same = [a["held"] == b["held"] for a, b in pairs]
    both = [(a, b) for a, b in pairs if a["held"] and b["held"]]
    grips = [abs(a["grip"] / b["grip"] - 1) for a, b in both]
    slips = [(a["slip"], b["slip"]) for a, b in both]
    above = [pair for pair in slips if max(pair) >= SLIP_FLOOR]
    median = lambda values: statistics.median(values) if values else 0
    return {"ways": [way, other], "same_verdict": count(same),
            "same_verdict_not_marginal": count([held for held, row in zip(same, rows) if not row["turning"]]),
            "grip_within_a_tenth": count([grip <= TENTH for grip in grips]),
            "grip_difference_median": median(grips), "grip_difference_most": max(grips, default=0),
            "slip_median_m_per_s": [median([pair[k] for pair in slips]) for k in (0, 1)],
            "slip_below_floor": len(slips) - len(above),
            "slip_within_a_tenth": count([abs(a - b) <= TENTH * max(a, b) for a, b in above])}


def summary(rows, quarters):
    """The comparisons of rows, of which the first `quarters` have ODE's quarter step; and the draws that differ."""
    pairs = [compare(rows, "ode", "articulated"), compare(rows, "articulated", "articulated/4")]
    if quarters:
        pairs += [compare(rows[:quarters], way, "ode/4") for way in ("ode", "articulated/4")]
    differences = [{"draw": k, **{key: row[key] for key in ("place_m", "mass_kg", "friction", "turning")},
                    "says": [{"way": way, **{key: said[key] for key in ("outcome", "held", "margin")}}
                             for way, said in row["says"].items()]}
                   for k, row in enumerate(rows) if row["says"]["ode"]["held"] != row["says"]["articulated"]["held"]]
    return {"pairs": pairs, "differences": differences}


def write_table(rows, path):
    with open(path, "w", newline="") as file:
        table = csv.writer(file)
        figures = ("outcome", "margin", "slip[um/s]", "shift[mm]", "grip[N]")
        table.writerow(["draw", "x[m]", "y[m]", "z[m]", "mass[kg]", "friction", "turning",
                        *(f"{way} {figure}" for way in WAYS for figure in figures), "cpu[s]"])
        for k, row in enumerate(rows):
            said = [row["says"].get(way) for way in WAYS]
            cells = [[s["outcome"], s["margin"], 1e6 * s["slip"], 1e3 * s["shift"], s["grip"]] if s else [""] * 5 for s in said]
            table.writerow([k, *row["place_m"], row["mass_kg"], row["friction"], row["turning"], *sum(cells, []), row["cpu_s"]])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", nargs="?", type=Path, default=BOX, help="scene with one grasp (default: the shipped box)")
    parser.add_argument("--draws", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--quarter-steps", type=int, default=0, help="so many draws also run on ODE at a quarter of the step")
    parser.add_argument("--set", action="append", default=[], help="key=value of the scene")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="processes (default: one for each core)")
    parser.add_argument("--out", type=Path, required=True, help="folder for agreement.csv and agreement.json")
    options = parser.parse_args()
    base = dict(text.split("=", 1) for text in options.set)
    draws, refused = draws_of(options.scene, base, options.draws, options.seed)
    options.out.mkdir(parents=True, exist_ok=True)
    rows = []
    with ProcessPoolExecutor(options.jobs, get_context("spawn")) as pool:
        runs = [pool.submit(run, options.scene, base, draw, k < options.quarter_steps) for k, draw in enumerate(draws)]
        for done in runs:
            rows.append(done.result())
            # The files have all draws so far: a study of hours that is stopped leaves them.
            found = {"scene": options.scene.name, "draws": len(rows), "seed": options.seed,
                     "quarter_steps": min(options.quarter_steps, len(rows)), "refused": refused, "slip_floor_m_per_s": SLIP_FLOOR,
                     "cpu_s": sum(row["cpu_s"] for row in rows), "versions": {"handsim": hs.__version__},
                     **summary(rows, options.quarter_steps)}
            for entry in found["differences"]:
                entry["command"] = command_of(options.scene, base, entry)
            write_table(rows, options.out / "agreement.csv")
            (options.out / "agreement.json").write_text(json.dumps(found, indent=2) + "\n")
    for pair in found["pairs"]:
        same = pair["same_verdict"]
        print(f"{', '.join(pair['ways'])}: the same verdict in {same['same']} of {same['of']} draws")


if __name__ == "__main__":
    main()
