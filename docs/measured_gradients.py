"""Tables of docs/gradients.md, docs/optimise.md and docs/motion.md, as those of measured.py."""
import json
import re

from measured import OUT, ROOT, Missing, number, study_text, table

SCENES = {"prototype_poses": "a hand, `prototype_poses.yaml`", "every_pose": "two hands, `every_pose.yaml`", "grasp_pinch": "held card, `grasp_pinch.yaml`",
          "grasp_cup": "held cup, `grasp_cup.yaml`"}
STEPS = {"OfAHandThatMoves": "every_pose", "OfAHeldCard": "grasp_pinch", "OfAHeldMug": "grasp_cup", "OfMuscles": "hand with 41 muscles, `muscle_poses.yaml`"}


def figures(study, file):
    path = OUT / study / file
    if not path.exists():
        raise Missing(path.relative_to(ROOT))
    return json.loads(path.read_text())


def micro(seconds):
    return f"{number(1e6 * seconds)} µs"


def gradients_errors():
    text, rows = study_text("gradients", "errors"), []
    for test, name in STEPS.items():
        found = re.search(rf"RUN +\] SceneDerivatives\.{test}AreThose.*?(\d+) contacts, largest error (\S+) of (\d+) of (\d+) columns", text, re.S)
        if not found:
            raise Missing(f"line of {test}")
        rows.append([SCENES.get(name, name), found[1], number(float(found[2])), f"{found[3]} of {found[4]}"])
    return table(["step", "contacts", "largest error", "columns"], rows)


def gradients_times():
    return table(["step", "coordinates", "contacts", "step", "solved to rounding", "with all Jacobians", "in steps"],
                 [[SCENES[row["scene"]], row["coordinates"], row["contacts"], *(micro(row[key]) for key in ("step", "exact", "derivatives")), number(row["steps"])]
                  for row in figures("gradients", "derivatives.json")["times"]])


def gradients_peers():
    found = figures("gradients", "derivatives.json")
    if "mujoco" not in found:
        raise Missing("out/pin with pin and mujoco")
    mujoco, pinocchio = found["mujoco"], found["pinocchio"]
    rows = [["handsim: a whole step with all Jacobians", number(mujoco["handsim"][0]), micro(mujoco["handsim"][1])]]
    rows += [[f"MuJoCo {mujoco['version']}, `mjd_transitionFD`, {way}", number(mujoco[way][0]), micro(mujoco[way][1])] for way in ("forward", "centred")]
    if pinocchio["dynamics"]:
        rows.append(["handsim: derivatives of forward dynamics alone", "", micro(pinocchio["dynamics"])])
    rows += [[f"Pinocchio {pinocchio['version']}, `computeABADerivatives` alone", f"differs from handsim's by {number(pinocchio['error'])}", micro(pinocchio["pinocchio"])]]
    return table(["a hand of 20 coordinates", "error", "time"], rows)


def reach():
    found = figures("reach", "reach.json")
    ours = found["handsim"]
    rows = [[f"handsim, steps of {each['step']}, torques held for {each['hold']}", number(each["cost"], 4), f"{each['seconds']:.2f} s", *[""] * len(ours)] for each in ours]
    for each in found["moco"]:
        beside = [f"{100 * (one['cost'] / each['cost'] - 1):+.2f} %, 1/{each['seconds'] / one['seconds']:.0f}" for one in ours]
        rows.append([f"Moco, {each['intervals']} intervals" + ("" if each["converged"] else ", not converged"), number(each["cost"], 4), f"{each['seconds']:.1f} s", *beside])
    return table(["reach", "cost", "CPU time, one thread", *(f"handsim's cost and time beside it, {each['step']}" for each in ours)], rows)


def inverse_kinematics():
    found = figures("ik", "ik.json")
    rows = {}
    for each in found["rows"]:
        name = f"{each['program']}, {each['version']}" if "version" in each else each["program"]
        rows.setdefault(name, [name]).extend([f"{number(each['fingers_deg'])}°", f"{number(each['all_deg'])}°", f"{number(each['points_mm'])} mm", f"{number(each['frame_ms'])} ms"])
    return table(["program", *(f"{what}, {noise}" for noise in ("exact", "2 mm") for what in ("fingers' flexion", "all axes", "points", "a frame"))], list(rows.values()))


def inverse_kinematics_public():
    found = figures("ik", "ik.json").get("public")
    if not found:
        raise Missing("public points, with HANDSIM_RECORDINGS")
    return table(["program", "points", "PIP", "DIP", "thumb MCP, IP", "a frame"],
                 [[f"{each['program']}, {each['version']}" if "version" in each else each["program"], f"{number(each['points_mm'])} mm",
                   *(f"{number(each[f'{kind}_deg'])}°" for kind in ("pip", "dip", "thumb")), f"{number(each['frame_ms'])} ms"] for each in found])


TABLES = {"gradients-errors": ("gradients", gradients_errors), "gradients-times": ("gradients", gradients_times), "gradients-peers": ("gradients", gradients_peers),
          "reach": ("reach", reach), "inverse-kinematics": ("ik", inverse_kinematics), "inverse-kinematics-public": ("ik", inverse_kinematics_public)}
