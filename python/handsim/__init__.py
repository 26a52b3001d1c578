"""handsim: biomechanical hands of a given person, built from body data and simulated.

    import handsim as hs
    scene = hs.load("two_hands")
    result = scene.run()

`Hand` computes a hand, `load` compiles a scene, `Scene.run` simulates it, `Simulation` steps one, `Batch` steps many on
all cores, `live` runs one in real time with a page, `Object` is a mesh made fit for scenes, `grasps` finds grasps of one, `handsim.study` has the studies and `handsim.gym` environments for gymnasium. Units are SI, angles rad.
"""
from __future__ import annotations

import contextlib
import importlib.util
import os
import shutil
from typing import TYPE_CHECKING, Any

from . import _core, study
from ._batch import Batch
from ._core import Frame, Motion, Snapshot
from ._errors import Error, Fault, Problem
from ._derivatives import Derivatives
from ._gradients import Product, Rollout
from ._grasp_plan_command import grasps
from ._hand import Hand, draw_persons
from ._live import Live, live
from ._object import Object
from ._pictures import contact_sheet, png, save_png
from ._reports import report, save_video
from ._scene import Muscle, Result, Scene, load
from ._shipped import data_path, scenes
from ._simulation import Bodies, Contacts, Muscles, Parameters, Simulation, Taxels
from ._smoothing import Smoothing
from ._table import Quantities, Table
from ._verdict import Verdict

if TYPE_CHECKING:
    from . import gym

__version__: str = _core.version
has_pictures: bool
"""False in a build without OSMesa and EGL, or on a system without them: nothing can be drawn. Asking loads OpenGL."""
has_reports: bool = _core.has_reports
"""False in a build without three.js: runs have no reports."""

if "HANDSIM_FFMPEG" not in os.environ and not shutil.which("ffmpeg") and importlib.util.find_spec("imageio_ffmpeg"):
    from imageio_ffmpeg import get_ffmpeg_exe

    with contextlib.suppress(RuntimeError):  # it has no program for this system
        os.environ["HANDSIM_FFMPEG"] = get_ffmpeg_exe()


def __getattr__(name: str) -> Any:
    # OpenGL's library and gymnasium are loaded by those who use them.
    if name == "has_pictures":
        return _core.has_pictures()
    if name == "gym":
        import importlib

        return importlib.import_module(".gym", __name__)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


__all__ = ["Batch", "Bodies", "Contacts", "Derivatives", "Error", "Fault", "Frame", "Hand", "Live", "Motion", "Muscle",
           "Muscles", "Object", "Parameters", "Problem", "Product", "Quantities", "Result", "Rollout", "Scene", "Simulation",
           "Smoothing", "Snapshot", "Table", "Taxels", "Verdict", "contact_sheet", "data_path", "draw_persons", "grasps", "gym", "has_pictures",
           "has_reports", "live", "load", "png", "report", "save_png", "save_video", "scenes", "study"]
