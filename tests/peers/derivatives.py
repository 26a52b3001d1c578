#!/usr/bin/env python3
"""Derivatives of steps beside differences, Pinocchio (PyPI: pin) and MuJoCo's mjd_transitionFD (PyPI: mujoco), in one run.

    pip install --target DIR pin mujoco
    PYTHONPATH=build/release/python python3 tests/peers/derivatives.py --peers DIR [--out FILE.json]
    PYTHONPATH=build/release/python python3 tests/peers/derivatives.py --hard

Peers run in a process of their own, which may have another NumPy, one after the other with handsim. Times are processor time,
the least of repeated batches, of one thread, of calls from Python. With --hard: what derivatives of hard cases say, and the
order of the error of a run's derivatives in its step.
"""
import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

STATES = 20  # that are compared with Pinocchio
HARD = [("stability/crank_outer_dead_centre.yaml", 0), ("stability/crossed_fingers.yaml", 0), ("stability/crossed_fingers.yaml", 0.1),
        ("stability/limp_hands.yaml", 0.5), ("stability/stop_impact.yaml", 0), ("stability/hand_leaves_stops.yaml", 0),
        ("stability/pinch_pads.yaml", 0.5), ("stability/stack.yaml", 0.5)]


def hand():
    import handsim as hs

    return {"hands": [{"model": str(hs.data_path() / "handmodels" / "anatomical.yaml"),
                       "person": str(hs.data_path() / "config" / "persons" / "median_man.yaml"), "side": "right",
                       "wrist": {"mount": "fixed", "position": [0, 0, 0]}}],
            "effects": ["gravity"], "solver": {"engine": "articulated", "step": 1e-3}, "duration": 1}


def least(call, count=50, batches=15, before=lambda: None):
    """Time of a call [s]."""
    out = np.inf
    for _ in range(batches):
        before()
        start = time.thread_time()
        for _ in range(count):
            call()
        out = min(out, (time.thread_time() - start) / count)
    return out


def ridders(f, h, rows=9):
    """A derivative by central differences at halved steps, extrapolated, and its error as the table tells it."""
    last, best, error = [], None, np.inf
    for i in range(rows):
        now = [(f(h) - f(-h)) / (2 * h)]
        for j in range(1, min(i, 3) + 1):
            now.append((4**j * now[-1] - last[j - 1]) / (4**j - 1))
            e = max(np.abs(now[j] - now[j - 1]).max(), np.abs(now[j] - last[j - 1]).max())
            if e < error:
                best, error = now[j], e
        last, h = now, h / 2
    return best, error


def times(scene, until):
    """Of a step, of one solved to rounding, and of one with all Jacobians [s]."""
    import handsim as hs

    sim = hs.Simulation(scene, {"solver": "{engine: articulated}"}, contact_forces=False)
    sim.step(substeps=round(until / sim.scene.step))
    start = sim.motion()
    core = sim._core
    back = lambda: sim.reset(start)
    step = lambda: core.step(None, None, None, None, None, 1)
    with_all = lambda only: core.step_with_derivatives(None, None, None, None, None, [], only)
    out = {"scene": scene, "coordinates": len(sim.derivatives().state) // 2, "contacts": len(sim.contacts.depth),
           "step": least(step, before=back), "exact": least(lambda: with_all(True), before=back),
           "derivatives": least(lambda: with_all(False), before=back)}
    return out | {"steps": out["derivatives"] / out["step"]}


def in_peer(name, folder, **given):
    """Runs a peer's function of this file on arrays."""
    with tempfile.TemporaryDirectory() as temporary:
        files = [str(Path(temporary) / file) for file in ("in.npz", "out.npz")]
        np.savez(files[0], **given)
        subprocess.run([sys.executable, __file__, "--run", name, *files], check=True,
                       env=os.environ | {"PYTHONPATH": os.pathsep.join(
                           [folder, f"{folder}/cmeel.prefix/lib/python{sys.version_info[0]}.{sys.version_info[1]}/site-packages"])})
        with np.load(files[1]) as found:
            return dict(found)


def pinocchio(given):
    """Derivatives of forward dynamics at each state, in the order of the coordinates, and the time of one."""
    import pinocchio as pin

    model = pin.buildModelFromXML(str(given["urdf"]))
    model.gravity.linear = np.array([0, 0, -9.80665])
    # Universal joints: URDF has to have some mass between their axes.
    for i, inertia in enumerate(model.inertias):
        if inertia.mass < 1e-6:
            model.inertias[i] = pin.Inertia.Zero()
    data = model.createData()
    order = [model.joints[model.getJointId(next(name for name in model.names if name.endswith(str(c))))].idx_v
             for c in given["coordinates"]]
    n, out = len(order), []
    for q, u in zip(given["q"], given["u"]):
        p = [np.zeros(n) for _ in range(3)]
        p[0][order], p[1][order] = q, u
        # Joints without limits have cosine and sine.
        p[0] = pin.integrate(model, pin.neutral(model), p[0])
        pin.computeABADerivatives(model, data, *p)
        m = np.triu(data.Minv) + np.triu(data.Minv, 1).T
        out.append([x[np.ix_(order, order)] for x in (data.ddq_dq, data.ddq_dv, m)])
    return {"found": np.array(out), "time": least(lambda: pin.computeABADerivatives(model, data, *p)),
            "version": pin.__version__}


def against_pinocchio(folder):
    """Largest differences of the derivatives of forward dynamics, relative to the largest entry, and times."""
    import handsim as hs

    scene = hs.load(hand())
    sim = hs.Simulation(scene)
    random, n, h = np.random.default_rng(1), len(scene.coordinates), scene.step
    limits = np.clip(scene.limits, -1, 1)
    q, u = random.uniform(limits[:, 0], limits[:, 1], (STATES, n)), random.normal(size=(STATES, n))
    theirs = in_peer("pinocchio", folder, urdf=scene.to_urdf(), coordinates=scene.coordinates, q=q, u=u)
    worst = 0.0
    for i in range(STATES):
        sim.reset(q=q[i], u=u[i])
        found = sim.derivatives()
        ours = (found.state[n:, :n] / h, (found.state[n:, n:] - np.eye(n)) / h, found.torques[n:] / h)
        worst = max([worst, *(np.abs(a - b).max() / np.abs(b).max() for a, b in zip(ours, theirs["found"][i]))])
    args = (None, None, None, None, None, [], False)
    return {"error": worst, "pinocchio": float(theirs["time"]), "version": str(theirs["version"]), "dynamics": dynamics(),
            "handsim": least(lambda: sim._core.step_with_derivatives(*args), before=lambda: sim.reset(q=q[-1], u=u[-1]))}


def dynamics():
    """Time of what Pinocchio's function does [s], by the benchmarks of the build; None without them."""
    bench = Path(__file__).parents[2] / "build" / "release" / "tests" / "bench_handsim"
    if not bench.exists():
        return None
    text = subprocess.run([bench, "--benchmark_filter=derivatives_of_dynamics", "--benchmark_repetitions=5", "--benchmark_format=json"],
                          check=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True).stdout
    return 1e-9 * min(row["cpu_time"] for row in json.loads(text)["benchmarks"] if row["run_type"] == "iteration")


def error(found, step, start):
    """Against differences of the program's own step."""
    oracle = np.array([ridders(lambda by: step(start + by * e), 2e-3)[0] for e in np.eye(len(start))]).T
    return float(np.abs(found - oracle).max() / np.abs(oracle).max())


def mujoco(given):
    """Error and time of mjd_transitionFD, forward and centred."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(str(given["mjcf"]))
    data, start, n = mujoco.MjData(model), given["start"], model.nv
    names = [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_JOINT, i) for i in range(n)]
    order = [next(i for i, name in enumerate(names) if name.endswith(str(c))) for c in given["coordinates"]]
    x = np.zeros(2 * n)
    x[order], x[[n + i for i in order]] = start[:n], start[n:]

    def step(at):
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:] = at[:n], at[n:]
        mujoco.mj_step(model, data)
        return np.concatenate([data.qpos, data.qvel])

    A, out = np.zeros((2 * n, 2 * n)), {"version": mujoco.__version__}
    for name, centred in (("forward", False), ("centred", True)):
        def transition():
            mujoco.mjd_transitionFD(model, data, 1e-6, centred, A, None, None, None)
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:] = x[:n], x[n:]
        transition()
        out[name] = [error(A.copy(), step, x), 0]
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:] = x[:n], x[n:]
        out[name][1] = least(transition, 20)
    return out


def against_mujoco(folder):
    """The same hand with springs of tissue: error against differences of its own step, and time, of each program."""
    import handsim as hs

    scene = hs.load(hand() | {"effects": ["gravity", "passive_tissue"]})
    sim = hs.Simulation(scene)
    random, n = np.random.default_rng(2), len(scene.coordinates)
    limits = np.clip(scene.limits, -0.5, 1)
    start = np.concatenate([random.uniform(limits[:, 0], limits[:, 1]), 0.5 * random.normal(size=n)])
    theirs = in_peer("mujoco", folder, mjcf=scene.to_mjcf(), start=start, coordinates=scene.coordinates)
    back = lambda: sim.reset(q=start[:n], u=start[n:])

    def step(x):
        sim.reset(q=x[:n], u=x[n:])
        sim._core.step_with_derivatives(None, None, None, None, None, [], True)
        return np.concatenate([sim.q, sim.u])

    back()
    ours = error(sim.derivatives().state, step, start)
    args = (None, None, None, None, None, [], False)
    return {"version": str(theirs["version"]), "forward": theirs["forward"].tolist(), "centred": theirs["centred"].tolist(),
            "handsim": [ours, least(lambda: sim._core.step_with_derivatives(*args), before=back)]}


def side(sim, change):
    """The next state, against the start's, from a start that is changed by (q, u)."""
    from handsim._derivatives import _end, _free, exact_step

    start, free = sim.motion(), _free(sim)
    before = _end(sim, free)
    sim._core.reset_beside(sim._core, change)
    exact_step(sim, {})
    out = _end(sim, free).against(before)
    sim.reset(start)
    return out


def hard(name, until, changes=None):
    """What the derivatives of a step say, and how far columns are from differences that know 3e-8 or better."""
    import handsim as hs

    sim = hs.Simulation(hs.data_path() / "config" / name, changes)
    sim.step(substeps=max(1, round(until / sim.scene.step)))
    start = sim.motion()
    try:
        found = sim.derivatives()
    except hs.Error as error:
        return {"case": name, "time": sim.time, "says": [str(error)]}
    sim.step()
    contacts, n, errors = len(sim.contacts.depth), len(found.names) // 2, []
    sim.reset(start)
    for j in range(2 * n):
        try:
            oracle, known = ridders(lambda by: side(sim, by * (np.arange(2 * n) == j)), 2e-5 if j < n else 2e-4)
        except hs.Error:
            sim.reset(start)
            known = np.inf
        size = [max(1e-3, np.abs(oracle[half]).max()) if known < np.inf else 1 for half in (slice(n), slice(n, 2 * n))]
        if known < 3e-8 * min(size):
            wrong = np.abs(found.state[:, j] - oracle)
            noted = any(note.split(":")[0] in found.names[j] for note in found.notes)
            errors.append((noted, max(wrong[:n].max() / size[0], wrong[n:].max() / size[1])))
    return {"case": name, "time": sim.time, "contacts": contacts, "columns": 2 * n, "noted": sum(noted for noted, _ in errors),
            "known": sum(not noted for noted, _ in errors), "error": max((e for noted, e in errors if not noted), default=np.nan),
            "wrong": sum(e > 1e-7 and not noted for noted, e in errors), "says": found.notes}


def order(name, until, time):
    """Largest changes of the derivative of a run's end by its start as the step is halved."""
    import handsim as hs

    first = hs.Simulation(name, {"solver": "{engine: articulated}"})
    first.step(substeps=round(until / first.scene.step))
    found = []
    for h in (2e-3, 1e-3, 5e-4, 2.5e-4):
        sim = hs.Simulation(name, {"solver": f"{{engine: articulated, step: {h}}}"})
        sim._core.reset_beside(first._core, None)
        by_start = None
        for _ in range(round(time / h)):
            state = sim.derivatives(advance=True).state
            by_start = state if by_start is None else state @ by_start
        found.append(by_start)
    return [float(np.abs(a - b).max() / np.abs(b).max()) for a, b in zip(found, found[1:])]


def smoothed(name, until):
    """Of smoothed derivatives by state: largest difference from the exact ones, relative to the largest number of rates by
    positions, at two deviations; spread over seeds of the deviation 10 um; and time [s] of one."""
    import handsim as hs

    sim = hs.Simulation(name, {"solver": "{engine: articulated}"})
    sim.step(substeps=round(until / sim.scene.step))
    exact = sim.derivatives().state
    n = len(exact) // 2
    apart = lambda a, b: float(np.abs(a[n:, :n] - b[n:, :n]).max() / np.abs(b[n:, :n]).max())
    errors = [apart(sim.derivatives(smoothing=d).state, exact) for d in (1e-6, 5e-7)]
    many = np.array([sim.derivatives(smoothing=hs.Smoothing(1e-5, seed=seed)).state for seed in range(20)])
    spread = many[:, n:, :n].std(axis=0).max() / np.abs(many.mean(axis=0)[n:, :n]).max()
    return errors, spread, least(lambda: sim.derivatives(smoothing=1e-5), 1, 5)


def print_hard():
    for row in (hard(name, until, {"solver": "{engine: articulated}"}) for name, until in HARD):
        print(f"{row['case']}, {row['time']:.3f} s:", end=" ")
        if "contacts" in row:
            print("{contacts} contacts; of {columns} columns a note names {noted}, {known} others are known with errors up to "
                  "{error:.2g}, {wrong} above 1e-7".format(**row), end="")
        print("".join(f"\n    {note}" for note in row["says"]))
    for name, until in (("grasp_pinch", 2.5), ("grasp_cup", 2.5)):
        errors, spread, taken = smoothed(name, until)
        print(f"{name}, smoothed: error {errors[0]:.2g} with 1 um, ratio {errors[0] / errors[1]:.2f} to that with half of it; "
              f"spread {100 * spread:.1f} % with 10 um and 64 pairs, {taken:.3f} s")
    for name, until, time in (("prototype_poses", 0.35, 0.1), ("every_pose", 0.35, 0.1), ("grasp_pinch", 2.5, 0.02)):
        changes = order(name, until, time)
        print(f"{name}, {time} s: from one step to half of it", *(f"{c:.3g}" for c in changes),
              "ratios", *(f"{a / b:.2f}" for a, b in zip(changes, changes[1:])))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--peers", help="folder with pin and mujoco")
    parser.add_argument("--out", help="JSON with all figures")
    parser.add_argument("--run", nargs=3, help=argparse.SUPPRESS)
    parser.add_argument("--hard", action="store_true", help="hard cases alone")
    options = parser.parse_args()
    if options.hard:
        return print_hard()
    if options.run:
        name, given, found = options.run
        with np.load(given) as arrays:
            np.savez(found, **{"pinocchio": pinocchio, "mujoco": mujoco}[name](dict(arrays)))
        return
    out = {"times": [times("prototype_poses", 0.35), times("every_pose", 0.35), times("grasp_pinch", 2.5), times("grasp_cup", 2.5)]}
    for row in out["times"]:
        print("{scene}: {coordinates} coordinates, {contacts} contacts: step {0:.1f} us, to rounding {1:.1f} us, with all "
              "Jacobians {2:.1f} us: {steps:.1f} steps".format(*(1e6 * row[k] for k in ("step", "exact", "derivatives")), **row))
    if options.peers:
        out |= {"pinocchio": against_pinocchio(options.peers), "mujoco": against_mujoco(options.peers)}
        print("Pinocchio {version}: differ by {error:.2g}; {0:.1f} us, handsim's whole step {1:.1f} us".format(
            1e6 * out["pinocchio"]["pinocchio"], 1e6 * out["pinocchio"]["handsim"], **out["pinocchio"]))
        if out["pinocchio"]["dynamics"]:
            print("handsim's derivatives of dynamics alone {0:.1f} us, {1:.2f} of Pinocchio's time".format(
                1e6 * out["pinocchio"]["dynamics"], out["pinocchio"]["dynamics"] / out["pinocchio"]["pinocchio"]))
        for name in ("forward", "centred", "handsim"):
            e, t = out["mujoco"][name]
            print(f"MuJoCo {out['mujoco']['version']} {name}: error {e:.2g}, {1e6 * t:.1f} us")
    if options.out:
        Path(options.out).write_text(json.dumps(out, indent=1, default=float))


if __name__ == "__main__":
    main()
