"""A finger's reach by torques: cost and time of handsim beside OpenSim Moco on the exported model, each with its own grid.

    PYTHONPATH=build/release/python python3 tests/peers/optimise.py [--intervals N...] [--out FILE.json]

Moco: direct collocation (Hermite-Simpson) by CasADi and IPOPT, from the motion that was found here; the joints without torques are welded. The rates at
the end are zero there, and cost 0.1 times their squares here. IPOPT has to remember as many gradients as the problem has free directions (6 is its default),
and variables scaled by their bounds; without either it ends nowhere near. Costs are those of the goal: integral of squared torques [N2 m2 s] and
1000 times the squared distance [m2]. handsim's steps are of first order: its cost comes nearer with smaller ones. Times are CPU times of one thread.
"""
import argparse
import json
import os
import sys
import tempfile
import time
from pathlib import Path

import handsim as hs
import numpy as np
from handsim import optimise
from handsim._optimise_command import Goal

sys.path.append(str(Path(__file__).parents[2] / "build" / "peers" / "packages"))  # of ./dev peers; behind the NumPy that handsim was built for
import opensim

SCALE = 1e5  # of the costs in Moco: its tolerance is absolute
UNIT = 0.01  # torque of a control of 1 [N m]
GRIDS = (("1 ms", "5 ms"), ("0.25 ms", "2.5 ms"))  # steps and holds of handsim


def ours(step, hold):
    """Scene, goal, optimum and CPU seconds, the least of three."""
    scene = hs.load("reach", {"solver.step": step})
    text = (hs.data_path() / "config" / "goals" / "reach.yaml").read_text()
    path = Path(tempfile.mkdtemp()) / "goal.yaml"
    path.write_text(text.replace('hold: "5 ms"', f'hold: "{hold}"'))
    goal, seconds = Goal(path, scene), []
    for _ in range(3):
        begin = time.process_time()
        found = optimise.solve(goal.problem(hs.Simulation(scene)))
        seconds.append(time.process_time() - begin)
        assert found.converged
    return scene, goal, found, min(seconds)


def moco(scene, goal, intervals, found):
    """Cost, CPU seconds, success and iterations of the solver, which starts from the motion that was found here."""
    folder = Path(tempfile.mkdtemp())
    (folder / "hand.osim").write_text(scene.to_osim())
    driven = [scene.coordinates[column] for column in goal.columns]
    tip = goal.file.get("costs.0")
    processor = opensim.ModelProcessor(str(folder / "hand.osim"))
    model = processor.process()
    model.initSystem()
    welded = opensim.StdVectorString()
    for i in range(model.getJointSet().getSize()):
        joint = model.getJointSet().get(i)
        names = [joint.get_coordinates(k).getName() for k in range(joint.numCoordinates())]
        if names and not set(names) & set(driven):
            welded.append(joint.getName())
    # Forces of coordinates that are no more.
    forces = model.updForceSet()
    for i in reversed(range(forces.getSize())):
        if forces.get(i).getName().removesuffix(".tissue") not in driven:
            forces.remove(i)
    processor = opensim.ModelProcessor(model)
    processor.append(opensim.ModOpReplaceJointsWithWelds(welded))
    model = processor.process()
    for name in driven:
        actuator = opensim.CoordinateActuator(name)
        actuator.setName(name + ".torque")
        actuator.setOptimalForce(UNIT)
        actuator.setMinControl(-5)
        actuator.setMaxControl(5)
        model.addForce(actuator)
    model.initSystem()
    os.chdir(folder)  # CasADi's solver leaves a file while it runs, and IPOPT reads its options here
    Path("ipopt.opt").write_text("limited_memory_max_history 150\n")
    study = opensim.MocoStudy()
    problem = study.updProblem()
    problem.setModel(model)
    problem.setTimeBounds(0, goal.knots * goal.period)
    for name in driven:
        path = model.getCoordinateSet().get(name).getAbsolutePathString()
        problem.setStateInfo(path + "/value", [-2, 2], 0)
        problem.setStateInfo(path + "/speed", [-50, 50], 0, 0)
    effort = opensim.MocoControlGoal("effort", SCALE * UNIT**2)
    problem.addGoal(effort)
    reach = opensim.MocoMarkerFinalGoal("tip", SCALE * tip["weight"])
    body = scene._model.bodies[dict((t, b) for h in scene._model.hands for t, b, _ in h.tips)[tip["point"]]].name
    reach.setPointName("/markerset/" + body + ".tip")
    reach.setReferenceLocation(opensim.Vec3(*tip["is"]))
    problem.addGoal(reach)
    solver = study.initCasADiSolver()
    solver.set_num_mesh_intervals(intervals)
    solver.set_verbosity(2)
    solver.set_optim_convergence_tolerance(1e-3)
    solver.set_optim_constraint_tolerance(1e-4)
    solver.set_optim_finite_difference_scheme("forward")
    solver.set_scale_variables_using_bounds(True)
    solver.set_parallel(0)
    solver.set_optim_max_iterations(1000)
    solver.set_multibody_dynamics_mode("implicit")
    solver.set_implicit_multibody_acceleration_bounds(opensim.MocoBounds(-1e4, 1e4))
    guess = solver.createGuess("bounds")
    times = np.array([guess.getTime().get(i) for i in range(guess.getNumTimes())])
    ours = goal.period * np.arange(goal.knots + 1)
    for name, column in zip(driven, goal.columns):
        path = model.getCoordinateSet().get(name).getAbsolutePathString()
        rates = [end.rates[column] for end in found.trajectory.ends]
        for kind, values in (("value", [end.joints[column] for end in found.trajectory.ends]), ("speed", rates)):
            guess.setState(f"{path}/{kind}", opensim.Vector.createFromMat(np.interp(times, ours, values)))
        controls = np.interp(times, ours[1:], found.trajectory.actions[:, goal.columns.index(column)]) / UNIT
        guess.setControl(f"/forceset/{name}.torque", opensim.Vector.createFromMat(controls))
        guess.setDerivative(f"{path}/accel", opensim.Vector.createFromMat(np.interp(times, ours, np.gradient(rates, ours))))
    solver.setGuess(guess)
    begin = time.process_time()
    solution = study.solve()
    seconds = time.process_time() - begin
    solution.unseal()
    return solution.getObjective() / SCALE, seconds, solution.success(), solution.getNumIterations()


def main():
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--intervals", nargs="+", type=int, default=(12, 25, 40), help="of Moco's meshes")
    options.add_argument("--out", type=lambda path: Path(path).resolve(), help="JSON with all figures")
    given = options.parse_args()
    runs, figures = [ours(*grid) for grid in GRIDS], {"handsim": [], "moco": []}
    for (step, hold), (_, _, found, seconds) in zip(GRIDS, runs):
        figures["handsim"].append({"step": step, "hold": hold, "cost": found.trajectory.cost, "seconds": seconds})
        print(f"handsim, steps of {step}, torques held for {hold}: cost {found.trajectory.cost:.5g}, {seconds:.2f} s, {found.iterations} iterations", flush=True)
    for intervals in given.intervals:
        cost, took, done, iterations = moco(*runs[0][:2], intervals, runs[0][2])
        figures["moco"].append({"intervals": intervals, "cost": cost, "seconds": took, "converged": done, "iterations": iterations})
        print(f"Moco, {intervals} intervals: cost {cost:.5g}, {took:.1f} s, {iterations} iterations{'' if done else ', not converged'}; handsim's costs are "
              + " and ".join(f"{100 * (found.trajectory.cost / cost - 1):+.2f} % (time 1/{took / seconds:.0f})" for _, _, found, seconds in runs), flush=True)
    if given.out:
        given.out.write_text(json.dumps(figures, indent=1))
    os._exit(0)  # OpenSim's libraries crash at the end of the interpreter


if __name__ == "__main__":
    main()
