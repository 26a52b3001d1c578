"""Steps models in Drake for drake_engine.cpp, one after the other: answers requests, both with binary doubles.

Request: `M` and a line of JSON, the model, whose answer is a line with Drake's version; `P`, then 13 doubles for each body
(place, orientation w x y z, velocity, angular velocity) and q, u of all coordinates; or `S`, then a force for each coordinate,
which makes a step. Answer to `P` and `S`: 13 doubles for each body, a number of contacts, and 9 doubles for each: shape a,
shape b, place, normal out of b, depth. Where a request fails the answer is one line of text on standard error and the end.
"""
import importlib.metadata
import json
import logging
import struct
import sys
import xml.etree.ElementTree as ElementTree

import numpy as np
from pydrake.geometry import (AddRigidHydroelasticProperties, CollisionFilterDeclaration, GeometrySet, HalfSpace,
                              ProximityProperties, RoleAssign, SceneGraphConfig)
from pydrake.math import RigidTransform
from pydrake.common.eigen_geometry import Quaternion
from pydrake.multibody.math import SpatialVelocity
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import (AddMultibodyPlantSceneGraph, ContactModel,
                                     DiscreteContactApproximation)
from pydrake.multibody.tree import PrismaticJoint, PrismaticSpring, RevoluteSpring, RevoluteJoint
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

logging.getLogger("drake").setLevel(logging.ERROR)


def one_joint_a_body(mjcf):
    """Drake 1.51's parser puts the first of a body's joints at the place of the parent, so every body gets one."""
    root = ElementTree.fromstring(mjcf)
    for parent in list(root.iter()):
        for index, body in enumerate(list(parent)):
            joints = body.findall("joint") if body.tag == "body" else []
            if len(joints) < 2:
                continue
            before = ElementTree.Element("body", {"name": body.get("name") + "_before", "pos": body.get("pos"),
                                                  "quat": body.get("quat")})
            body.set("pos", "0 0 0")
            body.set("quat", "1 0 0 0")
            body.remove(joints[0])
            before.append(joints[0])
            before.append(body)
            parent.remove(body)
            parent.insert(index, before)
    return ElementTree.tostring(root, encoding="unicode")


class World:
    def __init__(self, model):
        builder = DiagramBuilder()
        self.plant, self.graph = AddMultibodyPlantSceneGraph(builder, model["step"])
        plant = self.plant
        hydroelastic = model["hydroelastic"]
        plant.set_contact_model(ContactModel.kHydroelasticWithFallback if hydroelastic else ContactModel.kPoint)
        plant.set_discrete_contact_approximation(
            {"sap": DiscreteContactApproximation.kSap, "similar": DiscreteContactApproximation.kSimilar,
             "lagged": DiscreteContactApproximation.kLagged, "tamsi": DiscreteContactApproximation.kTamsi}[
                 model["approximation"]])
        plant.set_stiction_tolerance(model["stiction_tolerance"])
        config = SceneGraphConfig()
        surface = config.default_proximity_properties
        surface.point_stiffness = model["point_stiffness"]
        surface.hunt_crossley_dissipation = 50
        if hydroelastic:
            surface.compliance_type = "compliant"
            surface.hydroelastic_modulus = model["hydroelastic_modulus"]
            surface.resolution_hint = 0.005
            surface.slab_thickness = 0.1
        self.graph.set_config(config)
        Parser(builder).AddModelsFromString(one_joint_a_body(model["mjcf"]), "xml")
        self.bodies = [plant.GetBodyByName(name) for name in model["bodies"]]
        self.floating = model["floating"]
        self.joints = [plant.GetJointByName(name) if name else None for name in model["coordinates"]]
        # What its parser of MJCF leaves out: springs, and which shapes may touch.
        for joint, (stiffness, rest) in zip(self.joints, model["springs"]):
            if joint is None or not stiffness:
                continue
            kind = PrismaticSpring if isinstance(joint, PrismaticJoint) else RevoluteSpring
            plant.AddForceElement(kind(joint, rest, stiffness))
        plant.mutable_gravity_field().set_gravity_vector(model["gravity"])
        plant.Finalize()
        self.inspect = self.graph.model_inspector()
        names = {name: index for index, name in enumerate(model["shapes"])}
        self.shape_of = {}
        for geometry in self.inspect.GetAllGeometryIds():
            name = self.inspect.GetName(geometry).rpartition("::")[2]
            if name in names and self.inspect.GetProximityProperties(geometry) is not None:
                self.shape_of[geometry] = names[name]
        # Two compliant shapes of which one is a half space have no hydroelastic contact.
        for geometry in self.shape_of if hydroelastic else []:
            if isinstance(self.inspect.GetShape(geometry), HalfSpace):
                rigid = ProximityProperties(self.inspect.GetProximityProperties(geometry))
                AddRigidHydroelasticProperties(properties=rigid)
                self.graph.AssignRole(plant.get_source_id(), geometry, rigid, RoleAssign.kReplace)
        allowed = {tuple(sorted(pair)) for pair in model["pairs"]}
        filters = self.graph.collision_filter_manager()
        for a, b in self.inspect.GetCollisionCandidates():
            if tuple(sorted((self.shape_of.get(a, -1), self.shape_of.get(b, -1)))) not in allowed:
                filters.Apply(CollisionFilterDeclaration().ExcludeBetween(GeometrySet([a]), GeometrySet([b])))
        self.diagram = builder.Build()
        self.simulator = Simulator(self.diagram)
        self.context = self.plant.GetMyMutableContextFromRoot(self.simulator.get_mutable_context())
        self.step_size, self.count = model["step"], 0
        self.forces = self.plant.get_applied_generalized_force_input_port()
        self.generalized = np.zeros(self.plant.num_velocities())
        self.forces.FixValue(self.context, self.generalized)
        if self.plant.num_actuators() > 0:
            self.plant.get_actuation_input_port().FixValue(self.context, np.zeros(self.plant.num_actuators()))
        self.tests = bool(model["pairs"])

    def put(self, states, q, u):
        plant, context = self.plant, self.context
        for body, floats, s in zip(self.bodies, self.floating, states):
            if floats:
                plant.SetFreeBodyPose(context, body, RigidTransform(Quaternion(s[3:7] / np.linalg.norm(s[3:7])), s[:3]))
                plant.SetFreeBodySpatialVelocity(context, body, SpatialVelocity(s[10:13], s[7:10]))
        positions, velocities = plant.GetPositions(context), plant.GetVelocities(context)
        for joint, place, rate in zip(self.joints, q, u):
            if joint is not None:
                positions[joint.position_start()] = place
                velocities[joint.velocity_start()] = rate
        plant.SetPositions(context, positions)
        plant.SetVelocities(context, velocities)
        self.count = 0
        self.simulator.get_mutable_context().SetTime(0)
        self.simulator.Initialize()

    def step(self, forces):
        self.generalized[:] = 0
        for joint, force in zip(self.joints, forces):
            if joint is not None:
                self.generalized[joint.velocity_start()] = force
        self.forces.FixValue(self.context, self.generalized)
        self.count += 1
        self.simulator.AdvanceTo(self.count * self.step_size)

    def contacts(self):
        if not self.tests:
            return []
        query = self.plant.get_geometry_query_input_port().Eval(self.context)
        found = []
        for pair in query.ComputePointPairPenetration():
            # nhat_BA_W points out of B into A.
            found.append([self.shape_of[pair.id_A], self.shape_of[pair.id_B],
                          *(0.5 * (pair.p_WCa + pair.p_WCb)), *pair.nhat_BA_W, pair.depth])
        return found

    def answer(self, out):
        plant, context = self.plant, self.context
        values = []
        for body in self.bodies:
            pose = plant.EvalBodyPoseInWorld(context, body)
            twist = plant.EvalBodySpatialVelocityInWorld(context, body)
            values += [*pose.translation(), *pose.rotation().ToQuaternion().wxyz(),
                       *twist.translational(), *twist.rotational()]
        contacts = self.contacts()
        values.append(len(contacts))
        for contact in contacts:
            values += contact
        out.write(struct.pack(f"{len(values)}d", *values))
        out.flush()


def main():
    source, out = sys.stdin.buffer, sys.stdout.buffer
    while kind := source.read(1):
        if kind == b"M":
            model = json.loads(source.readline())
            world = World(model)
            bodies, dofs = len(model["bodies"]), len(model["coordinates"])
            out.write(f"{importlib.metadata.version('drake')}\n".encode())
            out.flush()
            continue
        if kind == b"P":
            values = np.frombuffer(source.read(8 * (13 * bodies + 2 * dofs)))
            states = values[:13 * bodies].reshape(bodies, 13)
            world.put(states, values[13 * bodies:13 * bodies + dofs], values[13 * bodies + dofs:])
        else:
            world.step(np.frombuffer(source.read(8 * dofs)))
        world.answer(out)


if __name__ == "__main__":
    try:
        main()
    except Exception as error:  # noqa: BLE001: said to the engine's user
        sys.exit(str(error).splitlines()[0])
