"""Joint angles from 21 keypoints: `handsim track` beside mink, dex-retargeting and OpenSim on the exported hand, for the same points.

    pip install --target out/ik mink daqp dex_retargeting nlopt pin torch opensim    # whatever of it is missing is said and left out
    python3 tests/peers/inverse_kinematics.py build/release/src/handsim --packages out/ik [--out FILE.json] [--frames N]

The points are those of the right hand of config/bench.yaml, exact and with 2 mm of normal noise in every coordinate. All know the hand: handsim has
its person, the others the model that `handsim export` writes of it (MJCF, URDF, OpenSim), its palm free, and the places of the points in it. Each frame
starts from the angles of the frame before, the first one from half bent fingers. Of each program:

- model: largest distance of its points at the true angles from the exact ones, after the rigid motion that fits best [mm]: what the exports differ by
- fingers, all: RMS difference of the flexion axes of the fingers, of all axes, from the true angles [deg]
- points: RMS distance of the fitted points from the given ones [mm]
- time: CPU time of a frame [ms], of this process or of the fits of handsim

mink: FrameTask of each point by position, solved by daqp within the stops (ConfigurationLimit), until no coordinate moves by 1e-6 or 20 times. dex-retargeting:
its PositionOptimizer as it is (Huber loss from 20 mm, weight of the step 4e-3, ends at 1e-5), and without that weight and to 1e-12. OpenSim:
InverseKinematicsSolver as its tool sets it (accuracy 1e-5), and to 1e-9, all markers of weight 1; coordinates of the export have no clamps.

With HANDSIM_RECORDINGS, the folder of tests/study/track/captured.py, the same for public points: of the first sequence of each person there (by name) the first 5 s
in which the right hand is seen, without the three frames after it comes in. The hand, and where the points lie on it, are those that `track --points mano` fits to these
frames; all programs get them. No angles are known there, so the figures are, over all frames of all sequences:

- points, time: as above
- pip, dip, thumb: RMS difference of the fingers' PIP and DIP and the thumb's MCP and IP from the angles between the points' own bones [deg], in frames whose
  bones do not bend backwards. Bones of MANO are not those of a hand (docs/motion.md): no hand that keeps the points has these angles
"""
from __future__ import annotations

import argparse
import csv
import json
import os
import re
import site
import subprocess
import sys
import tempfile
from pathlib import Path

if "--packages" in sys.argv[:-1]:  # before NumPy, of the version that they need
    sys.path.insert(0, sys.argv[sys.argv.index("--packages") + 1])
    site.addsitedir(sys.path[0])
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests/study/track"))
import captured
from inverse_kinematics_programs import AXES, FINGERS, NAMES, START, Points, peers

MODEL = ROOT / "handmodels/moving_thenar.yaml"
"""Of the hands in public recordings: that of `track`."""
POINTS = ROOT / "handmodels/points/mano.yaml"
"""Their convention."""
LONGEST = 5.0
"""Of a public recording [s]."""


def run(*words):
    done = subprocess.run([str(word) for word in words], capture_output=True, text=True)
    if done.returncode not in (0, 1):
        sys.exit(f"{' '.join(map(str, words))}: {done.stderr}")
    return done


def ours(program, folder, recording, options):
    """A row of handsim's own."""
    summary = json.loads(run(program, "track", recording, "--truth", folder / "true/trajectory.mot", "--out", folder / "tracked", "--json", *options).stdout)
    hand = summary["hands"][0]
    rows = list(csv.DictReader((folder / "tracked/summary.csv").open()))
    assert hand["missing"] + hand["swapped"] + hand["poor"] == 0
    return {"fingers_deg": hand["finger_flexion_difference_rms_deg"], "all_deg": hand["difference_rms_deg"], "points_mm": float(rows[0]["rms[mm]"]),
            "frame_ms": 1e3 * summary["cpu_s"] / summary["frames"]}


def export(program, folder, model, person):
    (folder / "hand.yaml").write_text(f"title: the hand\nhands:\n  - {{model: {model}, person: {person}, side: right,\n"
                                      "     wrist: {mount: free, position: [0, 0, 0.3]}}\neffects: [joint_stops]\nduration: 1\n")
    for kind in ("xml", "urdf", "osim"):
        run(program, "export", folder / "hand.yaml", "--out", folder / f"hand.{kind}")


def rms(values):
    return float(np.sqrt(np.nanmean(np.square(values))))


def own_differences(angles, given):
    """Of the flexion [deg] by joint from the points' own bones."""
    own = captured.own_angles(given, True)
    return {joint: np.degrees(angles[f"{joint}.flexion"]) - each for joint, each in own.items()}


def placed(program, folder, shares):
    """The points of a fitted hand at one posture, by an export's bodies. :param shares: by point, as `track` has fitted them"""
    import mujoco

    model = mujoco.MjModel.from_xml_path(str(folder / "hand.xml"))
    data = mujoco.MjData(model)
    for axis, angle in START.items():
        data.qpos[model.jnt_qposadr[mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, f"right.{axis}")]] = angle
    mujoco.mj_forward(model, data)
    person = json.loads((folder / "fitted/summary.json").read_text())["person"]
    thickness = re.search(r"hand thickness +([\d.]+) mm", run(program, "hand", "--person", folder / "fitted/person.yaml", "--model", MODEL, "--side", "right").stdout)
    of_palm = 1e-3 * np.array([person["hand_breadth_mm"], person["hand_length_mm"], float(thickness[1])])
    segments = dict(re.findall(r"name: (\w+), segment: (\w+)", POINTS.read_text()))
    exact = []
    for name in NAMES:
        body, at = data.body(f"right.{segments[name]}"), np.array(shares[name])
        if segments[name] == "palm":
            origin, size = np.array([0, 0, 0.3]) - model.body("right.palm").pos, of_palm
        else:
            radius = model.geom(f"right.{segments[name]}").size[0]
            origin, size = model.jnt_pos[model.body(f"right.{segments[name]}").jntadr[0]], np.array([radius, 1e-3 * person["bones_mm"][segments[name]], radius])
        exact.append(body.xpos + body.xmat.reshape(3, 3) @ (origin + size * at))
    joints = {NAMES.index(name): data.joint(f"right.{name}.flexion").xanchor.copy() for name in ("thumb_cmc", *(f"{finger}_mcp" for finger in FINGERS))}
    return Points(np.array([exact]), {axis: np.array([angle]) for axis, angle in START.items()}, [segments[name] for name in NAMES], joints)


def tracked(program, folder, words):
    """What handsim makes of folder/points.json: angles by axis, squared distances of the points [m^2], CPU time of a frame [s]."""
    summary = json.loads(run(program, "track", folder / "points.json", "--model", MODEL, "--out", folder / "fitted", "--json", *words).stdout)
    names, rows = captured.table(folder / "fitted/right.mot")
    angles = {axis: np.radians([float(row[names.index(f"right.{axis}")]) for row in rows]) for axis in AXES}
    names, rows = captured.table(folder / "fitted/frames.csv")
    assert len(rows) == len(angles[AXES[0]]), f"{folder}: frames that are not tracked"
    begin = names.index("right.rms[mm]") + 1
    return angles, 1e-6 * np.array([[float(each or "nan") for each in row[begin:begin + 21]] for row in rows])**2, summary["cpu_s"] / summary["frames"]


def public(program, folder, missing):
    """Rows of public points; none without their folder."""
    if "HANDSIM_RECORDINGS" not in os.environ:
        missing.append("public points: HANDSIM_RECORDINGS names no folder of captured sequences")
        return []
    first = {}
    for source in sorted(Path(os.environ["HANDSIM_RECORDINGS"]).glob("*.npz")):
        first.setdefault(source.stem.partition("_")[0], source)
    collected = {}

    def add(program, angles, squares, given, seconds):
        row = collected.setdefault(program["program"], {**program, "squares": [], "own": {}, "seconds": []})
        row["squares"].append(squares.ravel())
        row["seconds"].append(np.full(len(given), seconds))
        for joint, each in own_differences(angles, given).items():
            row["own"].setdefault(joint, []).append(each)

    for person, source in first.items():
        here = folder / person
        here.mkdir()
        hand = np.load(source)["right"][:, captured.ORDER].astype(float)
        given = hand[np.abs(hand).max(axis=(1, 2)) > 0][3:][:int(LONGEST * captured.RATE)]
        (here / "points.json").write_text(json.dumps({"rate": captured.RATE, "unit": "m", "frames": [{"hands": [{"side": "right", "points": frame.tolist()}]} for frame in given]}))
        unknown = tracked(program, here, ["--points", POINTS])
        shares = json.loads((here / "fitted/summary.json").read_text())["points"]
        (here / "person.yaml").write_text((here / "fitted/person.yaml").read_text())
        export(program, here, MODEL, here / "person.yaml")
        (here / "points.yaml").write_text(re.sub(r"name: (\w+), segment: (\w+), at: .*", lambda found: f"name: {found[1]}, segment: {found[2]}, at: {shares[found[1]]}}}", POINTS.read_text()))
        known = ["--person", here / "person.yaml", "--keep-person", "--points", here / "points.yaml"]
        for name, (angles, squares, seconds) in (("each frame for itself", tracked(program, here, [*known, "--no-smoothing"])), ("smooth in time", tracked(program, here, known)),
                                                 ("size of the hand unknown", unknown)):
            add({"program": f"handsim, {name}"}, angles, squares, given, seconds)
        try:
            points = placed(program, here, shares)
        except ImportError as error:
            missing.append(f"other programs on public points: {error}")
            continue
        for name, difference, angles, fitted, seconds in peers(here, points, given, missing):
            assert difference < 0.01, f"{name}: another hand, by {difference} mm"
            add(name, dict(zip(AXES, angles.T)), np.sum((fitted - given)**2, axis=2), given, seconds)
    return [{"program": row["program"], **({"version": row["version"]} if "version" in row else {}), "points_mm": 1e3 * float(np.sqrt(np.nanmean(np.concatenate(row["squares"])))),
             **{f"{kind}_deg": rms(np.concatenate([np.concatenate(each) for joint, each in row["own"].items() if chosen(joint)])) for kind, chosen in
                (("pip", lambda joint: joint.endswith("_pip")), ("dip", lambda joint: joint.endswith("_dip")), ("thumb", lambda joint: joint.startswith("thumb")))},
             "frames": int(sum(map(len, row["seconds"]))), "frame_ms": 1e3 * float(np.mean(np.concatenate(row["seconds"])))} for row in collected.values()]


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("program", type=Path, help="handsim")
    parser.add_argument("--packages", type=Path, help="folder of the other programs")
    parser.add_argument("--out", type=Path)
    parser.add_argument("--frames", type=int, default=626, help="of the recording, from its beginning")
    options = parser.parse_args()
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    folder = Path(tempfile.mkdtemp())
    run(options.program, "run", ROOT / "config/bench.yaml", "--out", folder / "true", "--quiet")
    export(options.program, folder, ROOT / "handmodels/anatomical.yaml", ROOT / "config/persons/median_woman.yaml")
    head, *rows = list(csv.reader((folder / "true/markers.csv").open()))
    columns = [head.index(f"right.{name}.{axis}[m]") for name in NAMES for axis in "xyz"]
    table = np.array(rows, dtype=float)[:options.frames]
    exact = table[:, columns].reshape(len(table), 21, 3)
    lines = (folder / "true/trajectory.mot").read_text().splitlines()
    begin = lines.index("endheader") + 1
    names = lines[begin].split("\t")
    values = np.radians(np.array([line.split("\t") for line in lines[begin + 1:]], dtype=float)[:options.frames])
    truth = {axis: values[:, names.index(f"right.{axis}")] for axis in AXES}
    true = np.column_stack(list(truth.values()))
    fingers = [i for i, axis in enumerate(AXES) if axis.endswith(".flexion") and not axis.startswith("thumb")]
    person = ["--person", ROOT / "config/persons/median_woman.yaml"]
    found, missing = [], []
    for noise in (0.0, 2e-3):
        given = exact + np.random.default_rng(1).normal(0, noise, exact.shape) if noise else exact
        np.savetxt(folder / "points.csv", np.column_stack((table[:, 0], given.reshape(len(given), -1))), "%.17g", ",", comments="",
                   header=",".join(["time[s]", *(head[column] for column in columns)]))
        for name, words in (("handsim, each frame for itself", [*person, "--keep-person", "--no-smoothing"]), ("handsim, smooth in time", [*person, "--keep-person"]),
                            ("handsim, size of the hand unknown", [])):
            found.append({"program": name, "noise_mm": 1e3 * noise, **ours(options.program, folder, folder / "points.csv", words)})
        for name, difference, angles, fitted, seconds in peers(folder, Points(exact, truth), given, missing):
            error = np.degrees(angles - true)
            found.append({**name, "noise_mm": 1e3 * noise, "model_mm": difference, "fingers_deg": rms(error[:, fingers]), "all_deg": rms(error),
                          "points_mm": 1e3 * float(np.sqrt(np.mean(np.sum((fitted - given)**2, axis=2)))), "frame_ms": 1e3 * seconds})
    captured_rows = public(options.program, folder, missing)
    print(f"{'program':36}{'noise':>7}{'model':>10}{'fingers':>10}{'all':>10}{'points':>10}{'time':>9}\n{'':36}{'mm':>7}{'mm':>10}{'deg':>10}{'deg':>10}{'mm':>10}{'ms':>9}")
    for row in found:
        name = f"{row['program']} {row.get('version', '')}"
        model = f"{row['model_mm']:.2g}" if "model_mm" in row else ""
        print(f"{name:36}{row['noise_mm']:7g}{model:>10}{row['fingers_deg']:10.3g}{row['all_deg']:10.3g}{row['points_mm']:10.3g}{row['frame_ms']:9.3g}")
    if captured_rows:
        print(f"\n{'public points':36}{'points':>10}{'pip':>10}{'dip':>10}{'thumb':>10}{'time':>9}\n{'':36}{'mm':>10}{'deg':>10}{'deg':>10}{'deg':>10}{'ms':>9}")
    for row in captured_rows:
        print(f"{row['program'] + ' ' + row.get('version', ''):36}" + "".join(f"{row[key]:10.3g}" for key in ("points_mm", "pip_deg", "dip_deg", "thumb_deg")) + f"{row['frame_ms']:9.3g}")
    for each in sorted(set(missing)):
        print(f"left out: {each}")
    if options.out:
        options.out.write_text(json.dumps({"frames": len(table), "rows": found, "public": captured_rows, "missing": sorted(set(missing))}, indent=1) + "\n")


if __name__ == "__main__":
    main()
