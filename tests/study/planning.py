"""Figures of `handsim grasp plan`: objects by person, types, agreement with ODE and with a quarter of the step, other planners' limits.

    export PYTHONPATH=build/release/python
    python3 tests/study/planning.py objects --persons median_man small_woman --out out/planning    # shipped objects and ten meshes: objects.csv
    python3 tests/study/planning.py types --out out/planning                                       # an object for each type: types.csv, a sheet
    python3 tests/study/planning.py checks --out out/planning                                      # grasps of `objects` at 1/4 step; --ode: on ODE
    python3 tests/study/planning.py tests --persons median_man --out out/planning                  # all grips that fit, held by our limits and by others': tests.csv
    python3 tests/study/planning.py mug --out out/planning                                         # ten grasps of a mug, with their time: mug.csv
    python3 tests/study/planning.py handle --out out/planning                                      # a handle from an STL to a page: handle.csv
    python3 tests/study/planning.py tables --out out/planning                                      # tables.md of docs/planning.md, of what was measured
    python3 tests/study/planning.py stl --out out/planning                                         # stl/handle.stl, and the meshes

The meshes need trimesh, CoACD and fast-simplification, as `handsim object` does.
"""
import argparse
import csv
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

import handsim as hs
from handsim._grasp_plan import ODE, Planner, _run, object_file, planned
from handsim._grasp_plan_files import scene_text
from handsim._grasp_types import read_types

FITTING = {
    "large_diameter": "tomato_soup_can", "small_diameter": "large_marker", "medium_wrap": "spray_can screwdriver", "adducted_thumb": "screwdriver", "light_tool": "large_marker",
    "prismatic_4_finger": "large_marker", "prismatic_3_finger": "large_marker", "prismatic_2_finger": "large_marker", "palmar_pinch": "card", "power_disk": "tuna_fish_can",
    "power_sphere": "tennis_ball", "precision_disk": "tuna_fish_can", "precision_sphere": "tennis_ball", "tripod": "golf_ball", "fixed_hook": "screwdriver banana",
    "lateral": "key card", "index_finger_extension": "screwdriver", "extension_type": "gelatin_box card", "distal_type": "scissors_half large_marker", "writing_tripod": "large_marker",
    "tripod_variation": "coin large_marker", "parallel_extension": "gelatin_box card", "adduction_grip": "large_marker coin", "tip_pinch": "coin", "lateral_tripod": "coin large_marker",
    "sphere_4_finger": "baseball", "quadpod": "golf_ball", "sphere_3_finger": "racquetball", "stick": "large_marker", "palmar": "gelatin_box", "ring": "spray_can",
    "ventral": "strawberry key", "inferior_pincer": "strawberry"}
"""By type, what people hold so."""
OTHERS = ("golf_ball", "large_marker", "card", "screwdriver", "tennis_ball")
"""Then these."""
TESTED = ("mug", "tomato_soup_can", "sugar_box", "banana", "baseball", "tuna_fish_can")
TRIED = 40
FAR, TURNED = 0.05, np.radians(15)
"""Limits of the tests of planners for robots' hands: the object may move so far in the hand [m], [rad]."""
SIZES = (0.6, 0.8, 1.25, 1.5)
STATIC = ("edge_10mm", "edge_15mm", "edge_20mm", "jug", "sloper", "pinch_block")


def lathe(profile, around=32):
    """A closed surface around z; the profile [mm] begins and ends on the axis."""
    rows = np.array(profile, dtype=float) / 1000
    angles = 2 * np.pi * np.arange(around) / around
    points, rings = [], []
    for radius, z in rows:
        rings.append([len(points)] if radius == 0 else list(range(len(points), len(points) + around)))
        points += [(0, 0, z)] if radius == 0 else [(radius * np.cos(a), radius * np.sin(a), z) for a in angles]
    faces = []
    for low, high in zip(rings, rings[1:]):
        for k in range(around):
            a, b = low[k % len(low)], low[(k + 1) % len(low)]
            c, d = high[k % len(high)], high[(k + 1) % len(high)]
            faces += ([(a, b, d)] if len(low) > 1 else []) + ([(a, d, c)] if len(high) > 1 else [])
    return np.array(points), np.array(faces)


def cells(boxes, step):
    """The surface of a union of boxes on a grid. :param boxes: from and to, in steps; :param step: [mm]"""
    top = np.array([box[1] for box in boxes]).max(axis=0)
    full = np.zeros(top + 2, dtype=bool)
    for low, high in boxes:
        full[tuple(slice(a + 1, b + 1) for a, b in zip(low, high))] = True
    points, faces = {}, []
    for axis in range(3):
        for way in (1, -1):
            for cell in np.argwhere(full & ~np.roll(full, -way, axis)):
                corner = cell + (np.arange(3) == axis) * (way > 0)
                u, v = np.roll(np.eye(3, dtype=int), -axis - 1, axis=0)[:2]
                square = [points.setdefault(tuple(corner + i * u + j * v), len(points)) for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))][::way]
                faces += [(square[0], square[1], square[2]), (square[0], square[2], square[3])]
    return np.array(list(points)) * step / 1000, np.array(faces)


def meshes():
    """Ten objects by name: vertices [m], faces, mass [kg]."""
    return {
        "bottle": (*lathe([(0, 0), (32, 0), (32, 120), (13, 160), (13, 200), (0, 200)]), 0.4),
        "screwdriver": (*lathe([(0, 0), (14, 0), (16, 50), (12, 95), (3, 97), (3, 195), (0, 195)]), 0.12),
        "controller": (*cells([((0, 0, 0), (14, 5, 4)), ((0, 5, 0), (4, 9, 4)), ((10, 5, 0), (14, 9, 4))], 10), 0.25),
        "scissors_half": (*cells([((0, 0, 0), (14, 2, 1)), ((14, 0, 0), (15, 6, 1)), ((14, 5, 0), (20, 6, 1)), ((14, 0, 0), (20, 1, 1)), ((19, 0, 0), (20, 6, 1))], 6), 0.05),
        "key": (*cells([((0, 3, 0), (12, 5, 1)), ((12, 0, 0), (20, 8, 1)), ((1, 2, 0), (3, 3, 1))], 3), 0.02),
        "coin": (*lathe([(0, 0), (12.9, 0), (12.9, 2.3), (0, 2.3)]), 0.0085),
        "plate": (*lathe([(0, 0), (70, 0), (105, 18), (105, 22), (69, 5), (0, 5)]), 0.35),
        "bowl": (*lathe([(0, 0), (30, 0), (65, 55), (61, 55), (27, 5), (0, 5)]), 0.3),
        "card": (*cells([((0, 0, 0), (1, 1, 1))], 1), 0.005),
        "spray_can": (*lathe([(0, 0), (29, 0), (29, 150), (20, 165), (20, 185), (0, 185)]), 0.35)}


def stl(out):
    """A file of each mesh [mm], and of a round handle, as a CAD program writes them."""
    (out / "stl").mkdir(parents=True, exist_ok=True)
    handle = lathe([(0, 0), (14, 0), (17, 20), (17, 100), (14, 120), (0, 120)], around=12)
    for name, (vertices, faces, *_) in {**meshes(), "handle": handle}.items():
        lines = [f"solid {name}"]
        for face in 1000 * vertices[faces]:
            lines += ["facet normal 0 0 0", " outer loop", *(f"  vertex {x:.9g} {y:.9g} {z:.9g}" for x, y, z in face), " endloop", "endfacet"]
        (out / "stl" / f"{name}.stl").write_text("\n".join([*lines, f"endsolid {name}", ""]))


def tests(out, persons, only):
    """Of places that are tried, whose grip fits: how many hold by the limits of planners for robots' hands, and by ours. Goes through the whole shake."""
    rows = []
    for name, path in object_files(out).items():
        if name not in (only or TESTED):
            continue
        for person in persons:
            planner = Planner(object_file(path), person, "right", read_types(), True, 1)
            for place in planner.queue()[:TRIED]:
                try:
                    run = hs.load(planner.content(place)).run(frames=0, progress=False)
                except hs.Error:
                    continue
                shift, turn = run.figures["grasp_shift"], run.figures["grasp_turn"]  # None of an object that is lost
                held = run.figures["outcome"] == "held"
                lenient = run.fault is None and None not in (shift, turn) and shift < FAR and turn < TURNED
                rows.append({"object": name, "person": person, "type": place.type.name, "held": int(held), "held_by_5cm_15deg": int(lenient), "shift": shift, "turn": turn,
                             "force_closure": int(run.figures["force_closure"]), "epsilon": run.figures["epsilon"]})
                print(rows[-1], flush=True)
                write(out / "tests.csv", rows)
    for kind in ("held", "held_by_5cm_15deg", "force_closure"):
        print(f"{kind}: {sum(row[kind] for row in rows)} of {len(rows)}")
    closed = [row for row in rows if row["force_closure"]]
    print(f"of {len(closed)} with force closure {sum(row['held'] for row in closed)} are held, by 5 cm and 15 degrees {sum(row['held_by_5cm_15deg'] for row in closed)}")


def object_files(out):
    """By name; meshes are written once."""
    files = {path.stem: path for path in sorted((hs.data_path() / "config/objects").glob("*.yaml")) if path.stem not in STATIC}
    for name, (vertices, faces, mass) in meshes().items():
        path = out / "meshes" / f"{name}.yaml"
        path.parent.mkdir(exist_ok=True)
        if not path.exists():
            if name == "card":
                vertices = vertices * [54.0, 85.0, 0.8]
            hs.Object(vertices, faces, mass=mass, error=0.02 * float(np.ptp(vertices, axis=0).max())).write(path)
        files[name] = path
    return files


def objects(out, persons, only):
    """Goes on from the rows of objects.csv."""
    rows = read(out / "objects.csv") if (out / "objects.csv").exists() else []
    for name, path in object_files(out).items():
        if only and name not in only:
            continue
        for person in persons:
            if any(row["object"] == name and row["person"] == person for row in rows):
                continue
            start = time.monotonic()
            found = planned(path, person=person, side="right", types=[], count=1, ode=False, threads=THREADS)
            best = found.grasps[0] if found.grasps else None
            rows.append({"object": name, "person": person, "held": int(best is not None), "type": best.type.name if best else "", "margin": f"{best.margin:.3f}" if best else "",
                         "least_effort": f"{best.least_effort:.4f}" if best else "", "tried": len(found.tried), "seconds": f"{time.monotonic() - start:.0f}",
                         "why": "" if best else found.why()[0]})
            if best:
                (out / f"held_{name}_{person}.yaml").write_text(scene_text(best.content, out))
            print(rows[-1], flush=True)
            write(out / "objects.csv", rows)
    for person in persons:
        own = [row for row in rows if row["person"] == person]
        print(f"{person}: {sum(int(row['held']) for row in own)} of {len(own)} held")


def types(out, only):
    """Of each type, the first of some objects that it is held on."""
    files, rows, pictures, captions = object_files(out), [], [], []
    for name, of in read_types().items():
        if only and name not in only:
            continue
        start, held = time.monotonic(), None
        for each in [*FITTING[name].split(), *(other for other in OTHERS if other not in FITTING[name])]:
            found = planned(files[each], person="median_man", side="right", types=[name], count=1, ode=False, threads=THREADS)
            if found.grasps:
                held = each
                best = found.grasps[0]
                if hs.has_pictures:
                    pictures.append(best.scene().draw_frames([best.frame], size=(480, 360))[0])
                    captions.append(f"{of.number} {name}: {each}")
                (out / f"type_{of.number:02d}_{name}.yaml").write_text(scene_text(best.content, out))
                break
        rows.append({"number": of.number, "type": name, "object": held or "", "margin": f"{best.margin:.3f}" if held else "", "seconds": f"{time.monotonic() - start:.0f}"})
        print(rows[-1], flush=True)
        write(out / "types.csv", rows)
    if pictures:
        hs.save_png(hs.contact_sheet(pictures, captions, "types of grasps", 2400), out / "types.png")
    print(f"{sum(bool(row['object']) for row in rows)} of {len(rows)} types are held on an object")


def checks(out, persons, ode):
    """Of the grasps that `objects` has found: a quarter of the step, or ODE, where palm oppositions take minutes each and are left out."""
    rows, known = [], read_types()
    for path in sorted(path for person in persons for path in out.glob(f"held_*_{person}.yaml")):
        scene = hs.load(path)
        if ode and known[scene.title.partition(" ")[0]].opposition == "palm":
            continue
        run = _run(hs.load(path, {"solver": ODE} if ode else {"solver.step": "0.25 ms"}))
        row = {"scene": path.stem, "quarter_step": "" if ode else run.outcome, "ode": run.outcome if ode else "", "margin": run.margin}
        rows.append(row)
        print(row, flush=True)
        write(out / ("ode.csv" if ode else "checks.csv"), rows)
    key = "ode" if ode else "quarter_step"
    print(f"{key}: {sum(row[key] == 'held' for row in rows)} of {len(rows)} held")


def mug(out):
    """Ten verified grasps, with the wall time of the command itself."""
    start = time.monotonic()
    command(["grasp", "plan", "mug", "--count", "10", "--out", str(out / "mug")])
    seconds = time.monotonic() - start
    held = sum(row["held"] == "1" and row["outcome_half_step"] == "held" and row["rank"] != "" for row in read(out / "mug/grasps.csv"))
    write(out / "mug.csv", [{"grasps": held, "seconds": f"{seconds:.0f}"}])
    print(f"{held} grasps of a mug in {seconds:.0f} s")


def handle(out):
    """The three commands of docs/planning.md, from the STL file to the page; means by thickness and part."""
    stl(out)
    start = time.monotonic()
    folder = out / "handle"
    folder.mkdir(exist_ok=True)
    sizes = {f"handle_{round(100 * factor):03d}": factor for factor in SIZES}
    command(["object", str(out / "stl/handle.stl"), "--unit", "mm", "--mass", "200g", "--sizes", *map(str, SIZES), "--out", str(folder / "handle.yaml")])
    command(["grasp", "plan", str(folder / "handle.yaml"), "--type", "medium_wrap", "--count", "1", "--others", *(str(folder / f"{name}.yaml") for name in sizes), "--out",
             str(folder / "plan")])
    command(["rollouts", str(folder / "plan/who.yaml"), "--count", "1", "--report", "--out", str(folder / "who")])
    rows = read(folder / "who/rollouts.csv")
    figures = ["margin", *(f"force.{part}[N]" for part in ("thumb", "index", "middle", "ring", "little", "palm"))]
    table = []
    for name, factor in sorted({"handle": 1.0, **sizes}.items(), key=lambda each: each[1]):
        own = [row for row in rows if Path(row["objects.0.file"]).stem == name]
        held = [row for row in own if row["held"] == "1"]
        means = {key: f"{np.mean([float(row[key]) for row in held]):.3g}" if held else "" for key in figures}
        table.append({"thickness[mm]": f"{34 * factor:.0f}", "held": len(held), "of": len(own), **means})
        print(table[-1])
    write(out / "handle.csv", table)
    print(f"{time.monotonic() - start:.0f} s; {folder / 'who/report.html'}")


def tables(out):
    """Markdown of all tables whose files are there."""
    def line(what, rows, name="object"):
        lost = [row[name] for row in rows if row["held"] != "1"]
        return f"| {what} | {len(rows) - len(lost)} of {len(rows)}{'; not: ' + ', '.join(lost) if lost else ''} |"

    lines = ["| | held |", "| --- | --- |"]
    if (out / "objects.csv").exists():
        rows = read(out / "objects.csv")
        for person in dict.fromkeys(row["person"] for row in rows):
            for what, ten in (("shipped objects", False), ("ten meshes", True)):
                lines.append(line(f"{what}, {person}", [row for row in rows if row["person"] == person and (row["object"] in meshes()) == ten]))
    if (out / "types.csv").exists():
        lines.append(line("types, median_man", [{**row, "held": str(int(bool(row["object"])))} for row in read(out / "types.csv")], "type"))
    for name, what, key in (("checks.csv", "of their grasps at a quarter of the step", "quarter_step"), ("ode.csv", "of those by pads and sides on ODE", "ode")):
        if (out / name).exists():
            lines.append(line(what, [{**row, "held": str(int(row[key] == "held"))} for row in read(out / name)], "scene"))
    if (out / "tests.csv").exists():
        rows = read(out / "tests.csv")
        for key in ("held", "held_by_5cm_15deg", "force_closure"):
            lines.append(f"| grips that fit: {key} | {sum(row[key] == '1' for row in rows)} of {len(rows)} |")
    if (out / "mug.csv").exists():
        lines += [f"| grasps of a mug, in {row['seconds']} s | {row['grasps']} |" for row in read(out / "mug.csv")]
    if (out / "handle.csv").exists():
        rows = read(out / "handle.csv")
        lines += ["", f"| {' | '.join(rows[0])} |", f"| {' | '.join('---' for _ in rows[0])} |", *(f"| {' | '.join(row.values())} |" for row in rows)]
    if (out / "objects.csv").exists():
        lines += ["", "| object | person | type | margin | least effort | s |", "| --- | --- | --- | --- | --- | --- |"]
        lines += [f"| {row['object']} | {row['person']} | {row['type'] or '-'} | {row['margin'] or '-'} | {row['least_effort'] or '-'} | {row['seconds']} |"
                  for row in read(out / "objects.csv")]
    (out / "tables.md").write_text("\n".join(lines) + "\n")
    print("\n".join(lines))


def command(words):
    """Runs the program as people do; a plan that is not held by all is no failure of the study."""
    done = subprocess.run([sys.executable, "-m", "handsim", *words], stdout=subprocess.DEVNULL)
    if done.returncode > 1:
        sys.exit(f"handsim {' '.join(words)}: exit status {done.returncode}")


def read(path):
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


def write(path, rows):
    with open(path, "w", newline="") as file:
        table = csv.DictWriter(file, list(rows[0]))
        table.writeheader()
        table.writerows(rows)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("objects", "types", "checks", "tests", "mug", "handle", "tables", "stl"))
    parser.add_argument("--persons", nargs="+", default=["median_man", "small_woman"])
    parser.add_argument("--only", nargs="+", default=[])
    parser.add_argument("--ode", action="store_true", help="of checks: on ODE in place of a quarter of the step")
    parser.add_argument("--out", type=Path, default=Path("out/planning"))
    parser.add_argument("--threads", type=int, default=0, help="one for each core")
    asked = parser.parse_args()
    THREADS = asked.threads
    asked.out.mkdir(parents=True, exist_ok=True)
    {"objects": lambda: objects(asked.out, asked.persons, asked.only), "types": lambda: types(asked.out, asked.only), "checks": lambda: checks(asked.out, asked.persons, asked.ode),
     "tests": lambda: tests(asked.out, asked.persons, asked.only), "stl": lambda: stl(asked.out),
     "mug": lambda: mug(asked.out), "handle": lambda: handle(asked.out), "tables": lambda: tables(asked.out)}[asked.what]()
