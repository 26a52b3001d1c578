"""Runs OpenSim's static optimisation on an exported model and prints, as JSON, what it finds. The test writes FOLDER with
  model.osim, motion.sto, activations.sto (ours)
  question.json: start, end and interval [rows of the motion] of the optimisation; `passive`: whether OpenSim gets the
                 muscles' passive forces, which its static optimisation leaves out, as forces of their own; `reserves`: torque
                 of a unit by coordinate [N m]; `loads`: body, point [m] and force [N], in the ground.
Usage: opensim_activations.py FOLDER"""
import copy
import json
import math
import pathlib
import re
import sys
import xml.etree.ElementTree as ET

import opensim


def add(parent, kind, name=None, **texts):
    out = ET.SubElement(parent, kind, {"name": name} if name else {})
    for key, text in texts.items():
        ET.SubElement(out, key).text = text if isinstance(text, str) else f"{text:.17g}"
    return out


def add_passive(forces):
    """The passive curve of each muscle, by its fibres' length, as a force of the muscle's path."""
    for muscle in forces.findall("RigidTendonMuscle"):
        def number(key):
            return float(muscle.find(key).text)
        fibres, pennation = number("optimal_fiber_length"), number("pennation_angle_at_optimal")
        [curve] = [each for each in muscle.findall("ExpressionBasedFunction") if each.get("name") == "passive_force_length_curve"]
        length = f"sqrt({(fibres * math.sin(pennation)) ** 2:.17g}+s^2)"
        law = re.sub(r"\bx\b", f"({length}/{fibres:.17g})", curve.find("expression").text)
        force = add(forces, "ExpressionBasedPathForce", muscle.get("name") + ".passive", resting_length=number("tendon_slack_length"),
                    expression=f"{number('max_isometric_force'):.17g}*s/{length}*{law}", clamp_stretch="false")
        force.append(copy.deepcopy(muscle.find("FunctionBasedPath")))


def add_rest(forces, question):
    for name, torque in question["reserves"].items():
        add(forces, "CoordinateActuator", name + ".reserve", coordinate=name, optimal_force=torque, min_control=-1e9, max_control=1e9)
    for load in question["loads"]:
        force = add(forces, "PrescribedForce", load["body"] + ".load", socket_frame="/bodyset/" + load["body"],
                    pointIsGlobal="true", forceIsGlobal="true")
        for kind, vector in (("forceFunctions", load["force"]), ("pointFunctions", load["point"])):
            objects = ET.SubElement(add(force, "FunctionSet", kind), "objects")
            for value in vector:
                add(objects, "Constant", value=value)


def optimised(folder, question):
    """The table of activations that OpenSim's tool writes."""
    tree = ET.parse(folder / "model.osim")
    forces = tree.find(".//ForceSet/objects")
    if question["passive"]:
        add_passive(forces)
    add_rest(forces, question)
    tree.write(folder / "asked.osim")
    analysis = opensim.StaticOptimization()
    analysis.setName("muscles")
    analysis.setStartTime(question["start"])
    analysis.setEndTime(question["end"])
    analysis.setStepInterval(question["interval"])
    analysis.setUseModelForceSet(True)
    analysis.setActivationExponent(2)
    analysis.setUseMusclePhysiology(True)
    analysis.setConvergenceCriterion(1e-7)
    analysis.setMaxIterations(2000)
    tool = opensim.AnalyzeTool()
    tool.setName("asked")
    tool.setModelFilename(str(folder / "asked.osim"))
    tool.setCoordinatesFileName(str(folder / "motion.sto"))
    tool.setLowpassCutoffFrequency(-1)
    tool.setInitialTime(question["start"])
    tool.setFinalTime(question["end"])
    tool.setResultsDir(str(folder))
    tool.updAnalysisSet().cloneAndAppend(analysis)
    tool.printToXML(str(folder / "setup.xml"))
    opensim.AnalyzeTool(str(folder / "setup.xml")).run()
    return opensim.TimeSeriesTable(str(folder / "asked_muscles_activation.sto"))


def columns(table):
    return {name: table.getDependentColumn(name).to_numpy().tolist() for name in table.getColumnLabels()}


def main(folder):
    question = json.loads((folder / "question.json").read_text())
    opensim.Logger.addFileSink(str(folder / "opensim.log"))
    opensim.Logger.setLevelString("warn")
    found = optimised(folder, question)
    ours = opensim.TimeSeriesTable(str(folder / "activations.sto"))
    failures = (folder / "opensim.log").read_text().count("OPTIMIZATION FAILED")
    print("RESULT " + json.dumps({"version": opensim.GetVersion(), "times": list(found.getIndependentColumn()), "found": columns(found),
                                  "ours": columns(ours), "our_times": list(ours.getIndependentColumn()), "failures": failures}))


main(pathlib.Path(sys.argv[1]))
