"""The suite in Drake (pip install drake): URDF, contact by SAP, PD gains of the joints' actuators, which are implicit."""
from __future__ import annotations

import sys
from importlib.metadata import version
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
import numpy as np  # noqa: E402
from pydrake.common.eigen_geometry import Quaternion  # noqa: E402
from pydrake.geometry import CollisionFilterDeclaration, GeometrySet, SceneGraphConfig  # noqa: E402
from pydrake.math import RigidTransform  # noqa: E402
from pydrake.multibody.math import SpatialForce, SpatialVelocity  # noqa: E402
from pydrake.multibody.parsing import Parser  # noqa: E402
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, DiscreteContactApproximation, ExternallyAppliedSpatialForce  # noqa: E402
from pydrake.multibody.tree import PdControllerGains, PrismaticSpring, RevoluteSpring  # noqa: E402
from pydrake.systems.analysis import Simulator  # noqa: E402
from pydrake.systems.framework import DiagramBuilder  # noqa: E402

import suite  # noqa: E402

MODULUS = 1e8  # of rigid surfaces [Pa]
POSE = ("x", "y", "z", "qw", "qx", "qy", "qz")


def pose(row: suite.Row, prefix: str = "") -> RigidTransform:
    x = row.vector(*(prefix + name for name in POSE))
    return RigidTransform(Quaternion(x[3:] / np.linalg.norm(x[3:])), x[:3])


def simulate(case: suite.Case, results: suite.Results) -> None:
    if not case.spec["urdf"]:
        raise NotImplementedError("no URDF, and a loop")
    builder = DiagramBuilder()
    plant, graph = AddMultibodyPlantSceneGraph(builder, case.step)
    plant.set_discrete_contact_approximation(DiscreteContactApproximation.kSap)
    config = SceneGraphConfig()
    surface = config.default_proximity_properties
    # Two surfaces in series; all pairs of a case have the same one.
    first = case.pairs[0] if case.pairs else {"friction": 0.0, "stiffness": np.inf, "damping": np.inf}
    soft = np.isfinite(first["stiffness"])
    surface.static_friction = surface.dynamic_friction = first["friction"]
    if soft:
        surface.point_stiffness, surface.relaxation_time = 2 * first["stiffness"], first["damping"] / first["stiffness"] / 2
    else:
        # One point of contact cannot hold a box: pressure over the surface of contact.
        surface.relaxation_time = case.step / 2
        surface.compliance_type, surface.hydroelastic_modulus, surface.resolution_hint = "compliant", MODULUS, 0.005
    graph.set_config(config)
    parser = Parser(plant)
    parser.SetAutoRenaming(True)
    for each in case.spec["urdf"]:
        parser.AddModels(str(case.folder / "urdf" / each["file"]))
        if each["fixed"] and each["root"] != "world":
            plant.WeldFrames(plant.world_frame(), plant.GetFrameByName(each["root"]), pose(case.bodies[each["root"]]))
    actuators = {}
    for name, joint in case.joints.items():
        if joint["tissue_stiffness"]:
            spring = PrismaticSpring if joint.text("kind") == "slider" else RevoluteSpring
            plant.AddForceElement(spring(plant.GetJointByName(name), joint["tissue_rest"], joint["tissue_stiffness"]))
        if joint["gain"] or joint["feed"]:
            existing = [plant.get_joint_actuator(i) for i in plant.GetJointActuatorIndices()]
            actuators[name] = next((each for each in existing if each.joint().name() == name), None) or plant.AddJointActuator(
                name, plant.GetJointByName(name), min(joint["limit"], 1e6))
            if joint["gain"]:
                actuators[name].set_controller_gains(PdControllerGains(p=joint["gain"], d=joint["rate_gain"]))
    plant.mutable_gravity_field().set_gravity_vector(case.gravity(0))
    plant.Finalize()
    inspect, allowed = graph.model_inspector(), {frozenset((row.text("a"), row.text("b"))) for row in case.pairs}
    owner = lambda shape: plant.GetBodyFromFrameId(inspect.GetFrameId(shape)).name()  # noqa: E731
    for a, b in inspect.GetCollisionCandidates():
        if frozenset((owner(a), owner(b))) not in allowed:
            graph.collision_filter_manager().Apply(CollisionFilterDeclaration().ExcludeBetween(GeometrySet([a]), GeometrySet([b])))
    simulator = Simulator(builder.Build())
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    feed = np.zeros(plant.num_actuators())
    for name, actuator in actuators.items():
        feed[actuator.input_start()] = case.joints[name]["feed"]
    if len(feed):
        plant.get_actuation_input_port().FixValue(context, feed)
    for model in {actuator.model_instance() for actuator in actuators.values()}:
        names = {plant.get_joint_actuator(i).joint().name(): k for k, i in enumerate(plant.GetJointActuatorIndices(model))}
        wanted = np.zeros(2 * len(names))
        for name, k in names.items():
            wanted[k] = case.joints[name]["target"]
        if plant.get_desired_state_input_port(model).size():
            plant.get_desired_state_input_port(model).FixValue(context, wanted)
    for name, joint in case.joints.items():
        moved = plant.GetJointByName(name)
        set_place, set_rate = ((moved.set_translation, moved.set_translation_rate) if joint.text("kind") == "slider"
                               else (moved.set_angle, moved.set_angular_rate))
        set_place(context, joint["start"])
        set_rate(context, joint["rate"])
    in_link = {name: pose(row, "link_") for name, row in case.bodies.items()}
    bodies = {name: plant.GetBodyByName(name) for name in case.bodies}
    for name, body in bodies.items():
        if body.is_floating_base_body():
            plant.SetFreeBodyPose(context, body, pose(case.bodies[name]))
            plant.SetFreeBodySpatialVelocity(context, body, SpatialVelocity(case.bodies[name].vector("wx", "wy", "wz"),
                                                                            case.bodies[name].vector("vx", "vy", "vz")))
    still = case.gravity(0)
    for step in range(case.steps + 1):
        time = step * case.step
        if step % case.every == 0:
            report(case, results, plant, graph, context, bodies, in_link, time)
        pushed, extra = [], case.gravity(time) - still
        for name, body in bodies.items() if extra.any() else ():
            force = ExternallyAppliedSpatialForce()
            force.body_index, force.p_BoBq_B = body.index(), in_link[name].translation()
            force.F_Bq_W = SpatialForce(np.zeros(3), case.bodies[name]["mass"] * extra)
            pushed.append(force)
        plant.get_applied_spatial_force_input_port().FixValue(context, pushed)
        simulator.AdvanceTo(time + case.step)


def report(case, results, plant, graph, context, bodies, in_link, time) -> None:
    total, normal = np.zeros(3), 0.0
    contacts = plant.get_contact_results_output_port().Eval(context)
    for k in range(contacts.num_point_pair_contacts()):
        pair = contacts.point_pair_contact_info(k)
        names = [plant.get_body(index).name() for index in (pair.bodyA_index(), pair.bodyB_index())]
        if case.touched in names:
            total += pair.contact_force() * (1 if names[1] == case.touched else -1)
            normal += abs(pair.contact_force() @ pair.point_pair().nhat_BA_W)
    for k in range(contacts.num_hydroelastic_contacts()):
        info, inspect = contacts.hydroelastic_contact_info(k), graph.model_inspector()
        shapes = (info.contact_surface().id_M(), info.contact_surface().id_N())
        names = [plant.GetBodyFromFrameId(inspect.GetFrameId(shape)).name() for shape in shapes]
        if case.touched in names:
            # The force on the first; how much of it is normal it does not say.
            total, normal = total + info.F_Ac_W().translational() * (1 if names[0] == case.touched else -1), None
    for name in case.recorded:
        link, twist = plant.EvalBodyPoseInWorld(context, bodies[name]), plant.EvalBodySpatialVelocityInWorld(context, bodies[name])
        at = link @ in_link[name]
        velocity = twist.translational() + np.cross(twist.rotational(), at.translation() - link.translation())
        results.add(time, name, at.translation(), at.rotation().ToQuaternion().wxyz(), velocity, twist.rotational(),
                    *((total, normal) if name == case.touched and time else (None, None)))


if __name__ == "__main__":
    sys.exit(suite.run("Drake", version("drake"), "SAP; pads by points, rigid surfaces hydroelastic of 1e8 Pa", simulate))
