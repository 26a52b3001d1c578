"""MCAP files with ROS 2 messages of a motion: joint states, transforms of the bodies, wrenches of contact.

mcap and mcap-ros2-support write them (pip install mcap-ros2-support); no ROS is needed. Readers are Foxglove, `ros2 bag` and rosbags.
"""
from __future__ import annotations

import io
from typing import Any, Iterator, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ._errors import input_error
from ._model import turned
from ._progress import bar
from ._scene import Scene
from ._simulation import Simulation

Array = NDArray[np.float64]
TIME = "int32 sec\nuint32 nanosec\n"
HEADER = "builtin_interfaces/Time stamp\nstring frame_id\n"
VECTOR, TURN = "float64 x\nfloat64 y\nfloat64 z\n", "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"
PARTS = {"std_msgs/Header": HEADER, "builtin_interfaces/Time": TIME, "geometry_msgs/Vector3": VECTOR, "geometry_msgs/Quaternion": TURN,
         "geometry_msgs/Transform": "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n",
         "geometry_msgs/TransformStamped": "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n",
         "geometry_msgs/Wrench": "geometry_msgs/Vector3 force\ngeometry_msgs/Vector3 torque\n"}
"""Definitions of ROS 2."""
STATE = ("sensor_msgs/msg/JointState", "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n",
         ("std_msgs/Header", "builtin_interfaces/Time"))
TREE = ("tf2_msgs/msg/TFMessage", "geometry_msgs/TransformStamped[] transforms\n",
        ("geometry_msgs/TransformStamped", "std_msgs/Header", "builtin_interfaces/Time", "geometry_msgs/Transform", "geometry_msgs/Vector3",
         "geometry_msgs/Quaternion"))
WRENCH = ("geometry_msgs/msg/WrenchStamped", "std_msgs/Header header\ngeometry_msgs/Wrench wrench\n",
          ("std_msgs/Header", "builtin_interfaces/Time", "geometry_msgs/Wrench", "geometry_msgs/Vector3"))


class Sample(NamedTuple):
    """A moment of a motion."""

    time: float
    position: Array
    """Of each coordinate [rad or m]."""
    rate: Array
    effort: Array
    """That acted [N m or N]."""
    poses: Array
    """x y z, quaternion w x y z of each body, shape (bodies, 7)."""
    wrenches: Array
    """Of contact on each body in its own axes, about its origin: force and moment, shape (bodies, 6)."""


def _inverse(q: Array) -> Array:
    return np.asarray(q * [1.0, -1.0, -1.0, -1.0])


def _wrenches(run: Simulation, of_shape: dict[str, int], poses: Array) -> Array:
    contacts, out = run.contacts, np.zeros((len(poses), 6))
    for names, sign in ((contacts.a, 1.0), (contacts.b, -1.0)):
        for name, place, force in zip(names, contacts.position, contacts.force):
            body = of_shape[name]
            out[body, :3] += sign * force
            out[body, 3:] += sign * np.cross(place - poses[body, :3], force)
    for body in np.flatnonzero(out.any(axis=1)):
        out[body] = turned(_inverse(poses[body, 3:]), out[body].reshape(2, 3)).ravel()
    return out


def samples(scene: Scene, end: float, fps: float, show: bool) -> Iterator[Sample]:
    """Moments of a simulation, from its start to its end. :raises Error: of kind physics where it diverges"""
    run = Simulation(scene)
    of_shape = {shape.name: shape.body for shape in scene._model.shapes}
    steps, number = max(1, round(1 / fps / scene.step)), round(end / scene.step)
    with bar(show, "simulates") as told:
        while True:
            bodies = run.bodies
            poses = np.concatenate([bodies.position, bodies.quaternion], axis=1)
            yield Sample(run.time, np.array(run.q), np.array(run.u), np.array(run.tau), poses, _wrenches(run, of_shape, poses))
            if run.steps >= number:
                return
            run.step(substeps=min(steps, number - run.steps))
            if told:
                told(min(1.0, run.steps / max(1, number)))


def _vector(x: Array) -> dict[str, float]:
    return dict(zip("xyz", x.tolist()))


def needs_writer() -> Any:
    """:raises Error: of kind input without the libraries"""
    try:
        from mcap_ros2.writer import Writer
    except ImportError as error:
        raise input_error("--format", f"mcap and a Python without its library ({error})", "it: pip install mcap-ros2-support") from None
    return Writer


def mcap_of(scene: Scene, motion: list[Sample]) -> bytes:
    out = io.BytesIO()
    writer = needs_writer()(out)
    state, tree, wrench = (writer.register_msgdef(name, text + "".join(f"{'=' * 80}\nMSG: {part}\n{PARTS[part]}" for part in parts))
                           for name, text, parts in (STATE, TREE, WRENCH))
    touched = np.flatnonzero(np.any([each.wrenches.any(axis=1) for each in motion], axis=0))
    for each in motion:
        nanoseconds = round(1e9 * each.time)
        stamp = {"sec": nanoseconds // 10**9, "nanosec": nanoseconds % 10**9}

        def write(topic: str, schema: Any, message: dict[str, Any]) -> None:
            writer.write_message(topic, schema, message, log_time=nanoseconds, publish_time=nanoseconds)

        write("/joint_states", state, {"header": {"stamp": stamp, "frame_id": ""}, "name": scene.coordinates, "position": each.position.tolist(),
                                       "velocity": each.rate.tolist(), "effort": each.effort.tolist()})
        write("/tf", tree, {"transforms": [
            {"header": {"stamp": stamp, "frame_id": "world"}, "child_frame_id": name,
             "transform": {"translation": _vector(x[:3]), "rotation": dict(zip("wxyz", x[3:].tolist()))}}
            for name, x in zip(scene.bodies[1:], each.poses[1:])]})
        for body in touched[touched > 0]:
            name, of = scene.bodies[body], each.wrenches[body]
            write("/contact/" + name.replace(".", "/"), wrench, {"header": {"stamp": stamp, "frame_id": name},
                                                                "wrench": {"force": _vector(of[:3]), "torque": _vector(of[3:])}})
    writer.finish()
    return out.getvalue()
