#!/usr/bin/env python3
"""Draws the pictures of renders/ anew: `./dev renders` all of them (hours of CPU time), `./dev renders NAME...` some.

Each picture is made by commands that stand on its page, or by a study of tables.py. `--list` names the pictures with their CPU times;
`./dev docs --check` checks that every picture is in this list, and every command on its page. A page of pictures carries its
captions as text (PNG iTXt), which `ctest -R Renders` compares with what the run says today.
"""
import argparse
import os
import re
import shlex
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

sys.dont_write_bytecode = True
import tables  # noqa: E402

ROOT = tables.ROOT
SHEET = "contact_sheet.png"


@dataclass
class Picture:
    """Its page, the commands there, one after the other, the file that they make, and their CPU time."""
    page: str
    commands: list
    made: str = ""  # empty: the last command writes it into renders/
    time: str = "10 s"


LEARN = ["python3 python/examples/learn_to_hold_the_can.py --out out/learn"]
AS = "--environments 128 --rows 512 --epochs 4 --rate 1e-3"
BUTTON = [f"python3 python/examples/ppo.py --task button --drive targets {AS} --deviation 0.4 --cpu-minutes 3 --until 0.99 --out out/button"]
RELOCATE = [f"python3 python/examples/ppo.py --task relocate --drive targets --option synergy=true {AS} --deviation 0.5 --cpu-minutes 8 --until 0.97 "
            "--out out/relocate"]
BOTTLE = [f"python3 python/examples/ppo.py --task bottle --drive targets --option synergy=true {AS} --deviation 0.5 --cpu-minutes 3 --until 0.97 "
          "--out out/bottle"]
REACH = ["python3 python/examples/ppo.py --task reach --drive muscles --cpu-minutes 8 --until 0.97 --out out/reach"]
ROTATE = [f"python3 python/examples/ppo.py --task rotate --drive targets {AS} --deviation 0.5 --cpu-minutes 10 --out out/rotate"]
LEARNED = [("reach", REACH, "eq(n,0)+eq(n,12)+eq(n,49)", "3 min"), ("button", BUTTON, "eq(n,0)+eq(n,4)+eq(n,20)", "1 min"), ("relocate", RELOCATE, "eq(n,0)+eq(n,12)+eq(n,40)", "4 min"),
           ("bottle", BOTTLE, "eq(n,0)+eq(n,15)+eq(n,40)", "2 min"), ("rotate", ROTATE, "eq(n,0)+eq(n,15)+eq(n,40)", "10 min")]
WRITE = ["handsim optimise pen --goal write --out out/write --iterations 60"]
LIFT = ["handsim optimise muscle_pinch --goal lift --out out/lift"]
MPC = ["PYTHONPATH=build/release/python OPENBLAS_NUM_THREADS=1 python3 python/examples/mpc.py --push 4 --video --out out/mpc"]
CAN = ('handsim run grasp_power_can --poses --set grasps.0.hold="1 s" --set grasps.0.lift.height="0.1 m" '
       '--set "grasps.0.shake.levels=[]" --set "pictures.size=[480, 360]"')

PICTURES = {
    "two_hands.png": Picture("docs/pictures.md", ["handsim run config/two_hands.yaml --out out/two_hands --frames 8"], f"out/two_hands/{SHEET}", "1 s"),
    "hands.png": Picture("README.md", ["handsim hand --stature 1.75 --mass 72 --sex male --side both --out out/hand"], "out/hand/hand.png", "1 s"),
    "dropped_hand.png": Picture("README.md", ["handsim render dropped_hand --time 0.5"], "out/dropped_hand.png", "2 s"),
    "poses.png": Picture("README.md", ['handsim run every_pose --poses --set "pictures.size=[400, 256]"'],
                         f"out/every_pose/{SHEET}", "3 s"),
    "grasp_power_can.png": Picture("README.md", [CAN], f"out/grasp_power_can/{SHEET}", "8 s"),
    "planned.png": Picture("README.md", ["handsim grasp plan mug --count 6 --out out/mug"], f"out/mug/{SHEET}", "40 s"),
    "climb_half_crimp.png": Picture("README.md", ["handsim run climb_half_crimp --poses"], f"out/climb_half_crimp/{SHEET}", "10 s"),
    "climb_jug.png": Picture("docs/climbing.md", ["handsim run config/climb_jug.yaml --out out/jug --poses"], f"out/jug/{SHEET}", "6 s"),
    "objects.png": Picture("docs/contact.md", ["handsim render config/object_collection.yaml --time 1 --out out/objects.png"], "out/objects.png"),
    "two_hands_contact.png": Picture("docs/contact.md", ["handsim run config/two_hands_contact.yaml --out out/contact --poses"], f"out/contact/{SHEET}"),
    "report.png": Picture("docs/report.md", [
        "handsim run config/two_hands.yaml --out out/two_hands --report",
        "python3 tests/report/look.py out/two_hands/report.html --picture renders/report.png --time 0.3 "
        """--script "for (const i of [0, 1]) document.querySelectorAll('#layers input')[i].click()" """]),
    "report_failed.png": Picture("docs/report.md", [
        "handsim grasp config/grasp_sphere_70mm.yaml --out out/grasps --friction 0.3 --engine articulated --report",
        "python3 tests/report/look.py out/grasps/grasp_sphere_70mm/report.html --picture renders/report_failed.png --time 26.25"]),
    "bands.png": Picture("docs/persons.md", [
        "handsim inverse config/every_pose.yaml --uncertain 60 --report --out out/torques",
        "python3 tests/report/look.py out/torques/report.html --picture renders/bands.png"], time="1 min"),
    "live.png": Picture("docs/live.md", ["tests/live/look.py renders/live.png"]),
    "skin.png": Picture("docs/pictures.md", ["python3 tests/output/skin_sheet.py renders/skin.png"], time="1 min"),
    "forearm.png": Picture("docs/persons.md", [
        'handsim run config/two_hands.yaml --out out/forearm --frames 4 --set duration=1 --set "pictures={size: [480, 360], view: three_quarter}" '
        '--set "title=a forearm turns, and the wrist falls" '
        '--set "hands=[{model: handmodels/forearm.yaml, person: config/persons/median_man.yaml, side: right, '
        'wrist: {mount: universal, position: [0, 0, 0.3]}, pose: {forearm: 40 deg, ring_cmc: 12 deg, little_cmc: 25 deg}}]"'],
        f"out/forearm/{SHEET}", "2 s"),
    "forces.svg": Picture("docs/muscles.md", ["handsim compare median_man median_woman --out out/forces"],
                          "out/forces/compare.svg", "2 min"),
    "clinic.svg": Picture("docs/clinic.md", ['handsim compare median_man --set "hands.0.without=[ulnar_nerve_at_wrist]" --out out/clinic'],
                          "out/clinic/compare.svg", "2 min"),
    "write.svg": Picture("docs/optimise.md", WRITE, "out/write/optimise.svg", "5 min"),
    "lift.svg": Picture("docs/optimise.md", LIFT, "out/lift/optimise.svg", "5 min"),
    "write.png": Picture("docs/optimise.md", [*WRITE, "handsim run out/write/scene.yaml --out out/write_frames --frames 8"],
                         f"out/write_frames/{SHEET}", "5 min"),
    "lift.png": Picture("docs/optimise.md", [*LIFT, "handsim run out/lift/scene.yaml --out out/lift_frames --frames 8"],
                        f"out/lift_frames/{SHEET}", "5 min"),
    "mpc.svg": Picture("docs/optimise.md", MPC, "out/mpc/mpc.svg", "2 min"),
    "mpc.gif": Picture("docs/optimise.md", [*MPC, "ffmpeg -y -i out/mpc/mpc.mp4 renders/mpc.gif"], time="2 min"),
    "grasp_types.png": Picture("docs/planning.md", [
        "python3 tests/study/planning.py types --out out/planning",
        'ffmpeg -y -i out/planning/types.png -vf "scale=840:-1:flags=area,split[a][b];[a]palettegen[p];[b][p]paletteuse" '
        "renders/grasp_types.png"], time="4 min"),
    "learn_curve.png": Picture("docs/python.md", LEARN, "out/learn/curve.png", "1 min"),
    "learn_can.png": Picture("docs/python.md", LEARN, "out/learn/film_strip.png", "1 min"),
    "learned.gif": Picture("docs/python.md", LEARN, "out/learn/learned.gif", "1 min"),
    **{f"ppo_{name}_curve.png": Picture("docs/python.md", commands, f"out/{name}/curve.png", time)
       for name, commands, _, time in LEARNED},
    **{f"ppo_{name}.png": Picture("docs/python.md", [
        *commands, f"python3 -m handsim.gym out/{name}/policy.onnx --episodes 64 --out out/{name}_played",
        f"""ffmpeg -i out/{name}_played/played.mp4 -vf "select='{frames}',tile=3x1" -frames:v 1 renders/ppo_{name}.png"""], time=time)
       for name, commands, frames, time in LEARNED},
}
# Drawn from files or by hand: no command of a clone makes them.
BY_HAND = {"grip_by_age.png": "a table of a paper, see docs/persons.md", "palm.png": "four cameras on the shapes of handsim hand"}


def of_studies():
    """Pictures of the studies of tables.py: name -> study."""
    return {picture: name for name, study in tables.STUDIES.items() for picture in study.pictures.values()}


def on_one_line(text):
    """Without line ends, their backslashes and comments' blanks, so that a command is found however a page breaks it."""
    return re.sub(r"[\s\\]+", " ", text).strip()


def check(problems):
    """Every picture is known, and each of its commands is on its page."""
    known = {*PICTURES, *of_studies(), *BY_HAND}
    kept = {path.name for path in (ROOT / "renders").iterdir()}
    problems += [f"renders/{name}: no command in docs/renders.py" for name in sorted(kept - known)]
    problems += [f"docs/renders.py: no renders/{name}" for name in sorted(known - kept)]
    for name, picture in PICTURES.items():
        page = on_one_line((ROOT / picture.page).read_text())
        problems += [f"{picture.page}: no command `{on_one_line(command)}` of renders/{name}"
                     for command in picture.commands if on_one_line(command) not in page]


def draw(name, build, done):
    """Runs the commands that were not run yet, and keeps the picture."""
    study = of_studies().get(name)
    if study:
        if study not in done:
            tables.run_study(study, build, None)
        done.add(study)
        made = {target: tables.OUT / study / source for source, target in tables.STUDIES[study].pictures.items()}[name]
        return shutil.copyfile(made, ROOT / "renders" / name)
    picture = PICTURES[name]
    paths = {"PATH": f"{build / 'src'}{os.pathsep}{os.environ['PATH']}", "PYTHONPATH": str(build / "python")}
    for command in picture.commands:
        if command in done:
            continue
        print("+", command, flush=True)
        command = re.sub(r"^((?:\S+=\S+ )*)(python3|(?=tests/))", rf"\1{shlex.quote(tables.python_of(build))} ", command)
        status = subprocess.run(command, shell=True, cwd=ROOT, env={**os.environ, **paths}).returncode
        # 1: a criterion failed, as a picture of a failure shows.
        if status not in (0, 1):
            sys.exit(f"renders: {name}: exit status {status}")
    done.update(picture.commands)
    if picture.made:
        shutil.copyfile(ROOT / picture.made, ROOT / "renders" / name)
    return None


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help="pictures, such as climb_jug.png; default: all")
    parser.add_argument("--list", action="store_true", help="list the pictures with their CPU times")
    parser.add_argument("--build", type=Path, default=ROOT / "build" / "release", help="build folder")
    options = parser.parse_args()
    known = {**{name: picture.time for name, picture in PICTURES.items()},
             **{name: f"{tables.STUDIES[study].time}, ./dev docs {study}" for name, study in of_studies().items()}}
    if options.list:
        print("\n".join(f"{name}: {time}" for name, time in sorted(known.items())))
        print("\n".join(f"{name}: by hand, {why}" for name, why in sorted(BY_HAND.items())))
        return 0
    if unknown := [name for name in options.names if name not in known]:
        parser.error(f"got {', '.join(unknown)}, need some of {', '.join(sorted(known))}")
    done = set()
    for name in options.names or known:
        draw(name, options.build.resolve(), done)
    return 0


if __name__ == "__main__":
    sys.exit(main())
