#!/usr/bin/env python3
"""What does a step in contact cost, and what is its verdict worth? Scenes at steps of 1/16 to 4 ms, against the finest.

    PYTHONPATH=build/release/python python3 tests/study/contact_step.py --draws 24 --seed 6301 --out out/contact_step
    PYTHONPATH=build/release/python python3 tests/study/contact_step.py --out out/contact_step --only peers --packages build/peers/suite

The scenes: random grasps of tests/study/agreement.py, the ten shipped grasps, climbs, two hands that interlace, and a hand that drops, on the
articulated engine; some of the grasps on ODE; and the suite's ten grasps of the median man, which other engines take, each exported at its
step. Every run is compared with the same engine's at its finest step. OUT/contact_step.csv has a row for each run, contact_step.json the
counts, contact_step.svg the share of right verdicts over CPU time. A call goes on where an earlier one with the same --out ended.
"""
import argparse
import csv
import importlib.util
import json
import math
import shutil
import statistics
import tempfile
import time
from pathlib import Path

import numpy as np
import yaml

import handsim as hs
from handsim import _suite, _suite_cases
from handsim._table_files import read_csv

ROOT = Path(__file__).resolve().parents[2]
CONFIG = ROOT / "config"
STEPS = (0.0625, 0.125, 0.25, 0.5, 1.0, 2.0, 4.0)  # [ms]
ODE_STEPS = SUITE_STEPS = STEPS[2:]
"""Of what takes longer: ODE, and the suite's cases in all engines."""
TERMS = {"": (False, False), "servos": (False, True), "pads and servos": (True, True)}
"""Damping that a spring evaluated at the step's end would add, of the random grasps: which part of the error it would be."""
TERM_STEPS = (1.0, 2.0, 4.0)
SHIPPED = tuple(_suite_cases.GRASPS)
CLIMBS = ("half_crimp", "open_hand", "jug")
SHORT = {"grasps.0.hold": "1 s", "grasps.0.shake.levels": [{"acceleration": "19.6 m/s2", "frequency": "5 Hz"}], "record.every": "20 ms"}
PEERS = ("articulated", "mujoco4", "drake")
COLORS = {"articulated": "#2b6cb0", "ode": "#718096", "mujoco4": "#dd6b20", "drake": "#2f855a"}
NAMES = {"articulated": "handsim articulated", "ode": "handsim ODE", "mujoco4": "MuJoCo 4", "drake": "Drake"}


def load_module(path, name):
    spec = importlib.util.spec_from_file_location(name, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


agreement = load_module(ROOT / "tests" / "study" / "agreement.py", "agreement")


# Runs.

def place_of(table, bodies):
    """Places of bodies at the last row, shape (bodies, 3) [m]."""
    return [[float(table[f"{body}.{axis}"][-1]) for axis in "xyz"] for body in bodies]


def grasp(scene, settings, friction=None):
    """Verdict, margin and force of a grasp or climb, the place of what it holds, and CPU time."""
    with tempfile.TemporaryDirectory() as folder:
        start = time.process_time()
        hs.study.grasps(scene, settings, friction=friction, out=folder)
        cpu = time.process_time() - start
        own = next(path.parent for path in Path(folder).glob("*/summary.json"))
        summary, table = json.loads((own / "summary.json").read_text()), read_csv(own / "trajectory.csv")
        simulated = float(table["time"][-1])
        if summary.get("climbs"):
            climb = summary["climbs"][0]
            return {"verdict": "fails" if climb["failed"] else "holds", "margin": None, "force": climb["load_N"], "place": None,
                    "simulated": simulated, "cpu": cpu}
        found = summary["grasps"][0]
        body = found["name"].partition(".")[2]
        return {"verdict": "held" if found["held"] else "not held", "margin": found["margin"], "force": found["end_of_hold"]["normal_force_N"],
                "place": place_of(table, [body]), "simulated": simulated, "cpu": cpu}


def motion(scene, settings):
    """Whether the criteria of a scene without grasps hold, and where its bodies end."""
    compiled = hs.load(scene, settings)
    start = time.process_time()
    result = compiled.run(frames=0, progress=False)
    cpu = time.process_time() - start
    return {"verdict": "passed" if result.passed else "FAILED", "margin": None, "force": None,
            "place": place_of(result.trajectory, compiled.bodies[1:]), "simulated": result.simulated, "cpu": cpu}


def scenes_of(options):
    """Name of a set, name of a scene, and the function of engine, step [s] and changes that runs it."""
    out = []
    base = {"record.every": "20 ms"}

    def with_engine(settings, engine, step, changes):
        return {**settings, **changes, "solver.engine": engine, "solver.step": step}

    if "draws" in options.only:
        draws, _ = agreement.draws_of(agreement.BOX, base, options.draws, options.seed)
        for k, draw in enumerate(draws):
            settings = agreement.overrides_of(draw, base)
            out.append(("draws", f"draw_{k}", lambda engine, step, changes, settings=settings, draw=draw: grasp(
                agreement.BOX, with_engine(settings, engine, step, changes), draw["friction"])))
    if "shipped" in options.only:
        for name in SHIPPED:
            out.append(("shipped", name, lambda engine, step, changes, name=name: grasp(CONFIG / f"grasp_{name}.yaml", with_engine(SHORT, engine, step, changes))))
    if "others" in options.only:
        for name in CLIMBS:
            out.append(("climbs", name, lambda engine, step, changes, name=name: grasp(CONFIG / f"climb_{name}.yaml", with_engine(base, engine, step, changes))))
        for kind, name in (("interlace", "two_hands_contact"), ("drop", "dropped_hand")):
            out.append((kind, name, lambda engine, step, changes, name=name: motion(CONFIG / f"{name}.yaml", with_engine(base, engine, step, changes))))
    return out


def damped(folder, step, pads, servos):
    """Changes of a scene whose pads and servos have so much more damping as a spring at a step's [s] end adds, stiffness times step."""
    out = {}
    if pads:
        pad = yaml.safe_load((ROOT / "handmodels" / "finger_pad.yaml").read_text())
        out["contacts.materials.0.damping"] = pad["damping"] + step * pad["stiffness"]
    if servos:
        controller = yaml.safe_load((ROOT / "controllers" / "grasp.yaml").read_text())
        for row in controller["gains"]:
            if "proportional" in row:
                row["derivative"] = row["derivative"] + step * row["proportional"]
        path = folder / f"servos_{1e3 * step:g}.yaml"
        path.write_text(yaml.safe_dump(controller))
        out["control.controller"] = str(path.resolve())
    return out


def run_scenes(options, rows, write):
    scenes = scenes_of(options)
    engines = {"articulated": [(kind, name, run) for kind, name, run in scenes]}
    # ODE takes a hundred times as long with contact: the first random grasps.
    engines["ode"] = [each for each in scenes if each[0] == "draws"][:options.ode]
    done = {(row["set"], row["scene"], row["engine"], row["term"], row["step_ms"]) for row in rows}
    for engine, of_engine in engines.items():
        for kind, name, run in of_engine:
            for term, (pads, servos) in TERMS.items():
                for step in (STEPS if engine == "articulated" else ODE_STEPS) if not term else TERM_STEPS if engine == "articulated" and kind == "draws" else ():
                    if (kind, name, engine, term, step) in done:
                        continue
                    try:
                        found = run(engine, 1e-3 * step, damped(options.out, 1e-3 * step, pads, servos))
                    except hs.Error as error:
                        found = {"verdict": f"error: {error}", "margin": None, "force": None, "place": None, "simulated": 0.0, "cpu": 0.0}
                    rows.append({"set": kind, "scene": name, "engine": engine, "term": term, "step_ms": step, **found})
            write()


def export_cases(folder, step):
    """The suite's grasps of the median man as if their scenes had this step [s]."""
    for name, content in {"shake.csv": _suite.shake_table(1e-3)}.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)
    for path in _suite.FILES.rglob("*.py"):
        (folder / path.relative_to(_suite.FILES)).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(path, folder / path.relative_to(_suite.FILES))
    for asked in _suite_cases.every():
        if asked.grasp and asked.person == "median_man":
            # Rows every 20 ms: steps of 4 ms meet them.
            at_step = asked._replace(set=[*asked.set, f"solver.step={step:g}"], every=0.02)
            for name, content in _suite.case_files(at_step).items():
                (folder / asked.name / name).parent.mkdir(parents=True, exist_ok=True)
                (folder / asked.name / name).write_bytes(content)


def end_of(path):
    """The place of the object, which is not the palm, at the end of a driver's table, shape (1, 3) [m]; None of a case that broke off."""
    with open(path, newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["body"] != _suite_cases.PALM]
    return [[float(rows[-1][axis]) for axis in "xyz"]] if rows else None


def run_peers(options, rows, write):
    peers = load_module(ROOT / "tests" / "peers" / "suite.py", "peers_suite")
    for step in sorted(SUITE_STEPS, reverse=True):
        suite = options.out / "cases" / f"{step:g}"
        export_cases(suite, 1e-3 * step)
        for engine in PEERS:
            if engine not in options.engines:
                continue
            results = options.out / "results" / f"{step:g}"
            if any(row["set"] == "suite" and row["engine"] == engine and row["step_ms"] == step for row in rows):
                continue
            peers.run_engine(engine, suite, results, options.packages, [])
            if not (results / engine / "judged.json").exists():
                continue
            judged = json.loads((results / engine / "judged.json").read_text())
            for case in judged["cases"]:
                figures = {figure["name"]: figure["value"] for figure in case["figures"]}
                used = [figures.get(name) for name in ("shift", "turn", "shaken")]
                limits = (2e-3, math.radians(2), 5e-3)
                margin = None if None in used else 1 - max(x / y for x, y in zip(used, limits))
                rows.append({"set": "suite", "scene": case["case"], "engine": engine, "term": "", "step_ms": step, "verdict": case["verdict"], "margin": margin,
                             "force": figures.get("grip"), "place": end_of(results / engine / f"{case['case']}.csv"), "simulated": None, "cpu": case["cpu_s"]})
            write()


# What they say.

def compared(rows):
    """The rows of each engine with what they are off its finest step."""
    finest = {}
    for row in rows:
        key = (row["set"], row["scene"], row["engine"])
        if row["term"]:
            continue
        if key not in finest or row["step_ms"] < finest[key]["step_ms"]:
            finest[key] = row
    out = []
    for row in rows:
        of = finest[row["set"], row["scene"], row["engine"]]
        same = row["verdict"] == of["verdict"]
        both = lambda name: row[name] is not None and of[name] is not None
        out.append({**row, "right": same,
                    "margin_off": abs(row["margin"] - of["margin"]) if both("margin") and same else None,
                    "force_off": abs(row["force"] / of["force"] - 1) if both("force") and of["force"] else None,
                    "place_off": float(np.linalg.norm(np.array(row["place"]) - of["place"], axis=1).max()) if both("place") else None})
    return out


def summary(rows):
    """For each set, engine and step: verdicts that are right, medians and largest of what is off, and the CPU time of all scenes over that of the
    articulated engine at 1 ms in the same set."""
    out, every = [], compared(rows)
    for kind in dict.fromkeys(row["set"] for row in every):
        own = [row for row in every if row["set"] == kind]
        for engine, term in dict.fromkeys((row["engine"], row["term"]) for row in own):
            of_engine = [row for row in own if (row["engine"], row["term"]) == (engine, term)]
            for step in sorted({row["step_ms"] for row in of_engine}):
                at = [row for row in of_engine if row["step_ms"] == step]
                scenes = {row["scene"] for row in at}
                unit = sum(row["cpu"] for row in own if row["engine"] == "articulated" and not row["term"] and row["step_ms"] == 1 and row["scene"] in scenes)
                each = lambda name: [row[name] for row in at if row[name] is not None]
                out.append({"set": kind, "engine": engine, "term": term, "step_ms": step, "right": sum(row["right"] for row in at), "of": len(at),
                            "wrong": [row["scene"] for row in at if not row["right"]],
                            **{f"{name}_{word}": (of(each(name)) if each(name) else None) for name in ("margin_off", "force_off", "place_off")
                               for word, of in (("median", statistics.median), ("most", max))},
                            "cpu_s": sum(row["cpu"] for row in at), "cost": sum(row["cpu"] for row in at) / unit if unit else None})
    return out


def terms_of(rows):
    """What is off with and without the damping of springs at the step's end, of the random grasps that ran with both."""
    every = [row for row in compared(rows) if row["set"] == "draws" and row["engine"] == "articulated"]
    at = {(row["scene"], row["term"], row["step_ms"]): row for row in every}
    scenes = [name for name in dict.fromkeys(row["scene"] for row in every) if all((name, term, step) in at for term in TERMS for step in TERM_STEPS)]
    out = []
    for term in TERMS if scenes else ():
        for step in TERM_STEPS:
            own = [at[name, term, step] for name in scenes]
            off = {name: [row[name] for row in own if row[name] is not None] for name in ("margin_off", "force_off", "place_off")}
            out.append({"term": term, "step_ms": step, "right": sum(row["right"] for row in own), "of": len(own),
                        **{name: statistics.median(values) for name, values in off.items()}})
    return out


def order_of(found, name):
    """Exponent of the step in a median error, by least squares over 1/4 to 2 ms, where it is above rounding; None without three steps."""
    points = [(math.log(each["step_ms"]), math.log(each[name])) for each in found if 0.25 <= each["step_ms"] <= 2 and each[name]]
    return float(np.polyfit(*zip(*points), 1)[0]) if len(points) > 2 else None


# The picture.

def picture(found):
    """Share of right verdicts over cost: a panel for the random grasps, one for the suite's."""
    panels = []
    for kind, title in (("draws", "random grasps of a box"), ("suite", "the suite's ten grasps of the median man")):
        own = [each for each in found if each["set"] == kind and each["cost"] and not each["term"]]
        if not own:
            continue
        costs = [each["cost"] for each in own]
        low, high = math.floor(math.log10(min(costs)) * 2) / 2, math.ceil(math.log10(max(costs)) * 2) / 2
        least = min(0.5, math.floor(10 * min(each["right"] / each["of"] for each in own)) / 10)
        width, height, left, top = 470, 300, 60, 40
        X = lambda cost: left + (math.log10(cost) - low) / (high - low) * width
        Y = lambda share: top + (1 - share) / (1 - least) * height
        drawn = [f'<text x="{left + width / 2}" y="22" text-anchor="middle" font-size="14">{title}</text>',
                 f'<rect x="{left}" y="{top}" width="{width}" height="{height}" fill="none" stroke="#888"/>']
        for k in range(round(10 * least), 11):
            drawn += [f'<line x1="{left}" y1="{Y(k / 10):.1f}" x2="{left + width}" y2="{Y(k / 10):.1f}" stroke="#eee"/>',
                      f'<text x="{left - 6}" y="{Y(k / 10) + 4:.1f}" text-anchor="end" font-size="11">{10 * k} %</text>']
        for tenth in range(math.ceil(low), math.floor(high) + 1):
            drawn += [f'<line x1="{X(10 ** tenth):.1f}" y1="{top}" x2="{X(10 ** tenth):.1f}" y2="{top + height}" stroke="#ddd"/>',
                      f'<text x="{X(10 ** tenth):.1f}" y="{top + height + 16}" text-anchor="middle" font-size="11">{10 ** tenth:g}</text>']
        drawn.append(f'<text x="{left + width / 2}" y="{top + height + 36}" text-anchor="middle" font-size="12">CPU time, of the articulated engine\'s at 1 ms</text>')
        for place, engine in enumerate(dict.fromkeys(each["engine"] for each in own)):
            points = sorted((each for each in own if each["engine"] == engine), key=lambda each: each["cost"])
            path = " ".join(f"{X(each['cost']):.1f},{Y(each['right'] / each['of']):.1f}" for each in points)
            drawn.append(f'<polyline points="{path}" fill="none" stroke="{COLORS[engine]}" stroke-width="1.6"/>')
            for each in points:
                x, y = X(each["cost"]), Y(each["right"] / each["of"])
                label = {0.0625: "1/16", 0.125: "1/8", 0.25: "1/4", 0.5: "1/2"}.get(each["step_ms"], f"{each['step_ms']:g}")
                drawn += [f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3.5" fill="{COLORS[engine]}"/>',
                          f'<text x="{x:.1f}" y="{y + 15 + 11 * (place % 2):.1f}" text-anchor="middle" font-size="9" fill="{COLORS[engine]}">{label}</text>']
            drawn.append(f'<text x="{left + width - 8}" y="{top + height - 12 - 16 * place}" text-anchor="end" font-size="12" fill="{COLORS[engine]}">{NAMES[engine]}'
                         f' ({points[0]["of"]})</text>')
        panels.append("".join(drawn))
    parts = "".join(f'<g transform="translate({560 * k} 0)">{panel}</g>' for k, panel in enumerate(panels))
    return (f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {560 * len(panels)} 400" width="{560 * len(panels)}" height="400" font-family="sans-serif">'
            f'<rect width="100%" height="100%" fill="white"/>{parts}</svg>\n')


def write_files(rows, out):
    found = summary(rows)
    orders = {f"{kind} {engine} {name}": order_of([each for each in found if each["set"] == kind and each["engine"] == engine and not each["term"]], f"{name}_median")
              for kind, engine in dict.fromkeys((each["set"], each["engine"]) for each in found) for name in ("margin_off", "force_off", "place_off")}
    (out / "contact_step.json").write_text(json.dumps({"versions": {"handsim": hs.__version__}, "summary": found, "orders": orders, "terms": terms_of(rows), "rows": rows}, indent=1) + "\n")
    with open(out / "contact_step.csv", "w", newline="") as file:
        table = csv.writer(file)
        names = ("set", "scene", "engine", "term", "step_ms", "verdict", "right", "margin", "margin_off", "force", "force_off", "place_off", "simulated", "cpu")
        table.writerow(names)
        table.writerows([row[name] for name in names] for row in compared(rows))
    (out / "contact_step.svg").write_text(picture(found))
    return found, orders


def printed(found, orders):
    show = lambda value, scale=1.0: "-" if value is None else f"{scale * value:.2g}"
    lines = [f"{'set':10} {'engine, or more':15} {'step':>7} {'right':>9} {'margin, points':>16} {'force, %':>14} {'place, mm':>16} {'cost':>7}"]
    for each in found:
        lines.append(f"{each['set']:10} {each['engine'] if not each['term'] else each['term']:15} {each['step_ms']:7g} {each['right']:4} of {each['of']:2}"
                     f" {show(each['margin_off_median'], 100):>8}{show(each['margin_off_most'], 100):>8} {show(each['force_off_median'], 100):>7}{show(each['force_off_most'], 100):>7}"
                     f" {show(each['place_off_median'], 1e3):>8}{show(each['place_off_most'], 1e3):>8} {show(each['cost']):>7}")
    return "\n".join([*lines, *(f"order {name}: {value:.2f}" for name, value in orders.items() if value is not None)])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--draws", type=int, default=24)
    parser.add_argument("--seed", type=int, default=6301)
    parser.add_argument("--ode", type=int, default=0, help="so many of the draws also run on ODE")
    parser.add_argument("--only", nargs="*", default=["draws", "shipped", "others", "peers"], choices=["draws", "shipped", "others", "peers"])
    parser.add_argument("--engines", nargs="*", default=PEERS, choices=PEERS, help="of the suite's cases")
    parser.add_argument("--packages", type=Path, default=Path("build/peers/suite"), help="as tests/peers/suite.py")
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    # Goes on where an earlier call ended: runs that are there stay.
    told = options.out / "contact_step.json"
    rows = json.loads(told.read_text())["rows"] if told.exists() else []
    write = lambda: write_files(rows, options.out)
    run_scenes(options, rows, write)
    if "peers" in options.only:
        run_peers(options, rows, write)
    print(printed(*write()))


if __name__ == "__main__":
    main()
