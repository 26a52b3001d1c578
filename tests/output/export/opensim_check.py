"""Opens an exported model in OpenSim and prints, as JSON, what OpenSim makes of it. The test writes FOLDER with
  model.osim, markers.trc
  motion.json: names of coordinates; samples with their values q, rates u and accelerations du; times at which
               poses are asked for; whether inverse kinematics is. In samples also activations, by the names of
               muscles, if muscles are asked about.
Usage: opensim_check.py FOLDER; without FOLDER: exit status 0 if OpenSim can be used."""
import json
import pathlib
import sys

import opensim


def vector(v):
    return [v.get(i) for i in range(v.size())]


def load(folder):
    """The model, and the lines that OpenSim's log has of loading it."""
    log = folder / "opensim.log"
    opensim.Logger.addFileSink(str(log))
    opensim.Logger.setLevelString("info")
    model = opensim.Model(str(folder / "model.osim"))
    state = model.initSystem()
    opensim.Logger.removeFileSink()
    return model, state, log.read_text().splitlines()


def place(coordinates, state, sample):
    for name, q, u in zip(sample["names"], sample["q"], sample["u"]):
        coordinates.get(name).setValue(state, q, False)
        coordinates.get(name).setSpeedValue(state, u)


def poses(model, times):
    """Of every body at every time its position, the columns of its rotation, its velocities. Only prescribed
    coordinates move."""
    out = []
    for time in times:
        state = model.initSystem()
        state.setTime(time)
        model.assemble(state)
        model.realizeVelocity(state)
        bodies = model.getBodySet()
        row = {}
        for i in range(bodies.getSize()):
            body = bodies.get(i)
            place_of = body.getTransformInGround(state)
            rotation = place_of.R().asMat33()
            row[body.getName()] = {
                "p": vector(place_of.p()),
                "R": [[rotation.get(r, c) for c in range(3)] for r in range(3)],
                "w": vector(body.getVelocityInGround(state).get(0)),
                "v": vector(body.getVelocityInGround(state).get(1)),
            }
        out.append(row)
    return out


def muscles(model, state, activations):
    """Of every muscle in this state: length, its rate, moment arms by coordinate, tension."""
    names = {c.getName(): c for c in (model.getCoordinateSet().get(i) for i in range(model.getCoordinateSet().getSize()))}
    controls = opensim.Vector(model.getNumControls(), 0.0)
    for name, value in activations.items():
        model.getMuscles().get(name).setControls(opensim.Vector(1, value), controls)
    model.realizeVelocity(state)
    model.setControls(state, controls)
    model.realizeDynamics(state)
    out = {}
    for name in activations:
        muscle = model.getMuscles().get(name)
        path = opensim.FunctionBasedPath.safeDownCast(muscle.getPropertyByName("path").getValueAsObject())
        crossed = [place.split("/")[-1] for place in path.getCoordinatePaths()]
        out[name] = {
            "length": muscle.getLength(state),
            "rate": muscle.getLengtheningSpeed(state),
            "arms": {c: muscle.computeMomentArm(state, names[c]) for c in crossed},
            "tension": muscle.getActuation(state),
        }
    return out


def inverse_kinematics(folder, model):
    """Angles by coordinate, one row for each frame, by the tool that OpenSim's window has."""
    tool = opensim.InverseKinematicsTool()
    tool.setModel(model)
    tool.setMarkerDataFileName(str(folder / "markers.trc"))
    tool.setStartTime(0)
    tool.setEndTime(1e9)
    tool.setOutputMotionFileName(str(folder / "found.mot"))
    tool.setResultsDir(str(folder))
    tool.set_report_errors(False)
    tool.set_accuracy(1e-12)
    tasks = tool.upd_IKTaskSet()
    markers = model.getMarkerSet()
    for i in range(markers.getSize()):
        task = opensim.IKMarkerTask()
        task.setName(markers.get(i).getName())
        task.setApply(True)
        task.setWeight(1)
        tasks.cloneAndAppend(task)
    tool.run()
    table = opensim.TimeSeriesTable(str(folder / "found.mot"))
    labels = table.getColumnLabels()
    factor = 3.141592653589793 / 180
    rotations = {n: model.getCoordinateSet().get(n).getMotionType() == 1 for n in labels}
    rows = []
    for i in range(table.getNumRows()):
        row = table.getRowAtIndex(i)
        rows.append({n: row[k] * (factor if rotations[n] else 1) for k, n in enumerate(labels)})
    return rows


def main(folder):
    model, state, log = load(folder)
    motion = json.loads((folder / "motion.json").read_text())
    coordinates = model.getCoordinateSet()
    out = {
        "version": opensim.GetVersion(),
        "warnings": [line for line in log if "[info]" not in line],
        "mass": model.getTotalMass(state),
        "ranges": {c.getName(): [c.getRangeMin(), c.getRangeMax(), c.getDefaultClamped(), c.getDefaultValue()]
                   for c in (coordinates.get(i) for i in range(coordinates.getSize()))},
        "contact": model.getContactGeometrySet().getSize(),
        "centres": [],
        "torques": [],
        "muscles": [],
    }
    states = opensim.createStateVariableNamesInSystemOrder(model)
    order = [name.split("/")[-2] for name in states if name.endswith("/value")]
    solver = opensim.InverseDynamicsSolver(model)
    for sample in motion["samples"]:
        sample["names"] = motion["names"]
        place(coordinates, state, sample)
        model.realizeVelocity(state)
        out["centres"].append(vector(model.calcMassCenterPosition(state)))
        if "activations" in sample:
            out["muscles"].append(muscles(model, state, sample["activations"]))
        du = opensim.Vector(len(order), 0.0)
        values = dict(zip(sample["names"], sample["du"]))
        for i, name in enumerate(order):
            du.set(i, values.get(name, 0.0))
        found = solver.solve(state, du)
        out["torques"].append({name: found.get(i) for i, name in enumerate(order)})
    out["poses"] = poses(model, motion["times"])
    if motion["kinematics"]:
        out["angles"] = inverse_kinematics(folder, model)
    print("RESULT " + json.dumps(out))


if len(sys.argv) > 1:
    main(pathlib.Path(sys.argv[1]))
