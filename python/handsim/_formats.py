"""The one table of the formats of ``handsim export``: the command, its help and completion, docs/export.md and `Scene.to_format` read it.

A new format is a row here and its writer.
"""
from __future__ import annotations

from importlib import import_module
from typing import Any, Callable, NamedTuple


class Format(NamedTuple):
    """A format of a file for other programs."""

    name: str
    endings: list[str]
    """Of its files, each with its dot; the first is the default."""
    text: str
    """Whom it is for, and what is in it."""
    of: str
    """What it is written of: some of scene, hand and run."""
    needs: str
    """A package beside NumPy; may be empty."""
    file: str
    """What such a file is, for messages."""
    mark: bytes
    """What its beginning has."""
    writer: str
    """Module and function: of a `_model.Model` to its text, where `of_model`; else of an `export.Job` to the file's content, and what it
    has, in words."""
    of_model: bool = False

    @property
    def write(self) -> Callable[[Any], Any]:
        module, function = self.writer.split(":")
        found: Callable[[Any], Any] = getattr(import_module(f"handsim.{module}"), function)
        return found

    @property
    def endings_text(self) -> str:
        return " or ".join(self.endings)


FORMATS = {of.name: of for of in (
    Format("mjcf", [".xml", ".mjcf"], "MuJoCo: model, drives, contact rules, the state at the start or at --time", "scene, hand", "",
           "an MJCF file", b"<mujoco", "_mjcf:mjcf_of", True),
    Format("urdf", [".urdf"], "ROS and robots' programs: links, joints, shapes that collide", "scene, hand", "",
           "a URDF file", b"<robot", "_urdf:urdf_of", True),
    Format("osim", [".osim"], "OpenSim: bodies, joints, tissue, muscles, markers", "scene, hand", "",
           "an OpenSim file", b"<OpenSimDocument", "_osim:osim_of", True),
    Format("glb", [".glb"], "glTF, for viewers and animators: skin with a skeleton, shapes, motion", "scene, hand, run", "",
           "a binary glTF file", b"glTF", "export:glb_file"),
    Format("usda", [".usda"], "USD as text: skin, shapes, motion, masses and joints", "scene, hand, run", "",
           "a USD text file", b"#usda", "export:usda_file"),
    Format("obj", [".obj"], "surfaces at a moment, in metres", "scene, hand, run", "",
           "an OBJ file of handsim", b"# handsim: metres", "export:obj_file"),
    Format("stl", [".stl"], "surfaces at a moment for printers, in millimetres", "scene, hand, run", "",
           "an STL file of handsim", b"handsim: millimetres", "export:stl_file"),
    Format("mcap", [".mcap"], "ROS 2 messages of the motion, for Foxglove and rosbags", "scene, run", "mcap-ros2-support",
           "an MCAP file", b"MCAP0", "export:mcap_file"),
)}
