"""The suite of handsim export --suite in every engine that is there, for ./dev peers and docs/suite.md.

    PYTHONPATH=build/release/python python3 tests/peers/suite.py --out out/docs/peers/suite --packages build/peers/suite
    PYTHONPATH=build/release/python python3 tests/peers/suite.py --out out/release --only articulated --release tests/data/suite/release.csv

Each engine runs by its driver in the suite, from the packages of tests/peers/suite/NAME.txt. DIR/suite.json has verdicts, figures and CPU times
of all; --release writes the verdicts and figures of the articulated engine, with which a test compares later ones.
"""
import argparse
import json
import os
import subprocess
import sys
from pathlib import Path

MEDIAN = [f"grasp_{name}.median_man" for name in ("tripod", "pinch", "cup", "cylinder_50mm", "cylinder_100mm", "power_can", "sphere_35mm",
                                                   "sphere_70mm", "hook_bar", "cracker_box")]
ENGINES = {  # name: driver, packages
    "articulated": (["handsim_driver.py", "--engine", "articulated"], None), "ode": (["handsim_driver.py", "--engine", "ode"], None),
    "mujoco4": (["mujoco_driver.py"], "mujoco4"), "mujoco3": (["mujoco_driver.py"], "mujoco3"), "mujoco32": (["mujoco_driver.py"], "mujoco32"), "drake": (["drake_driver.py"], "drake"),
    "pybullet": (["pybullet_driver.py"], "pybullet"), "newton": (["newton_driver.py"], "newton")}
FIGURES = ("shift", "turn", "shaken", "creep", "grip")


def environment(packages):
    """Of a driver: the engine's packages alone, or those of this interpreter."""
    paths = os.environ.get("PYTHONPATH", "").split(os.pathsep) if packages is None else [packages]
    own = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1", "PYTHONPATH": os.pathsep.join(str(Path(each).resolve()) for each in paths if each)}
    return own


FEWER = {"newton": [*MEDIAN, "pinch_box", "pinch_box_at_limit", "stack", "incline_sticks"]}
"""A step takes 15 ms there: some cases are a quarter of an hour."""


def run_engine(name, suite, out, packages, only):
    driver, needs = ENGINES[name]
    if needs is not None and not (packages / needs).is_dir():
        print(f"suite: without {name}: no {packages / needs}", file=sys.stderr)
        return
    results, only = out / name, only or FEWER.get(name, [])
    results.mkdir(parents=True, exist_ok=True)
    command = [sys.executable, str((suite / "drivers" / driver[0]).absolute()), *driver[1:], "--out", str(results.absolute()), *(["--only", *only] if only else [])]
    # In the folder of its results: MuJoCo writes a log where it runs.
    subprocess.run(command, env=environment(None if needs is None else packages / needs), check=True, stdout=subprocess.DEVNULL, cwd=results)
    told = results / "judged.json"
    judged = subprocess.run([sys.executable, str(suite / "judge.py"), str(results), "--json", str(told), *(["--only", *only] if only else [])],
                            stdout=subprocess.DEVNULL)
    if judged.returncode not in (0, 1):
        sys.exit(f"suite: {name}: the judge refused the tables")
    told.write_text(json.dumps({**json.loads(told.read_text()), "name": name}, indent=1) + "\n")


def release_text(engine, suite):
    """A row for each case: verdict and figures in SI, with six digits; the grip as a force."""
    rows = ["case,verdict," + ",".join(FIGURES)]
    for case in engine["cases"]:
        of = {figure["name"]: figure["value"] for figure in case["figures"]}
        for spec in json.loads((suite / case["case"] / "case.json").read_text())["judge"]:
            if spec["measure"] == "grip":
                of["grip"] *= spec["of"]
        rows.append(",".join([case["case"], case["verdict"], *("" if of.get(name) is None else f"{of[name]:.6g}" for name in FIGURES)]))
    return "\n".join(rows) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--packages", type=Path, default=Path("build/peers/suite"))
    parser.add_argument("--only", nargs="*", default=[], choices=ENGINES, metavar="ENGINE", help=", ".join(ENGINES))
    parser.add_argument("--cases", nargs="*", default=[])
    parser.add_argument("--suite", type=Path, help="an exported one in place of a new one")
    parser.add_argument("--release", type=Path)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    suite = options.suite or options.out / "cases"
    if options.suite is None:
        subprocess.run([sys.executable, "-m", "handsim", "export", "--suite", str(suite), "--quiet"], check=True, env=environment(None))
    for name in options.only or ENGINES:
        run_engine(name, suite, options.out, options.packages, options.cases)
    # Those of an earlier call, too, so that engines can run side by side.
    engines = [json.loads(told.read_text()) for name in ENGINES if (told := options.out / name / "judged.json").exists()]
    size = sum(path.stat().st_size for path in suite.rglob("*") if path.is_file())
    (options.out / "suite.json").write_text(json.dumps({"size": size, "engines": engines}, indent=1) + "\n")
    if options.release:
        options.release.parent.mkdir(parents=True, exist_ok=True)
        options.release.write_text(release_text(next(engine for engine in engines if engine["name"] == "articulated"), suite))
    return 0


if __name__ == "__main__":
    sys.exit(main())
