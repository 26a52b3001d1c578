#!/usr/bin/env python3
"""Writes the measured tables of README.md and docs/, and checks the pages.

A table is between `<!-- table: NAME -->` and `<!-- end -->`. Its figures come from the files of a study:
`./dev docs` runs every study and writes its tables, `./dev docs NAME...` does so for the named studies,
`--keep` uses the files of the study that are already in out/docs/, `--pictures` also updates the study's plots in
renders/, `--list` lists the studies with their times, `--check` checks the pages without running a study
(see check_pages.py). `./dev docs keys` writes the defaults and ranges in tables of keys (see keys.py).
The copy of a file is between `<!-- file: PATH -->` and `<!-- end -->`; it is always updated.
"""
import argparse
import os
import re
import shlex
import shutil
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path

sys.dont_write_bytecode = True
import keys  # noqa: E402
import measured  # noqa: E402
import measured_gradients  # noqa: E402
from measured import CLIMBS, CONTROLLERS, OUT, PERSONS, ROOT, Missing  # noqa: E402

TABLES = {**measured.TABLES, **measured_gradients.TABLES}

# Packages that ./dev peers fetches.
PACKAGES = ROOT / "build" / "peers" / "packages"
# Python packages pin and mujoco of PyPI.
PIN = ROOT / "out" / "pin"
# Those of tests/peers/inverse_kinematics.py.
IK = ROOT / "out" / "ik"
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(PACKAGES),
               "HANDSIM_DRAKE_STEPS": str(ROOT / "tests" / "peers" / "drake_steps.py")}
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
BLOCK = re.compile(r"(<!-- (table|file): (\S+) -->\n)(.*?)(<!-- end -->)", re.S)


@dataclass
class Study:
    """Runs that give the figures of tables. `runs`: label -> arguments of handsim; {out} is the run's folder."""
    time: str  # CPU time of all runs
    runs: dict
    pictures: dict = field(default_factory=dict)  # file of a run -> name in renders/


def climb_runs():
    files = [f"config/climb_{name}.yaml" for name in CLIMBS]
    grasp = ["grasp", *files, "--out", "{out}"]
    crimp = ["grasp", files[0], "--out", "{out}"]
    edge = lambda mm, y: [*crimp, "--set", f"objects.0.file=config/objects/edge_{mm}mm.yaml", "--set",
                          f"objects.0.position=[0, {y}, 0.5]"]
    return {"both": [*grasp, "--side", "both"], "slippery": [*grasp, "--friction", "0.05"],
            "2ms": [*grasp, "--set", "solver.step=2 ms"],
            "articulated": [*grasp, "--engine", "articulated"],
            "15mm": edge(15, 0.005), "10mm": edge(10, 0.01),
            "200Ns": [*crimp, "--set", "climbs.0.load.rate=200"],
            "half_strength": [*crimp, "--set", "hands.0.person.grip_strength=262.5"],
            "woman": [*crimp, "--set", "hands.0.person=config/persons/median_woman.yaml"]}


def pose_runs():
    runs = {}
    for controller, steps in CONTROLLERS.items():
        for step in steps:
            for person, (stature, mass) in PERSONS.items():
                sets = [f"control.controller=controllers/{controller}.yaml", f"solver.step={step} ms"]
                for hand in (0, 1):
                    sets += [f"hands.{hand}.person.stature={stature}", f"hands.{hand}.person.mass={mass}"]
                runs[f"{controller}_{step}_{person}"] = [
                    "run", "config/every_pose.yaml", "--out", "{out}", "--quiet",
                    *(word for text in sets for word in ("--set", text))]
    return runs


def tracking_runs():
    weightless = "effects=[joint_stops, passive_tissue, actuation, wrist_motion]"
    run = ["run", "config/pose_tracking.yaml", "--out", "{out}", "--quiet"]
    return {"gravity": run, "weightless": [*run, "--set", weightless],
            "articulated": [*run, "--engine", "articulated"],
            "articulated_20ms": [*run, "--engine", "articulated", "--set", "solver.step=20 ms"]}


def bench_runs():
    """The day at the bench: each run reads files of those before it."""
    of = lambda label, name: str(OUT / "bench" / label / name)
    track = ["track", of("true", "markers.csv"), "--person", "config/persons/median_woman.yaml", "--truth",
             of("true", "trajectory.mot"), "--out", "{out}"]
    apart = "effects=[gravity, joint_stops, passive_tissue, actuation, wrist_motion]"
    return {"true": ["run", "config/bench.yaml", "--out", "{out}", "--quiet"], "exact": track,
            "tracked": [*track, "--noise", "2 mm"],
            "inverse": ["inverse", of("tracked", "scene.yaml"), "--set", apart, "--out", "{out}"],
            "true_torques": ["inverse", "config/bench.yaml", "--out", "{out}"],
            "run": ["run", of("tracked", "scene.yaml"), "--out", "{out}", "--quiet"]}


STUDIES = {
    "bench": Study("10 s", bench_runs(), {"tracked/right_angles.png": "bench_angles.png", "inverse/torques.png": "bench_torques.png"}),
    "demo": Study("1 s", {"run": ["run", "config/two_hands.yaml", "--out", "{out}"],
                          "few_iterations": ["run", "config/two_hands.yaml", "--out", "{out}", "--quiet", "--set",
                                             "solver.method=quick_step", "--set", "solver.iterations=5"]}),
    "hand": Study("1 s", {"hand": ["hand", "--stature", "1.75", "--mass", "72", "--sex", "male", "--side", "right"]}),
    "formats": Study("1 s", {"formats": None}),
    "keys": Study("1 s", {}),
    "poses": Study("20 s", pose_runs()),
    "tracking": Study("20 s", tracking_runs()),
    "grasp": Study("6 min", {"both": ["grasp", "config", "--out", "{out}", "--side", "both"]}),
    "agreement": Study("45 min", {"run": None}),
    "contact_step": Study("30 min", {"run": None}, {"run/contact_step.svg": "contact_step.svg"}),
    "climb": Study("1 min", climb_runs()),
    "contacts": Study("1.5 min", {"contacts": None},
                      {"contacts/contacts_cost.png": "contacts_cost.png"}),
    "accuracy": Study("1.5 min", {"run": None},
                      {"run/error_cost.png": "accuracy.png"}),
    "hands": Study("10 s", {"run": ["accuracy", "config/accuracy_two_hands.yaml", "--out", "{out}"]}),
    "2017": Study("1 min", {"run": ["accuracy", "config/accuracy_2017.yaml", "--out", "{out}"]}),
    "effects": Study("30 s", {"run": ["effects", "config/dropped_hand.yaml", "--out", "{out}"],
                                "muscles": ["effects", "config/muscle_poses.yaml", "--set", "duration=2", "--out", "{out}"]},
                     {"run/effects.png": "effects.png"}),
    "stability": Study("13 min", {"run": ["stability", "config/stability.yaml", "--out", "{out}"]},
                       {"run/stability.png": "stability.png", "run/scenes.png": "stability_scenes.png"}),
    "rollouts": Study("50 min", {
        "power_can": ["rollouts", "config/rollouts_power_can.yaml", "--out", "{out}"],
        "pinch": ["rollouts", "config/rollouts_pinch.yaml", "--out", "{out}", "--count", "1000"],
        "free_fall": ["rollouts", "config/rollouts_free_fall.yaml", "--out", "{out}", "--count", "1000"],
        "free_fall_articulated": ["rollouts", "config/rollouts_free_fall.yaml", "--out", "{out}", "--engine", "articulated"]},
        {"power_can/rollouts.png": "rollouts_power_can.png"}),
    "handle": Study("8 min", {"run": ["rollouts", "config/rollouts_handle.yaml", "--out", "{out}"]},
                    {"run/rollouts.png": "rollouts_handle.png"}),
    "speed": Study("16 min", {"bench": None}),
    "environment": Study("1 min", {"bench": None}),
    "passes": Study("2 min", {"bench": None}),
    "muscles": Study("10 s", {"bench": None}),
    "validate": Study("1 min", {"run": ["validate", "config/validate.yaml", "--runs", "--out", "{out}"]},
                      {"run/validate.png": "validate.png"}),
    "clinic": Study("10 s", {"run": ["validate", "config/clinic.yaml", "--runs", "--out", "{out}"]}),
    "pinch": Study("2 min", {"test": None}),
    "export": Study("1 min", {"mujoco": None, "opensim": None}),
    "learning": Study("10 min", {"run": None}),
    "skin": Study("1 min", {"run": None}),
    "tests": Study("1 s", {"long": None, "run": None}),
    "gradients": Study("1 min", {"errors": None, "times": None}),
    "reach": Study("1 min", {"run": None}),
    "ik": Study("3 min", {"run": None}),
    "peers": Study("30 min", {"accuracy": None, "pinch": None, "bench": None, "cases_handsim": None, "cases_mujoco": None,
                              "cases_drake": None}),
    "suite": Study("30 min", {"suite": None}),
}
# Benchmarks of studies of their own; "speed" runs all others.
BENCHMARKS = {"environment": "^(batch_|muscle_batch_|two_threads|reset/|memory/)", "passes": "friction_passes", "muscles": "step_with_muscles"}
# Studies that run only if they are named: ./dev peers builds their programs or fetches them; learning needs envpool and onnx, gradients
# pin and mujoco, ik mink, dex_retargeting and opensim (PyPI); tests reads what ctest has run in this checkout.
ONLY_IF_NAMED = ("contact_step", "peers", "suite", "learning", "gradients", "reach", "ik", "tests")


# Running studies and writing pages.

def python_of(build):
    """The interpreter that the Python package was built for."""
    found = re.search(r"^Python_EXECUTABLE:\w+=(.+)$", (build / "CMakeCache.txt").read_text(), re.M)
    return found[1] if found else sys.executable


def command_of(name, label, build):
    """The command of a run."""
    if name in BENCHMARKS:
        return [str(build / "tests" / "bench_handsim"), f"--benchmark_filter={BENCHMARKS[name]}",
                f"--benchmark_out={OUT / name / 'bench.json'}"]
    if name == "speed":
        return [str(build / "tests" / "bench_handsim"), f"--benchmark_filter=-{'|'.join(BENCHMARKS.values())}", "--benchmark_repetitions=9",
                "--benchmark_report_aggregates_only=true", f"--benchmark_out={OUT / 'speed' / 'bench.json'}"]
    if name == "agreement":
        return [python_of(build), "tests/study/agreement.py", "--draws", "100", "--seed", "2201", "--out", str(OUT / name / label)]
    if name == "contact_step":
        return [python_of(build), "tests/study/contact_step.py", "--draws", "24", "--seed", "6301", "--ode", "3", "--packages", str(ROOT / "build" / "peers" / "suite"),
                "--out", str(OUT / name / label)]
    if name == "formats":
        return [python_of(build), "-c", "import json; from handsim._formats import FORMATS; "
                "print(json.dumps([[of.name, of.endings, of.text, of.of, of.needs] for of in FORMATS.values()]))"]
    if name == "learning":
        return [python_of(build), "tests/peers/learning.py", "--cpu-minutes", "0.7", "--seconds", "2", "--beside", "myoHandReachRandom-v0", "HandReachDense-v3",
                "AdroitHandRelocate-v1", "--out", str(OUT / name)]
    if name == "tests":
        return {"long": ["ctest", "--test-dir", str(build), "-N", "-L", "^long$"], "run": ["cat", str(build / "Testing/Temporary/CTestCostData.txt")]}[label]
    if name == "skin":
        return [python_of(build), "tests/output/skin_figures.py", str(OUT / name / "skin.json")]
    if name == "suite":
        return [python_of(build), "tests/peers/suite.py", "--out", str(OUT / name), "--packages", str(ROOT / "build" / "peers" / "suite")]
    if name == "reach":
        return [python_of(build), "tests/peers/optimise.py", "--out", str(OUT / name / "reach.json")]
    if name == "ik":
        return [python_of(build), "tests/peers/inverse_kinematics.py", str(build / "src" / "handsim"), "--packages", str(IK), "--out", str(OUT / name / "ik.json")]
    if name == "gradients":
        return {"errors": [str(build / "tests" / "test_derivatives"), "--gtest_filter=SceneDerivatives.*"],
                "times": [python_of(build), "tests/peers/derivatives.py", *(["--peers", str(PIN)] if PIN.exists() else []), "--out", str(OUT / name / "derivatives.json")]}[label]
    if name == "contacts":
        return [str(build / "tests" / "contact_cost"), str(OUT / name / label)]
    if name == "export":
        return {"mujoco": [str(build / "tests" / "test_export"), "--gtest_filter=*ABlockSlides*:*StayInTheHand*"],
                "opensim": [str(build / "tests" / "test_osim"), "--gtest_filter=*InOpenSim*"]}[label]
    if name == "pinch":
        return [str(build / "tests" / "peers" / "test_peers"), "--gtest_filter=*MujocoPinch*"]
    if name == "accuracy":
        return [str(build / "tests" / "peers" / "peer_accuracy"), "tests/peers/accuracy_slider_crank.yaml", "--out", str(OUT / name / label)]
    if name == "peers":
        newest = build / "tests" / "peers" / "newest"
        out = OUT / name
        if label.startswith("cases_"):
            return [str(newest / "peer_cases"), "config/stability.yaml", str(out / f"{label}.json"), label.removeprefix("cases_")]
        return {"accuracy": [str(build / "tests" / "peers" / "peer_accuracy"), "tests/peers/accuracy_newest.yaml", "--out",
                             str(out / label), "--peers", str(newest)],
                "pinch": [str(newest / "test_pinch")],
                "bench": [str(newest / "bench_peers"), "--benchmark_filter=mujoco|pinocchio|hand_to_engine|two_threads",
                          "--benchmark_repetitions=5", "--benchmark_report_aggregates_only=true",
                          f"--benchmark_out={out / 'bench.json'}"]}[label]
    return [str(build / "src" / "handsim"),
            *(word.format(out=OUT / name / label) for word in STUDIES[name].runs[label])]


def run_study(name, build, handsim):
    (OUT / name).mkdir(parents=True, exist_ok=True)
    for label in STUDIES[name].runs:
        command = command_of(name, label, build)
        if handsim and command[0].endswith("/handsim"):
            command[0] = handsim
        if label == "cases_drake" and not (PACKAGES / "pydrake").exists():
            continue
        print("+", shlex.join(command), flush=True)
        # Only comparisons need those packages: they replace numpy, and Debian's SciPy does not take theirs.
        paths = os.pathsep.join([str(build / "python"), *([ENVIRONMENT["PYTHONPATH"]] if name in ("peers", "ik", "learning") else [])])
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, env={**ENVIRONMENT, "PYTHONPATH": paths})
        (OUT / name / f"{label}.txt").write_text(done.stdout)
        (OUT / name / f"{label}.err").write_text(done.stderr)
        sys.stderr.write(done.stderr)
        # Exit status 1: a criterion failed, which the table shows. Others are errors of this script or the scene.
        if done.returncode not in (0, 1):
            sys.exit(f"docs: {shlex.join(command)}: exit status {done.returncode}")


def copy_of(path):
    text = (ROOT / path).read_text()
    return f"```{ {'.cpp': 'cpp', '.yaml': 'yaml'}.get(Path(path).suffix, '') }\n{text.rstrip()}\n```\n"


def write_pages(names, handsim):
    """Writes the tables of these studies and every copied file. Of the study `keys`, those of keys."""
    missing = []
    def block(match):
        head, kind, name, _, end = match.groups()
        if kind == "file":
            return head + copy_of(name) + end
        if name not in TABLES or TABLES[name][0] not in names:
            return match.group(0)
        try:
            return head + TABLES[name][1]() + end
        except Missing as what:
            missing.append(f"table {name}: no {what}")
            return match.group(0)
    for page in PAGES:
        text = page.read_text()
        new = BLOCK.sub(block, keys.with_keys(text, handsim) if "keys" in names else text)
        if new != text:
            page.write_text(new)
            print("docs: wrote", page.relative_to(ROOT))
    return missing


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("studies", nargs="*", help="studies to run; default: all")
    parser.add_argument("--keep", action="store_true", help="use the files in out/docs/, run nothing")
    parser.add_argument("--pictures", action="store_true", help="also update the studies' plots in renders/")
    parser.add_argument("--list", action="store_true", help="list the studies with their times")
    parser.add_argument("--check", action="store_true", help="check the pages, run no study")
    parser.add_argument("--build", type=Path, default=ROOT / "build" / "release", help="build folder")
    parser.add_argument("--handsim", help="program, if not the build folder's")
    options = parser.parse_args()
    handsim = options.handsim or str(options.build / "src" / "handsim")
    if options.list:
        for name, study in STUDIES.items():
            print(f"{name}: {len(study.runs)} run(s), {study.time} of CPU time")
        return 0
    if options.check:
        import check_pages
        return check_pages.check(handsim)
    unknown = [name for name in options.studies if name not in STUDIES]
    if unknown:
        parser.error(f"unknown study {', '.join(unknown)}; known: {', '.join(STUDIES)}")
    names = options.studies or [name for name in STUDIES if name not in ONLY_IF_NAMED]
    for name in names:
        if not options.keep:
            run_study(name, options.build, options.handsim)
        for source, target in (STUDIES[name].pictures if options.pictures else {}).items():
            shutil.copyfile(OUT / name / source, ROOT / "renders" / target)
    missing = write_pages(names, handsim)
    print("\n".join(f"docs: {line}" for line in missing), end="\n" if missing else "")
    return 1 if missing and not options.keep else 0


if __name__ == "__main__":
    sys.exit(main())
